"""Lines of a text file of columns: what separates their cells, and which are numbers."""

from __future__ import annotations

import codecs
import csv
from pathlib import Path

from motorctl.errors import DataError

DELIMITERS = ",;\t"
BLANKS = " "
COMMENTS = ("#", "%")
EMPTY = ("", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null", "ovf", "-ovf")
"""What a cell holds where nothing was measured; a microcontroller prints `ovf` for too large."""
UTF_8 = "utf-8-sig"
WINDOWS = "cp1252"
UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
"""How a file in UTF-16 begins."""
_LOOKED_AT_BYTES = 1 << 16
"""Of a file, to see how its letters are written. More takes time, fewer may miss the first letter
beyond ASCII in a long title. Chosen by hand."""
_NOT_IN_TEXT = bytes(set(range(32)) - set(b"\t\n\v\f\r\x1a\x1b"))
_LONGEST_LINE = 1 << 20
_MOST_HEAD_LINES = 1000


def encoding_of(path: Path) -> str:
    """Return how the letters of a text file are written.

    UTF-8, or UTF-16 behind its mark, or else what Windows' programs write in Western Europe: only
    names of columns and remarks have letters, so that a wrong one changes no number.

    Raises
    ------
    DataError
        Where it is no text file, or cannot be read.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_LOOKED_AT_BYTES)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    if start.startswith(UTF_16):
        return "utf-16"
    if start.translate(None, _NOT_IN_TEXT) != start:
        raise DataError(f"{path}: not a text file: it has bytes that no text has")
    for encoding in (UTF_8, WINDOWS):
        try:  # a letter may be cut at the end
            codecs.getincrementaldecoder(encoding)().decode(start)
        except UnicodeDecodeError:
            continue
        return encoding
    raise DataError(f"{path}: not a text file: neither UTF-8, UTF-16 nor Windows-1252")


def first_lines(path: Path, beyond_comments: int, encoding: str) -> list[str]:
    """Return the first lines of a file, so many that are neither blank nor remarks among them."""
    try:
        with path.open(encoding=encoding, newline="") as file:
            lines: list[str] = []
            found = 0
            while found < beyond_comments and len(lines) < _MOST_HEAD_LINES:
                line = file.readline(_LONGEST_LINE)
                if not line:
                    break
                lines.append(line.rstrip("\r\n"))
                found += not is_remark(line)
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not a text file in {encoding}") from error
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
