"""Read recorded points from CSV: every problem with its file, line and column."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from motorctl.errors import ConfigError, Problem
from motorctl.motion.segments import Array

TIME = "time_s"
SUFFIX = "_m"
# A wrong file has a problem in every line: tell enough of them to be understood.
MOST_PROBLEMS = 20
SHORTEST_STEP_S = 1e-6
LARGEST_NUMBER = 1e6


@dataclass(frozen=True)
class PointTable:
    """Points of one or more axes over rising times."""

    file: str
    first_line: int
    last_line: int
    time_s: Array
    """(N,), N >= 2."""
    position_m: dict[str, Array]
    """(N,) for each axis."""

    def problem(self, line: int | None, axis: str, message: str) -> Problem:
        """Make a problem of an axis' column."""
        return Problem(self.file, line, axis + SUFFIX, message)


@dataclass
class _Problems:
    file: str
    found: list[Problem] = field(default_factory=list)
    hidden: int = 0

    def add(self, line: int | None, column: str, message: str) -> None:
        if len(self.found) < MOST_PROBLEMS:
            self.found.append(Problem(self.file, line, column, message))
        else:
            self.hidden += 1

    def raise_any(self) -> None:
        if self.hidden:
            self.found.append(Problem(self.file, None, "", f"and {self.hidden} more problems"))
        if self.found:
            raise ConfigError(self.found)


def axes_of_header(path: Path, axis_names: Collection[str]) -> tuple[str, ...]:
    """Return the axes of a file all of whose columns are ``time_s`` or ``<axis>_m``.

    Raises ConfigError where another column, or an unknown axis, stands in the header.
    """
    problems = _Problems(str(path))
    header = _rows(path)[0][1]
    axes = []
    for column in header:
        axis = column.removesuffix(SUFFIX)
        if column == TIME:
            continue
        if axis != column and axis in axis_names:
            axes.append(axis)
        else:
            right = ", ".join([TIME, *(name + SUFFIX for name in axis_names)])
            problems.add(1, column, f"unknown column; known: {right}")
    if not axes and not problems.found:
        right = ", ".join(name + SUFFIX for name in axis_names)
        problems.add(1, "", f"no column of an axis; known: {right}")
    problems.raise_any()
    return tuple(axes)


def read_points(path: Path, axes: Sequence[str]) -> PointTable:
    """Read ``time_s`` and the columns ``<axis>_m``; further columns may stand beside them.

    Raises
    ------
    ConfigError
        With every problem: columns missing or doubled, cells missing, no number or beyond all
        bounds, times that do not rise, fewer than two rows.
    """
    problems = _Problems(str(path))
    (header_line, header), *rows = _rows(path)
    wanted = [TIME, *(axis + SUFFIX for axis in axes)]
    for column in wanted:
        if header.count(column) != 1:
            what = "missing" if column not in header else "there more than once"
            problems.add(header_line, column, f"column is {what}; there are: {', '.join(header)}")
    problems.raise_any()
    places = [header.index(column) for column in wanted]
    points = np.empty((len(rows), len(wanted)))
    before = -math.inf
    for row, (line, cells) in zip(points, rows, strict=True):
        if len(cells) != len(header):
            problems.add(line, "", f"{len(cells)} cells where the header has {len(header)}")
            continue
        for k, (column, place) in enumerate(zip(wanted, places, strict=True)):
            row[k] = _number(cells[place], line, column, problems)
        if row[0] < before + SHORTEST_STEP_S:
            message = (
                f"{row[0]:.9g} must exceed {before:.9g} of the row before by {SHORTEST_STEP_S:g}"
            )
            problems.add(line, TIME, message)
        before = row[0]
    if len(rows) < 2:
        problems.add(None, "", f"needs at least 2 rows of points, has {len(rows)}")
    problems.raise_any()
    time_s = points[:, 0] - points[0, 0]
    position_m = {axis: points[:, k + 1].copy() for k, axis in enumerate(axes)}
    return PointTable(str(path), rows[0][0], rows[-1][0], time_s, position_m)


def _number(cell: str, line: int, column: str, problems: _Problems) -> float:
    try:
        value = float(cell)
    except ValueError:
        problems.add(line, column, f"'{cell[:40]}' is no number")
        return math.nan
    if not abs(value) <= LARGEST_NUMBER:
        problems.add(line, column, f"'{cell[:40]}' does not lie within {LARGEST_NUMBER:g}")
    return value


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return (line, cells) of every row that is not blank, the header first."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, skipinitialspace=True)
            rows = [(reader.line_num, [c.strip() for c in cells]) for cells in reader if any(cells)]
    except OSError as error:
        raise ConfigError([Problem(str(path), None, "", f"{error.strerror}")]) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(
            [Problem(str(path), None, "", f"is not CSV text in UTF-8: {error}")]
        ) from error
    if not rows:
        message = f"is empty; needs a header line with {TIME} and <axis>{SUFFIX}"
        raise ConfigError([Problem(str(path), None, "", message)])
    return rows
