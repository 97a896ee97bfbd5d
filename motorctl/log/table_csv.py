"""Columns of a text file."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from motorctl.errors import DataError
from motorctl.log.table import Array, Table

_DELIMITERS = ",;\t"
_BLANKS = " "
_COMMENTS = ("#", "%")
_LONGEST_LINE = 1 << 20
_MOST_HEAD_LINES = 1000
_EMPTY = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null"]


class CsvTable(Table):
    """A text file with one header line: separated by comma, semicolon, tab or blanks.

    Lines that begin with # or % may precede the header, or the last of them may be the header, as
    numpy.savetxt writes it. Without a header columns are named by their number, from 1. Decimal
    commas are understood where the separator is none.
    """

    kind = "CSV"

    def __init__(self, path: Path) -> None:
        self._head = _read_head(path)
        super().__init__(path, self._head.names)

    def row(self, index: int) -> str:
        """Return where a row stands, by its number and its line."""
        return f"row {index + 1} (line {self._head.lines + index + 1})"

    def listing(self) -> str:
        """List the columns, and say where they have no names."""
        line = self._head.lines + 1
        told = f" (line {line}: numbers where the names of columns should be)"
        return super().listing() + (told if self._head.headless else "")

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        if self._head.delimiter == _BLANKS:
            return self._between_blanks(names)
        try:
            table = self._parse(names, threads=True)
        except (pa.ArrowException, OSError, ValueError):
            try:  # the parser knows the row only where it works in one thread
                table = self._parse(names, threads=False)
            except (pa.ArrowException, OSError, ValueError) as error:
                raise DataError(self._cause(str(error))) from error
        return {name: np.array(table.column(name).to_numpy()) for name in names}

    def _parse(self, names: Sequence[str], threads: bool) -> pa.Table:
        return pa.csv.read_csv(
            self.path,
            read_options=pa.csv.ReadOptions(
                use_threads=threads, column_names=list(self.names), skip_rows=self._head.lines
            ),
            parse_options=pa.csv.ParseOptions(delimiter=self._head.delimiter),
            convert_options=pa.csv.ConvertOptions(
                include_columns=list(names),
                column_types=dict.fromkeys(names, pa.float64()),
                null_values=_EMPTY,
                decimal_point=self._head.decimal_point,
            ),
        )

    def _between_blanks(self, names: Sequence[str]) -> dict[str, Array]:
        try:
            rows = np.loadtxt(
                self.path,
                comments=list(_COMMENTS),
                skiprows=self._head.lines,
                usecols=[self.names.index(name) for name in names],
                ndmin=2,
                encoding="utf-8-sig",
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


@dataclass(frozen=True)
class _Head:
    names: tuple[str, ...]
    lines: int
    """How many lines precede the first row."""
    delimiter: str
    decimal_point: str
    headless: bool = False


def _read_head(path: Path) -> _Head:
    lines = _first_lines(path)
    comments = 0
    while comments < len(lines) and (
        not lines[comments].strip() or lines[comments].startswith(_COMMENTS)
    ):
        comments += 1
    if comments == len(lines):
        raise DataError(f"{path}: no header line with the names of columns")
    header, count = lines[comments], comments + 1
    headless = _is_numeric(header)
    width = len(_without_end(_cells(header)))
    if comments and headless:
        named = lines[comments - 1].lstrip("".join(_COMMENTS))
        if len(_without_end(_cells(named))) == width:
            header, count, headless = named, comments, False
    delimiter = _delimiter(header)
    if headless:
        names = tuple(str(k + 1) for k in range(width))
        count -= 1
    elif delimiter == _BLANKS:
        names = tuple(header.split())
    else:
        names = tuple(name.strip() for name in next(csv.reader([header], delimiter=delimiter)))
    first_row = lines[count] if count < len(lines) else ""
    ends = delimiter != _BLANKS and first_row.rstrip(" ").endswith(delimiter)
    if ends and first_row.count(delimiter) == len(names):
        names = (*names, "")  # rows end with a separator: behind it is a column of nothing
    if delimiter == _BLANKS and len(first_row.split()) != len(names):
        delimiter = ","  # one column, whose name may have blanks
        names = (header.strip(),)
    comma = delimiter != "," and "," in first_row and "." not in first_row
    return _Head(names, count, delimiter, "," if comma else ".", headless)


def _first_lines(path: Path) -> list[str]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines: list[str] = []
            beyond_comments = 0
            while beyond_comments < 2 and len(lines) < _MOST_HEAD_LINES:
                line = file.readline(_LONGEST_LINE)
                if not line:
                    break
                lines.append(line.rstrip("\r\n"))
                beyond_comments += bool(line.strip()) and not line.startswith(_COMMENTS)
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not a text file in UTF-8") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    return lines


def _delimiter(line: str) -> str:
    found = max(_DELIMITERS, key=line.count)
    return found if found in line else _BLANKS


def _cells(line: str) -> list[str]:
    delimiter = _delimiter(line)
    return line.split() if delimiter == _BLANKS else line.split(delimiter)


def _without_end(cells: list[str]) -> list[str]:
    """Return the cells of a line, without the empty one behind a separator at its end."""
    return cells[:-1] if len(cells) > 1 and not cells[-1].strip() else cells


def _is_numeric(line: str) -> bool:
    try:
        [float(cell) for cell in _without_end(_cells(line))]
    except ValueError:
        return False
    return True
