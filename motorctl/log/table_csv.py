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
_COMMENT = "#"
_LONGEST_LINE = 1 << 20
_MOST_HEAD_LINES = 1000
_EMPTY = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "null"]


class CsvTable(Table):
    """A text file with one header line: separated by comma, semicolon or tab.

    Lines that begin with # may precede the header, or the last of them may be the header, as
    numpy.savetxt writes it. Decimal commas are understood where the separator is none.
    """

    kind = "CSV"

    def __init__(self, path: Path) -> None:
        self._head = _read_head(path)
        super().__init__(path, self._head.names)

    def row(self, index: int) -> str:
        """Return where a row stands, by its number and its line."""
        return f"row {index + 1} (line {self._head.lines + index + 1})"

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
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


def _read_head(path: Path) -> _Head:
    lines = _first_lines(path)
    comments = 0
    while comments < len(lines) and (
        not lines[comments].strip() or lines[comments].startswith(_COMMENT)
    ):
        comments += 1
    if comments == len(lines):
        raise DataError(f"{path}: no header line with the names of columns")
    header, count = lines[comments], comments + 1
    if comments and _is_numeric(header):
        header, count = lines[comments - 1].lstrip(_COMMENT), comments
    if _is_numeric(header):
        raise DataError(f"{path}: line {count}: numbers where the names of columns should be")
    delimiter = max(_DELIMITERS, key=header.count)
    names = tuple(name.strip() for name in next(csv.reader([header], delimiter=delimiter)))
    first_row = lines[count] if count < len(lines) else ""
    comma = delimiter != "," and "," in first_row and "." not in first_row
    return _Head(names, count, delimiter, "," if comma else ".")


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
                beyond_comments += bool(line.strip()) and not line.startswith(_COMMENT)
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not a text file in UTF-8") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    return lines


def _is_numeric(line: str) -> bool:
    try:
        [float(cell) for cell in re.split(r"[,;\t]", line)]
    except ValueError:
        return False
    return True
