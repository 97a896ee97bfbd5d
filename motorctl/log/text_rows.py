"""Read the rows of a text file one by one, as where some of its lines are none."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.text_head import Head
from motorctl.log.text_lines import BLANKS, COMMENTS, EMPTY, is_number
from motorctl.log.text_times import is_time

_SHOWN_CHARACTERS = 40


@dataclass
class TextRows:
    """What stands in the rows of a text file."""

    numbers: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """Columns of numbers, (N,); an empty cell is NaN."""
    times: dict[str, list[str]] = field(default_factory=dict)
    """Columns whose first cell is a date or a time of day, (N,) as they are written."""
    lines: array[int] = field(default_factory=lambda: array("q"))
    """The line of each row, from 1."""
    remarks: int = 0
    """Lines of text that were left out."""
    first_remark: tuple[int, str] = (0, "")
    """The first of them, and what it says."""
    cut_line: int = 0
    """The last line, where it ends before its row does; 0 where it does not."""


def read_rows(path: Path, head: Head, names: Sequence[str]) -> TextRows:
    """Read columns, and leave out the lines without any number, and a last one that is cut.

    Parameters
    ----------
    path
        The file.
    head
        What its columns are called, and where rows begin.
    names
        The columns that are read.

    Raises
    ------
    DataError
        With the line, where a row has another number of cells, or one that is no number.
    """
    of = _Columns(path, head, names)
    lines = _lines_of_cells(path, head)
    following = next(lines, None)
    while following is not None:
        line, cells = following
        following = next(lines, None)
        if following is None and of.is_cut(line, cells):
            break
        if of.is_row(line, cells):
            of.take(line, cells)
    return of.finished()


def lines_of_rows(path: Path, head: Head) -> array[int]:
    """Return the line of each row, from 1, of a file whose lines are rows or blank."""
    return array("q", (line for line, _ in _lines_of_cells(path, head)))


def _lines_of_cells(path: Path, head: Head) -> Iterator[tuple[int, list[str]]]:
    """Yield every line below the head that is not blank, by its number, and its cells."""
    try:
        with path.open(encoding=head.encoding, errors="replace", newline="") as file:
            for _ in range(head.lines):
                file.readline()
            if head.delimiter == BLANKS:
                for line, text in enumerate(file, head.lines + 1):
                    if cells := _before_remark(text).split():
                        yield line, cells
            else:
                reader = csv.reader(file, delimiter=head.delimiter)
                for cells in reader:
                    if len(cells) > 1 or (cells and cells[0].strip()):
                        yield head.lines + reader.line_num, cells
    except (OSError, csv.Error) as error:
        raise DataError(f"{path}: cannot be read: {error}") from error


def _before_remark(text: str) -> str:
    for mark in COMMENTS:
        text = text.partition(mark)[0]
    return text


class _Columns:
    """Columns that grow row by row."""

    def __init__(self, path: Path, head: Head, names: Sequence[str]) -> None:
        self._path, self._head = path, head
        self._names = [name.strip() for name in head.names]
        self._places = {name: head.names.index(name) for name in names}
        self._numbers = {name: array("d") for name in names}
        self._times: dict[str, list[str]] = {}
        self._told: set[str] = set()  # columns of which a first cell was seen
        self._rows = TextRows()
        self._fewest = 1 + max(self._places.values())
        self._label = ""  # the first cell of a row may be a word that each begins with
        self._narrowest = len(head.names)  # cells of a row so far: a last column may be left empty

    def is_row(self, line: int, cells: list[str]) -> bool:
        """Return whether a line is a row; note it where it is a text, refuse a damaged row."""
        blanks = self._head.delimiter == BLANKS
        wide = len(self._head.names)
        fits = len(cells) >= self._fewest if blanks else len(cells) == wide
        remark = not blanks and self._is_text(cells, fits)
        if fits and not blanks and not remark:
            return True
        if not remark and any(is_number(cell.strip(), self._head.delimiter) for cell in cells):
            if fits:
                return True
            raise DataError(
                f"{self._path}: line {line}: {len(cells)} values where the header has {wide} "
                "columns; cut or damaged there?"
            )
        if not self._rows.remarks:
            text = (" " if blanks else self._head.delimiter).join(cells).strip()
            self._rows.first_remark = line, text[:_SHOWN_CHARACTERS]
        self._rows.remarks += 1
        return False

    def _is_text(self, cells: list[str], fits: bool) -> bool:
        """Return whether a line is a remark, or the header once more.

        Rows may begin with what marks a remark elsewhere: such a line is one where all that is read
        of it are numbers. A row without any number is damaged, and not left out: without a column
        of times the rows are the clock.
        """
        stripped = [cell.strip() for cell in cells]
        read = [stripped[k] for k in self._places.values()] if fits else []
        if stripped[0].startswith(COMMENTS) and stripped[0] != self._label:
            return not read or not all(map(self._is_value, read))
        words = all(cell[:1].isalpha() and not self._is_value(cell) for cell in read)
        header = stripped == self._names or len(self._rows.lines) <= 1
        return fits and words and header and not any(map(self._is_value, stripped))

    def _is_value(self, cell: str) -> bool:
        return is_number(cell, self._head.delimiter) or is_time(cell)

    def is_cut(self, line: int, cells: list[str]) -> bool:
        """Return whether the last line ends before its row does; note it where rows precede it."""
        begin = cells[0].strip()
        if (
            len(cells) >= self._narrowest
            or not self._rows.lines
            or not (self._is_value(begin) or begin == self._label)
        ):
            return False
        self._rows.cut_line = line
        return True

    def take(self, line: int, cells: list[str]) -> None:
        """Append a row."""
        self._rows.lines.append(line)
        self._label = cells[0].strip()
        self._narrowest = min(self._narrowest, len(cells))
        for name, place in self._places.items():
            cell = cells[place].strip()
            empty = cell in EMPTY
            if not empty and name not in self._told:
                self._told.add(name)
                if is_time(cell):
                    self._times[name] = [""] * len(self._numbers[name])
            if name in self._times:
                self._times[name].append("" if empty else cell)
            else:
                self._numbers[name].append(np.nan if empty else self._number(line, name, cell))

    def finished(self) -> TextRows:
        """Return what was read; raises DataError where no line was a row."""
        rows = self._rows
        if rows.remarks and not rows.lines:
            line, text = rows.first_remark
            between = {BLANKS: "blanks", "\t": "tabs"}.get(
                self._head.delimiter, f"'{self._head.delimiter}'"
            )
            raise DataError(
                f"{self._path}: none of the {rows.remarks} lines below the header has numbers "
                f"between {between}: line {line} is '{text}'; should be "
                f"{len(self._head.names)} cells as in the header"
            )
        rows.times = self._times
        rows.numbers = {n: np.array(c) for n, c in self._numbers.items() if n not in self._times}
        return rows

    def _number(self, line: int, name: str, cell: str) -> float:
        comma = self._head.decimal_point == ","
        plain = cell.replace(",", ".") if comma and "." not in cell else cell
        try:
            value = float(plain)
        except ValueError:
            value = None
        if value is None or "_" in cell or (comma and "." in cell):
            raise DataError(
                f"{self._path}: line {line}: column '{name}' is not a number: "
                f"'{cell[:_SHOWN_CHARACTERS]}'"
            )
        return value
