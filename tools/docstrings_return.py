"""Refuse docstrings that begin with "Give" where numpydoc says "Return" or "Yield".

    python tools/docstrings_return.py [FOLDER …]

Looks at every function of the given folders (by default all that the project consists of) that
returns or yields something. One that only does something may give: "Give up priority and CPU"; so
may one that says besides what it returns: "Give a command, and return the answer to it".
Prints file, line and name of each, and exits with 1 where there is any.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("motorctl", "drivers", "devices", "benchmarks", "docs", "examples", "tools", "tests")
GIVES = re.compile(r"\s*gives?\b(?!.*\b(?:return|yield))", re.IGNORECASE)

Function = ast.FunctionDef | ast.AsyncFunctionDef


def giving(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and name of every function of a source file that "gives" what it returns."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, Function):
            continue
        if GIVES.match(ast.get_docstring(node) or "") and _returns(node):
            yield node.lineno, node.name


def _returns(function: Function) -> bool:
    """Return whether a function returns or yields anything but None; its inner ones don't count."""
    open_nodes: list[ast.AST] = list(function.body)
    while open_nodes:
        match open_nodes.pop():
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef() | ast.Lambda():
                continue
            case ast.Yield() | ast.YieldFrom():
                return True
            case ast.Return(value=ast.expr() as value) if not _is_none(value):
                return True
            case node:
                open_nodes += ast.iter_child_nodes(node)
    return not _is_none(function.returns)


def _is_none(value: ast.expr | None) -> bool:
    return value is None or (isinstance(value, ast.Constant) and value.value is None)


def main(folders: list[str]) -> int:
    """Print every function that gives what it returns, and return the exit status."""
    found = 0
    for folder in map(Path, folders or [str(ROOT / name) for name in FOLDERS]):
        for path in sorted(folder.rglob("*.py")):
            for line, name in giving(path):
                print(f'{path}:{line}: {name}: say "Return" or "Yield" where it says "Give"')
                found += 1
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
