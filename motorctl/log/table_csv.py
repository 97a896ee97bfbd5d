"""Columns of a text file."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv

from motorctl.errors import DataError
from motorctl.log.table import Array, Table
from motorctl.log.text_head import read_head
from motorctl.log.text_lines import (
    BLANKS,
    COMMENTS,
    EMPTY,
    all_cells,
    first_lines,
    is_number,
    is_remark,
)
from motorctl.log.text_times import is_time, seconds_since_first


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
        self._remarks: list[str] = []

    def _row_in_file(self, index: int) -> str:
        """Return where a row stands, by its number and its line."""
        return f"row {index + 1} (line {self._head.lines + index + 1})"

    def listing(self) -> str:
        """List the columns, and say where they have no names."""
        line = self._head.lines + 1
        told = f" (line {line}: numbers where the names of columns should be)"
        return super().listing() + (told if self._head.headless else "")

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        if self._head.delimiter == BLANKS:
            return self._between_blanks(names)
        times: frozenset[str] = frozenset()
        try:
            table = self._parse(names, threads=True)
        except (pa.ArrowException, OSError, ValueError):
            times = self._times_among(names)
            try:  # the parser knows the row only where it works in one thread
                table = self._parse(names, threads=False, times=times)
            except (pa.ArrowException, OSError, ValueError) as error:
                raise DataError(self._cause(str(error))) from error
        if self._remarks:
            first, count = sorted(self._remarks)[0][:40], len(self._remarks)
            told = "a line of text" if count == 1 else f"{count} lines of text"
            self.notes += (f"{told} among the rows left out, as '{first}'",)
        return {
            name: self._seconds(name, table.column(name).to_pylist())
            if name in times
            else np.array(table.column(name).to_numpy())
            for name in names
        }

    def _times_among(self, names: Sequence[str]) -> frozenset[str]:
        """Return which columns have dates or times of day in the first row."""
        lines = first_lines(self.path, self._head.lines + 1, self._head.encoding)
        row = next((line for line in lines[self._head.lines :] if not is_remark(line)), "")
        cells = dict(zip(self.names, all_cells(row, self._head.delimiter), strict=False))
        return frozenset(name for name in names if is_time(cells.get(name, "")))

    def _seconds(self, name: str, cells: list[str | None]) -> Array:
        """Return the seconds of a column of times, and tell of it."""
        seconds, wrong = seconds_since_first(cells)
        if wrong is not None:
            raise DataError(
                f"{self.path}: {self.row(wrong)}: column '{name}' is not a time like the first: "
                f"'{str(cells[wrong])[:40]}'"
            )
        self.in_seconds |= {name}
        self.notes += (f"column '{name}' has times, the first {cells[0]}: seconds from there",)
        return seconds

    def _parse(
        self, names: Sequence[str], threads: bool, times: frozenset[str] = frozenset()
    ) -> pa.Table:
        self._remarks = []
        return pa.csv.read_csv(
            self.path,
            read_options=pa.csv.ReadOptions(
                use_threads=threads,
                column_names=list(self.names),
                skip_rows=self._head.lines,
                encoding=self._head.encoding.removesuffix("-sig"),
            ),
            parse_options=pa.csv.ParseOptions(
                delimiter=self._head.delimiter, invalid_row_handler=self._passed_over
            ),
            convert_options=pa.csv.ConvertOptions(
                include_columns=list(names),
                column_types={n: pa.string() if n in times else pa.float64() for n in names},
                null_values=[*EMPTY, *(f" {empty}" for empty in EMPTY)],
                decimal_point=self._head.decimal_point,
            ),
        )

    def _passed_over(self, row: pa.csv.InvalidRow) -> Literal["skip", "error"]:
        """Pass over a line without a number, and note its text; of too few cells it is an error."""
        text = row.text.strip()
        if any(
            is_number(cell, self._head.delimiter) for cell in all_cells(text, self._head.delimiter)
        ):
            return "error"
        if text:
            self._remarks.append(text)
        return "skip"

    def _between_blanks(self, names: Sequence[str]) -> dict[str, Array]:
        try:
            rows = np.loadtxt(
                self.path,
                comments=list(COMMENTS),
                skiprows=self._head.lines,
                usecols=[self.names.index(name) for name in names],
                ndmin=2,
                encoding=self._head.encoding,
            )
        except (ValueError, OSError) as error:
            raise DataError(f"{self.path}: {str(error).splitlines()[0]}") from error
        return {name: rows[:, k].copy() for k, name in enumerate(names)}

    def _cause(self, message: str) -> str:
        """Return the parser's complaint in the file's own words: line, column, value."""
        line = ""
        if row := re.search(r"Row #(\d+): ?", message):
            line = f"line {row[1]}: "
        if value := re.search(r"In CSV column #(\d+): .*invalid value '(.*?)'", message, re.S):
            column = self.names[int(value[1])]
            return f"{self.path}: {line}column '{column}' is not a number: '{value[2][:40]}'"
        if width := re.search(r"Expected (\d+) columns, got (\d+)", message):
            return (
                f"{self.path}: {line}{width[2]} values where the header has {width[1]} columns; "
                "cut or damaged there?"
            )
        if "Empty CSV file" in message:
            return f"{self.path}: a header, but no rows"
        return f"{self.path}: not a readable CSV file: {message.splitlines()[0]}"
