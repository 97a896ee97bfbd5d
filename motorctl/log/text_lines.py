"""Lines of a text file of columns: what separates their cells, and which are numbers."""

from __future__ import annotations

import csv
from pathlib import Path

from motorctl.errors import DataError

DELIMITERS = ",;\t"
BLANKS = " "
COMMENTS = ("#", "%")
EMPTY = ("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null")
"""What a cell holds where nothing was measured."""
_LONGEST_LINE = 1 << 20
_MOST_HEAD_LINES = 1000


def first_lines(path: Path, beyond_comments: int) -> list[str]:
    """Return the first lines of a file, so many that are neither blank nor remarks among them."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines: list[str] = []
            found = 0
            while found < beyond_comments and len(lines) < _MOST_HEAD_LINES:
                line = file.readline(_LONGEST_LINE)
                if not line:
                    break
                lines.append(line.rstrip("\r\n"))
                found += not is_remark(line)
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not a text file in UTF-8") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    return lines


def is_remark(line: str) -> bool:
    """Return whether a line is blank, or begins as remarks do."""
    return not line.strip() or line.startswith(COMMENTS)


def delimiter_of(line: str) -> str:
    """Return what separates the cells of a line: what stands in it most often."""
    found = max(DELIMITERS, key=line.count)
    return found if found in line else BLANKS


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, without the empty one behind a separator at its end."""
    cells = all_cells(line, delimiter)
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def all_cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line."""
    if delimiter == BLANKS:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error:  # longer than any cell that it reads
        return [line]


def is_number(cell: str, delimiter: str) -> bool:
    """Return whether a cell is a number, or says that there is none.

    With a decimal comma where commas separate nothing.
    """
    if cell in EMPTY:
        return True
    try:
        float(cell if delimiter == "," else cell.replace(",", "."))
    except ValueError:
        return False
    return True
