"""Refuse numbers that nobody explains: a module's numeric constant has a string under it.

    python tools/constants_told.py [FOLDER …]

Looks at every name in capitals that a module of the given folders (by default motorctl/identify)
sets to a number, or to a tuple, list, set or dictionary of numbers. The string says what the number
is, in which unit, what breaks when it is larger or smaller, and where it comes from; that there is
one can be checked, that it is true cannot.
Prints file, line and name of each that has none, and exits with 1 where there is any.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "motorctl" / "identify"


def untold(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and name of every numeric constant of a source file without a string under it."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for statement, after in zip(body, [*body[1:], None], strict=True):
        name = _constant(statement)
        if name is not None and not _is_string(after):
            yield statement.lineno, name


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


def _is_string(statement: ast.stmt | None) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def main(folders: list[str]) -> int:
    """Print every constant without a string and return the exit status."""
    found = 0
    for folder in map(Path, folders or [str(PACKAGE)]):
        for path in sorted(folder.rglob("*.py")):
            for line, name in untold(path):
                print(f"{path}:{line}: {name} has no string under it that says what it is")
                found += 1
    if found:
        print(f"{found} constants: say what each is, its unit, what breaks, where it comes from")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
