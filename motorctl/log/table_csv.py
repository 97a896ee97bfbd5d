"""Columns of a text file."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from motorctl.errors import DataError
from motorctl.log.table import Array, Table
from motorctl.log.text_head import read_head
from motorctl.log.text_lines import BLANKS, COMMENTS, EMPTY
from motorctl.log.text_rows import lines_of_rows, read_rows
from motorctl.log.text_times import seconds_since_first


class CsvTable(Table):
    """A text file with one line of names: separated by comma, semicolon, tab or blanks.

    Lines that begin with # or % may precede the header, or the last of them may be the header, as
    numpy.savetxt writes it. A title, remarks of an instrument above the header and units below it
    are left out, and told in `notes`. Without a header columns are named by their number, from 1.
    Decimal commas are understood where the separator is none.

    Parameters
    ----------
    path
        The file.
    header_line
        The line with the names of the columns, from 1, where it is told.
    wanted
        Columns that will be read: of several lines that may be the header, the one that has them
        is.
    """

    kind = "CSV"

    def __init__(
        self, path: Path, header_line: int | None = None, wanted: Collection[str] = ()
    ) -> None:
        self._head = read_head(path, header_line, wanted)
        super().__init__(path, self._head.names)
        self.notes = self._head.notes
        self._lines: array[int] | None = None

    def _row_in_file(self, index: int) -> str:
        """Return where a row stands, by its number and its line."""
        if self._lines is None:  # every line was a row or blank
            self._lines = lines_of_rows(self.path, self._head)
        line = f" (line {self._lines[index]})" if index < len(self._lines) else ""
        return f"row {index + 1}{line}"

    def listing(self) -> str:
        """List the columns, and say where they have no names."""
        line = self._head.lines + 1
        told = f" (line {line}: numbers where the names of columns should be)"
        return super().listing() + (told if self._head.headless else "")

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        self._lines = None
        read = self._between_blanks if self._head.delimiter == BLANKS else self._parsed
        try:
            return read(names)
        except (pa.ArrowException, OSError, ValueError):  # some lines are no rows of numbers
            return self._line_by_line(names)

    def _line_by_line(self, names: Sequence[str]) -> dict[str, Array]:
        rows = read_rows(self.path, self._head, names)
        self._lines = rows.lines
        self.passed_over = rows.remarks + bool(rows.cut_line)
        if rows.remarks:
            line, text = rows.first_remark
            many = rows.remarks > 1
            told = f"{rows.remarks} lines of text" if many else "a line of text"
            first = f"the first line {line}" if many else f"line {line}"
            note = f"{told} among the rows left out, {first}: '{text}'"
            self.notes = tuple(dict.fromkeys((*self.notes, note)))
        if rows.cut_line:
            note = f"the last line, {rows.cut_line}, ends before its row does: left out"
            self.notes = tuple(dict.fromkeys((*self.notes, note)))
        return {
            name: self._seconds(name, rows.times[name])
            if name in rows.times
            else rows.numbers[name]
            for name in names
        }

    def _seconds(self, name: str, cells: Sequence[str]) -> Array:
        """Return the seconds of a column of times, and tell of it."""
        seconds, wrong = seconds_since_first(cells)
        if wrong is not None:
            raise DataError(
                f"{self.path}: {self.row(wrong)}: column '{name}' is not a time like the first: "
                f"'{cells[wrong][:40]}'"
            )
        begin = next(cell for cell in cells if cell)
        self.in_seconds[name] = begin
        note = f"column '{name}' has times, the first {begin}: seconds from there"
        self.notes = tuple(dict.fromkeys((*self.notes, note)))
        return seconds

    def _parsed(self, names: Sequence[str]) -> dict[str, Array]:
        """Read by Arrow's parser, which is quick, and refuses what is no row of numbers.

        What may be passed over is left to Python: a handler of ours would be called from Arrow's
        threads.
        """
        table = pa.csv.read_csv(
            self.path,
            read_options=pa.csv.ReadOptions(
                column_names=list(self.names),
                skip_rows=self._head.lines,
                encoding=self._head.encoding.removesuffix("-sig"),
            ),
            parse_options=pa.csv.ParseOptions(delimiter=self._head.delimiter),
            convert_options=pa.csv.ConvertOptions(
                include_columns=list(names),
                column_types={name: pa.float64() for name in names},
                null_values=[*EMPTY, *(f" {empty}" for empty in EMPTY)],
                decimal_point=self._head.decimal_point,
            ),
        )
        return {name: np.array(table.column(name).to_numpy()) for name in names}

    def _between_blanks(self, names: Sequence[str]) -> dict[str, Array]:
        rows = np.loadtxt(
            self.path,
            comments=list(COMMENTS),
            skiprows=self._head.lines,
            usecols=[self.names.index(name) for name in names],
            ndmin=2,
            encoding=self._head.encoding,
        )
        return {name: rows[:, k].copy() for k, name in enumerate(names)}
