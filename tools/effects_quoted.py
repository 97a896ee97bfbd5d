"""Refuse code that quotes an effect by its name: what is known of an effect stands in its own file.

    python tools/effects_quoted.py [FOLDER …]

Looks at every string of the given folders (by default the package motorctl) but docstrings and the
effects' own files. A string offends that is an effect's name, and one that has such a name as a
word in it where the name is no ordinary English word. Effects may use ordinary words for
parameters of their own. Python files alone are looked at.
Benchmarks and the simulated gantry may name effects, and are not looked at: their tables say what
is true of a machine, and are worth something only where motorctl's effects do not tell them.
Prints file, line and name of each, and exits with 1 where there is any.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "motorctl"
EFFECTS = PACKAGE / "model" / "effects"
ORDINARY_WORDS = ("inertia", "offset")


def effect_names(folder: Path = EFFECTS) -> dict[str, Path]:
    """Return the file of every effect by its name, read from the sources without importing them."""
    found = {}
    for path in sorted(folder.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                for item in node.body:
                    name = _assigned_text(item, "name")
                    if name is not None:
                        found[name] = path
    return found


def quoted(path: Path, names: dict[str, Path]) -> Iterator[tuple[int, str]]:
    """Yield line and name of every quotation in a source file."""
    foreign = [name for name, own in names.items() if own != path]
    telling = [name for name in foreign if name not in ORDINARY_WORDS]
    inside = re.compile(rf"\b({'|'.join(telling)})\b")
    if path.parent == EFFECTS:
        foreign = telling
    tree = ast.parse(path.read_text(encoding="utf-8"))
    prose = _docstrings(tree)
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Constant) and isinstance(node.value, str)) or node in prose:
            continue
        if node.value in foreign:
            yield node.lineno, node.value
        elif match := inside.search(node.value):
            yield node.lineno, match[0]


def _docstrings(tree: ast.AST) -> set[ast.AST]:
    """Return the string statements of a tree: docstrings, and words under a constant."""
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }


def _assigned_text(item: ast.stmt, name: str) -> str | None:
    if isinstance(item, ast.Assign) and isinstance(item.value, ast.Constant):
        targets = [target.id for target in item.targets if isinstance(target, ast.Name)]
        if name in targets and isinstance(item.value.value, str):
            return item.value.value
    return None


def main(folders: list[str]) -> int:
    """Print every quotation and return the exit status."""
    names = effect_names()
    found = 0
    for folder in map(Path, folders or [str(PACKAGE)]):
        for path in sorted(folder.rglob("*.py")):
            for line, name in quoted(path.resolve(), names):
                print(f"{path}:{line}: quotes the effect '{name}'; ask the effect instead")
                found += 1
    if found:
        print(f"{found} quotations: what is known of an effect belongs into its own file")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
