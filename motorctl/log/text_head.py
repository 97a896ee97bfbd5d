"""What stands above the rows of a text file, and what its columns are called."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.errors import DataError
from motorctl.log.header_below_title import Found, header_below_title, rows_below
from motorctl.log.text_lines import (
    BLANKS,
    COMMENTS,
    UTF_8,
    WINDOWS,
    all_cells,
    cells_of,
    delimiter_of,
    encoding_of,
    first_lines,
    is_number,
    is_remark,
)

_SEARCHED_ROWS = 300
"""Lines that are looked at where names do not stand in the first one. More takes time, fewer misses
the table below the settings that an instrument writes above it. Chosen by hand: oscilloscopes write
some twenty lines, data loggers up to a hundred."""
_ROWS_FOR_DECIMALS = 50
"""Lines in which the first number with a fraction is looked for. More takes time, fewer misses
decimal commas behind a beginning of whole numbers. Chosen by hand."""
_SHOWN = 4
_SHOWN_CHARACTERS = 40


@dataclass(frozen=True)
class Head:
    """How the columns of a text file are called, and where its rows begin."""

    names: tuple[str, ...]
    lines: int
    """How many lines precede the first row."""
    delimiter: str
    decimal_point: str
    headless: bool = False
    encoding: str = UTF_8
    notes: tuple[str, ...] = ()


def read_head(path: Path, header_line: int | None, wanted: Collection[str]) -> Head:
    """Find the names of the columns and the first row of a text file.

    Parameters
    ----------
    path
        The file.
    header_line
        The line with the names, from 1; None: it is looked for.
    wanted
        Columns that will be read, for choosing between lines that may both be it.

    Returns
    -------
    Head
        The names, where rows begin, and in `notes` what was left out above them.

    Raises
    ------
    DataError
        Where there is no header, or two lines may be it.
    """
    encoding = encoding_of(path)
    if header_line is not None:
        head = _head_in_line(path, header_line, encoding)
    else:
        head = _found_head(path, wanted, encoding)
    if encoding == WINDOWS:
        told = "its letters are not UTF-8, and were read as Windows-1252"
        head = replace(head, notes=(*head.notes, told))
    return replace(head, encoding=encoding)


def _found_head(path: Path, wanted: Collection[str], encoding: str) -> Head:
    lines = first_lines(path, _ROWS_FOR_DECIMALS, encoding)
    head = _plain_head(path, lines)
    row = next((line for line in lines[head.lines :] if not is_remark(line)), None)
    if row is None or _is_plain(row, head, wanted):
        return head
    lines = first_lines(path, _SEARCHED_ROWS, encoding)
    found = header_below_title(path, lines, wanted)
    return head if found is None else _below(lines, found)


def _plain_head(path: Path, lines: list[str]) -> Head:
    """Return the head of a file whose first line, remarks apart, has the names or numbers."""
    comments = next((k for k, line in enumerate(lines) if not is_remark(line)), None)
    if comments is None:
        raise DataError(f"{path}: no header line with the names of columns")
    header, count = lines[comments], comments + 1
    cells = cells_of(header, delimiter_of(header))
    headless, width = all(is_number(cell, ",") for cell in cells), len(cells)
    if comments and headless:
        named = lines[comments - 1].lstrip("".join(COMMENTS))
        if len(cells_of(named, delimiter_of(named))) == width:
            header, count, headless = named, comments, False
    delimiter = delimiter_of(header)
    if headless:
        return _with_rows(lines, _numbered(width), count - 1, delimiter, header, headless)
    return _with_rows(lines, tuple(all_cells(header, delimiter)), count, delimiter, header)


def _numbered(width: int) -> tuple[str, ...]:
    return tuple(str(k + 1) for k in range(width))


def _with_rows(
    lines: list[str],
    names: tuple[str, ...],
    count: int,
    delimiter: str,
    header: str,
    headless: bool = False,
) -> Head:
    """Return the head with what the rows show: their ends, blanks in names, decimals."""
    row = lines[count] if count < len(lines) else ""
    ends = delimiter != BLANKS and row.rstrip(" ").endswith(delimiter)
    if ends and row.count(delimiter) == len(names):
        names = (*names, "")  # rows end with a separator: behind it is a column of nothing
    if delimiter == BLANKS and len(row.split()) != len(names):
        delimiter = ","  # one column, whose name may have blanks
        names = (header.strip(),)
    return Head(names, count, delimiter, _decimal_point(lines[count:], delimiter), headless)


def _decimal_point(rows: list[str], delimiter: str) -> str:
    """Return what the first number with a fraction has; times of day and words have no say."""
    if delimiter == ",":
        return "."
    for row in rows:
        numbers = [cell for cell in cells_of(row, delimiter) if is_number(cell, delimiter)]
        if any("." in cell for cell in numbers):
            return "."
        if any("," in cell for cell in numbers):
            return ","
    return "."


def _is_plain(row: str, head: Head, wanted: Collection[str]) -> bool:
    """Return whether a row of numbers fits the names above it, and these are what is wanted."""
    cells = cells_of(row, head.delimiter)
    named = len(head.names) - (head.names[-1] == "")
    numbers = all(is_number(cell, head.delimiter) for cell in cells)
    return len(cells) == named and numbers and set(wanted) <= set(head.names)


def _head_in_line(path: Path, header_line: int, encoding: str) -> Head:
    lines = first_lines(path, header_line + _SEARCHED_ROWS, encoding)
    if header_line >= len(lines):
        raise DataError(
            f"{path}: header_line is {header_line}, but the file has {len(lines)} lines; should be "
            "the line with the names of the columns, from 1"
        )
    below = rows_below(lines, header_line - 1)
    if below is None:
        raise DataError(
            f"{path}: header_line is {header_line}, and no row of numbers follows; should be the "
            "line with the names of the columns, from 1"
        )
    return _below(lines, below)


def _below(lines: list[str], found: Found) -> Head:
    """Return the head of which the lines are known."""
    header, first, delimiter, width = found
    if header is None:
        named, names = "", _numbered(width)
    else:
        named = lines[header].lstrip("".join(COMMENTS))
        names = tuple(all_cells(named, delimiter)[:width])  # a name without values has no column
    head = _with_rows(lines, names, first, delimiter, named, header is None)
    return replace(head, notes=tuple(_left_out(lines, header, first)))


def _left_out(lines: list[str], header: int | None, first: int) -> Iterator[str]:
    """Say which lines are not used."""
    unused = [k for k in range(first) if k != header and not is_remark(lines[k])]
    if not unused:
        return
    which = ", ".join(
        f"{k + 1} ('{lines[k].strip()[:_SHOWN_CHARACTERS]}')" for k in unused[:_SHOWN]
    )
    more = f" and {len(unused) - _SHOWN} more" if len(unused) > _SHOWN else ""
    names = "columns are counted" if header is None else f"line {header + 1} names the columns"
    yield (
        f"{names}, rows begin in line {first + 1}; line{'s' if len(unused) > 1 else ''} "
        f"{which}{more} {'are' if len(unused) > 1 else 'is'} not used"
    )
