"""Find the names of columns in a text file that begins with something else.

Instruments and spreadsheets write a title and settings above them, and units below. The table is
known from its end: rows of equal width, numbers in the same columns. What stands right above it in
as many cells may be the names.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from motorctl.errors import DataError
from motorctl.log.text_lines import BLANKS, all_cells, cells_of, is_number, is_remark
from motorctl.log.units import (
    COMMAND_UNITS,
    POSITION_UNITS,
    TIME_UNITS,
    VELOCITY_UNITS,
    usual_spelling,
)

_ORDER = "\t;," + BLANKS
"""Separators in the order in which they are tried: a comma may be that of decimals."""
_MOSTLY = 0.8
"""Part of the rows in which a column has to be a number to be one of measurements. Larger loses
columns with gaps of text, smaller takes remarks for measurements. Chosen by hand."""
_HALF = 0.5
"""Part of the columns of measurements that are numbers in a damaged row, and part of the rows that
end with a separator where all do. Larger takes damaged rows for a header, smaller takes settings
above the header for rows. Chosen by hand."""
_SHOWN_LINES = 8
_SHOWN_CHARACTERS = 70
_BRACKETED = re.compile(r"[\[(<{].*[\])>}]|-*")
_UNITS = frozenset(
    {*POSITION_UNITS, *VELOCITY_UNITS, *COMMAND_UNITS, *TIME_UNITS, "count", "Hz", "1", "m/s^2"}
    | {"sec", "seconds", "second", "milliseconds", "volt", "volts", "amp", "amps", "ampere"}
    | {"newton", "newtons", "metre", "metres", "meter", "meters", "millimeter", "millimeters"}
    | {"m/s²", "m/s2", "rad/s^2", "rad/s2", "rad/s²", "°", "°/s", "°C", "degC", "none", "bool"}
)


class Found(NamedTuple):
    """Lines from 0: that of the names, None where there is none, and the first row."""

    header: int | None
    first: int
    delimiter: str
    width: int
    """How many cells rows have."""


class _Table(NamedTuple):
    """The lines that are as wide as rows are, and which of their columns are measurements."""

    lines: list[int]
    cells: list[list[str]]
    numeric: list[int]
    delimiter: str

    def numbers(self, row: int) -> float:
        """Return in which part of the columns of measurements a row has numbers or nothing."""
        cells = [self.cells[row][k] for k in self.numeric]
        if not any(cells):
            return 0.0
        return sum(is_number(cell, self.delimiter) for cell in cells) / len(cells)


def header_below_title(path: Path, lines: Sequence[str], wanted: Collection[str]) -> Found | None:
    """Find the names below other lines; None where no table is found.

    Parameters
    ----------
    path
        The file, for messages.
    lines
        Its first lines.
    wanted
        Names that the header must have, where several lines may be it.

    Returns
    -------
    Found or None
        None where the lines below do not look like rows of a table.

    Raises
    ------
    DataError
        Where it is not clear which line it is: with the first lines, and what to set.
    """
    table = _table(lines)
    if table is None:
        return None
    first = _first_row(table)
    if first is None:
        return None
    heads = [k for k in range(first) if table.numbers(k) < _HALF]
    named = [k for k in heads if all(table.cells[k][c] for c in table.numeric)]
    names = [k for k in named if not _are_units(table.cells[k])]
    row, width = table.lines[first], len(table.cells[first])
    if wanted and (exact := [k for k in heads if set(wanted) <= set(table.cells[k])]):
        names = exact
    elif wanted and all(name.isdecimal() for name in wanted):
        return Found(None, row, table.delimiter, width)  # columns are counted, whatever their names
    if len(names) == 1:
        return Found(table.lines[names[0]], row, table.delimiter, width)
    if heads:
        raise DataError(_unclear(path, lines, [table.lines[k] for k in names or heads]))
    above = [k for k in range(row) if not is_remark(lines[k])]
    widths = [len(cells_of(lines[k], table.delimiter)) for k in above]
    if all(count == 1 for count in widths):
        return Found(None, row, table.delimiter, width)
    if len(widths) > 1 and widths[-1] > width:
        raise DataError(_unclear(path, lines, above[-1:]))
    return None


def rows_below(lines: Sequence[str], header: int) -> Found | None:
    """Return where rows begin below a line of names, from 0; None where none follow."""
    below = [*("" for _ in lines[: header + 1]), *lines[header + 1 :]]
    table = _table(below)
    if table is None or (first := _first_row(table)) is None:
        return None
    return Found(header, table.lines[first], table.delimiter, len(table.cells[first]))


def _table(lines: Sequence[str]) -> _Table | None:
    """Return the table that the lines end with, of the separator that gives most measurements."""
    tried = [_table_of(lines, delimiter) for delimiter in _ORDER]
    return max((t for t in tried if t), key=lambda t: len(t.numeric), default=None)


def _table_of(lines: Sequence[str], delimiter: str) -> _Table | None:
    used = [(k, line) for k, line in enumerate(lines) if not is_remark(line)]
    tail = [all_cells(line, delimiter) for _, line in used[len(used) // 2 :]]
    if not tail:
        return None
    width, _ = Counter(len(cells) for cells in tail).most_common(1)[0]
    ends = sum(len(c) == width and not c[-1] for c in tail) > _HALF * len(tail)
    as_wide = [(k, _in_width(all_cells(line, delimiter), width, ends)) for k, line in used]
    while as_wide and as_wide[-1][1] is None:  # the last line may be cut
        as_wide.pop()
    begin = len(as_wide)
    while begin and as_wide[begin - 1][1] is not None:
        begin -= 1
    rows = [cells for _, cells in as_wide[begin:] if cells is not None]
    later = rows[len(rows) // 2 :]
    numeric = [
        k
        for k in range(width)
        if sum(is_number(cells[k], delimiter) for cells in later) > _MOSTLY * len(later)
    ]
    if width < 2 or not numeric:
        return None
    return _Table([k for k, _ in as_wide[begin:]], rows, numeric, delimiter)


def _in_width(cells: list[str], width: int, ends: bool) -> list[str] | None:
    """Return so many cells, or None; `ends`: rows end with a separator, which heads may lack."""
    if ends and len(cells) == width - 1:
        return [*cells, ""]
    return cells if len(cells) == width else None


def _first_row(table: _Table) -> int | None:
    """Return the first row of numbers; damaged ones right above it are rows as well."""
    first = next((k for k in range(len(table.cells)) if table.numbers(k) == 1.0), None)
    while first and table.numbers(first - 1) >= _HALF:
        first -= 1
    return first


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether a line has units below names: in brackets, or such as are known."""
    return all(_BRACKETED.fullmatch(c) or usual_spelling(c) in _UNITS for c in cells)


def _unclear(path: Path, lines: Sequence[str], candidates: Sequence[int]) -> str:
    begin = "\n".join(
        f"  {k + 1}: {line.strip()[:_SHOWN_CHARACTERS]}"
        for k, line in enumerate(lines[: max(_SHOWN_LINES, candidates[-1] + 2)])
    )
    may = " or ".join(str(k + 1) for k in candidates)
    return (
        f"{path}: the names of the columns may stand in line {may}: say which in a YAML "
        f"description, with header_line: {candidates[-1] + 1}. The file begins:\n{begin}"
    )
