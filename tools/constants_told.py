"""Refuse numbers that nobody explains: a module's numeric constant has a string under it.

    python tools/constants_told.py [FOLDER …]

Looks at every name in capitals that a module of the given folders (by default motorctl/identify and
motorctl/model) sets to a number, or to a tuple, list, set or dictionary of numbers. Under it stands
a string that says what the number is and in which unit, and that has

- a clause on what breaks: "Larger …, smaller …", "More …, fewer …", "Nearer to 1 …";
- a clause on the source: "Chosen by hand", "Chosen on …", "Arithmetic", "Convention",
  "Measured on …", "Learned by …", "Published", "By definition".

Nothing breaks with a number that only looks depend on, for which any other would do as well (a
seed), that is so by definition, or that quotes what somebody else published: such a string says
that instead, and gives its source like any other. That these clauses stand there can be checked,
that they are true cannot.
Prints file, line, name and what is missing, and exits with 1 where there is any.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = (ROOT / "motorctl" / "identify", ROOT / "motorctl" / "model")

_CLAUSE = r"(?:^|[.;:,(] )(?:but |and )?"
SOURCE = re.compile(
    _CLAUSE + r"(?:(?:chosen|learned) (?:by|on)|arithmetic|convention|measured on|published"
    r"|by definition)\b",
    re.IGNORECASE,
)
BREAKS = re.compile(
    _CLAUSE + r"(?:larger|smaller|more|fewer|longer|shorter|nearer|further|closer)\b",
    re.IGNORECASE,
)
NOTHING_BREAKS = re.compile(
    _CLAUSE + r"(?:only [\w' ]+ depends? on it|any other would do|by definition|published)\b",
    re.IGNORECASE,
)


def untold(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield line and name of every numeric constant of a source file, and what it fails to say."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for statement, after in zip(body, [*body[1:], None], strict=True):
        name = _constant(statement)
        if name is None:
            continue
        told = _string(after)
        if told is None:
            yield statement.lineno, name, "has no string under it that says what it is"
            continue
        if not (BREAKS.search(told) or NOTHING_BREAKS.search(told)):
            yield statement.lineno, name, "does not say what breaks when it is larger or smaller"
        if not SOURCE.search(told):
            yield statement.lineno, name, "does not say where it comes from"


def _constant(statement: ast.stmt) -> str | None:
    """Return the names in capitals that a statement sets to numbers, if it does."""
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
        targets = [statement.target]
    else:
        return None
    names = ", ".join(map(ast.unparse, targets))
    return names if names.isupper() and _is_numeric(statement.value) else None


def _is_numeric(value: ast.expr | None) -> bool:
    match value:
        case ast.Constant(value=number):
            return isinstance(number, int | float) and not isinstance(number, bool)
        case ast.UnaryOp(operand=operand):
            return _is_numeric(operand)
        case ast.BinOp(left=left, right=right):
            return _is_numeric(left) and _is_numeric(right)
        case ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Set(elts=parts):
            return bool(parts) and all(map(_is_numeric, parts))
        case ast.Dict(values=parts):
            return bool(parts) and all(map(_is_numeric, parts))
    return False


def _string(statement: ast.stmt | None) -> str | None:
    """Return the text of a statement that is but a string, its white space single blanks."""
    match statement:
        case ast.Expr(value=ast.Constant(value=str(text))):
            return " ".join(text.split())
    return None


def main(folders: list[str]) -> int:
    """Print what every constant fails to say and return the exit status."""
    found = 0
    for folder in [Path(folder) for folder in folders] or PACKAGES:
        for path in sorted(folder.rglob("*.py")):
            for line, name, missing in untold(path):
                print(f"{path}:{line}: {name} {missing}")
                found += 1
    if found:
        print(f"{found} gaps: say what each is, its unit, what breaks, where it comes from")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
