"""Read a recording, whatever kind of file it is."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from motorctl.axis_units import units_of
from motorctl.errors import DataError
from motorctl.log.beside import columns_of_file, tables_beside
from motorctl.log.columns import POSITION, THETA, axes_of
from motorctl.log.counted_axes import with_turns_counted
from motorctl.log.description import (
    AxisDescription,
    CommandColumn,
    Description,
    PositionColumn,
    VelocityColumn,
    read_description,
)
from motorctl.log.interleaved import brought_together
from motorctl.log.open_table import open_table
from motorctl.log.recording import AxisRecording, Recording
from motorctl.log.run_parts import open_recorded
from motorctl.log.table import Array, Table
from motorctl.log.table_csv import CsvTable
from motorctl.log.timebase import Gaps, Grid, grid_of_rate, grid_of_time
from motorctl.log.wild_values import without_wild

_COMMAND = ".command_v"
# Fields of AxisRecording, and the signals that they come from.
_FINITE = {
    "position": "position_m",
    "command": "command_v",
    "reference": "reference_m",
    "reference_velocity": "reference_velocity_m_s",
    "reference_acceleration": "reference_acceleration_m_s2",
}
_FLOATS = {
    "velocity": "velocity_m_s",
    "virtual_command": "virtual_command_v",
    "excitation": "excitation_v",
    "learned": "learned_v",
    "d0_hat": "d0_hat_v",
}
_CODES = ("state", "fault", "flags")
_OF_TICK = ("lateness_s", "turnaround_s")  # fields of Recording


def read_recording(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    gaps: Gaps = "fill",
    whole_run: bool = False,
    signals: Collection[str] | None = None,
) -> Recording:
    """Read a log, a CSV, Parquet, MAT or HDF5 file with a log's columns, or a YAML description.

    Parameters
    ----------
    path
        The file; of a run of many logs also several of them, their folder, or the run's name: they
        are read as one recording.
    gaps
        "fill": periods that a log skipped are filled in linearly where at most 10 follow each
        other, and of a log with longer gaps the longest stretch without one is taken; `notes`
        tells. "keep": every row stays as it was recorded, and times are not uniform across gaps.
    whole_run
        A log stands for all of its run that are in its folder.
    signals
        Which of a log's signals are read, as `state` or `lateness_s`; all by default. Position and
        command always are. Ten minutes of one at 5 kHz take 24 MB.

    Returns
    -------
    Recording
        Columns of equal length, (N,), with time in seconds and every axis in its own units.

    Raises
    ------
    DataError
        With file, place and value, for whatever cannot be used.
    """
    paths = [path] if isinstance(path, str | os.PathLike) else list(path)
    described = [Path(p) for p in paths if Path(p).suffix.lower() in (".yaml", ".yml")]
    if described and (len(paths) > 1 or whole_run):
        raise DataError(f"{described[0]}: a described recording is no part of a run of logs")
    if described:
        return _read_described(described[0], read_description(described[0]))
    return recording_of(open_recorded(paths, whole_run), gaps, signals)


def recording_of(table: Table, gaps: Gaps, signals: Collection[str] | None = None) -> Recording:
    """Return what stands in a table with a log's columns; `gaps` and `signals` are those above.

    Raises DataError, with file, place and value, for whatever cannot be used.
    """
    for name in sorted(table.repeated):
        raise DataError(table.missing(name))
    axes = axes_of(table.names)
    if "time_s" not in table.names or not axes:
        missing = "time_s" if "time_s" not in table.names else f"<axis>{POSITION}"
        raise DataError(
            f"{table.called}: no column '{missing}'. There are: {table.listing()}. For a "
            "foreign file, write a YAML description that names its columns, and pass that instead"
        )
    for axis in axes:
        table.require(axis + _COMMAND)
    columns = table.read(_wanted(table, axes, signals))
    if "tick" not in columns and not table.metadata:
        columns = table.without_repeated_times(columns, "time_s")
    config = _mapping(table.metadata.get("config"))
    grid = grid_of_time(
        table,
        "time_s",
        columns["time_s"],
        columns.get("tick"),
        _number(table.metadata.get("rate_hz")) or _number(config.get("rate_hz")),
        gaps,
        [columns[axis + POSITION] for axis in axes],
    )
    described = _mapping(config.get("axes"))
    of_tick = {name: grid.measured(columns[name]) for name in _OF_TICK if name in columns}
    finite = [n for n in columns if n.partition(".")[2] in _FINITE.values()]
    blank = [*_blank_notes(columns, finite)]
    wild: list[str] = []
    if not table.metadata:  # what a log of ours holds was seen by the guards
        columns, wild = _without_wild(table, columns, [axis + POSITION for axis in axes])
    notes = (*table.notes, *grid.notes, *wild, *blank, *_learned_notes(columns))
    return Recording(
        source=table.called,
        sample_rate_hz=grid.sample_rate_hz,
        time_s=grid.time_s,
        axes={
            axis: _axis(table, columns, axis, grid, _mapping(described.get(axis))) for axis in axes
        },
        metadata=table.metadata,
        lateness_s=of_tick.get("lateness_s"),
        turnaround_s=of_tick.get("turnaround_s"),
        rows_filled=grid.rows_filled,
        notes=notes,
    )


def _wanted(table: Table, axes: Sequence[str], signals: Collection[str] | None) -> list[str]:
    wanted = list(_OF_TICK)
    for axis in axes:
        wanted += [f"{axis}.{name}" for name in (*_FINITE.values(), *_FLOATS.values(), *_CODES)]
        wanted += [name for name in table.names if name.startswith(f"{axis}.{THETA}_")]
    if signals is not None:
        asked = {*signals, POSITION.removeprefix("."), _COMMAND.removeprefix(".")}
        wanted = [name for name in wanted if (name.partition(".")[2] or name) in asked]
    return [name for name in ("time_s", "tick", *wanted) if name in table.names]


def _axis(
    table: Table, columns: dict[str, Array], axis: str, grid: Grid, config: Mapping[str, Any]
) -> AxisRecording:
    """Bring an axis' columns onto the grid, and let go of them: a long log's take gigabytes."""
    found: dict[str, Any] = {}
    blanks: list[NDArray[np.bool_] | None] = []
    for field, signal in _FINITE.items():
        if (values := columns.pop(f"{axis}.{signal}", None)) is not None:
            values, blank = table.without_blanks(f"{axis}.{signal}", values)
            found[field] = grid.floats(values, held=field == "command")
            blanks.append(blank)
    for field, signal in _FLOATS.items():
        if (values := columns.pop(f"{axis}.{signal}", None)) is not None:
            found[field] = grid.floats(values)
    for code in _CODES:
        if (values := columns.pop(f"{axis}.{code}", None)) is not None:
            table.require_finite(f"{axis}.{code}", values)
            found[code] = grid.integers(values)
    start = f"{axis}.{THETA}_"
    theta = {
        name.removeprefix(start): grid.floats(columns.pop(name))
        for name in [name for name in columns if name.startswith(start)]
    }
    resolution = _number(_mapping(config.get("encoder")).get("resolution_m"))
    recorded = grid.recorded_without(blanks)
    return AxisRecording(
        name=axis, theta_hat=theta, resolution=resolution, recorded=recorded,
        uneven=grid.resampled,
        position_unit=units_of(config.get("kind")).position, **found,
    )  # fmt: skip


def _read_described(path: Path, description: Description) -> Recording:
    file = path.parent / description.file
    if file.suffix.lower() in (".yaml", ".yml"):
        raise DataError(
            f"{path}: file: {file} should be a CSV, Parquet, MAT or HDF5 file, or NumPy's"
        )
    clock = description.time
    table = open_table(file, description.header_line, columns_of_file(description, None))
    if description.header_line is not None and not isinstance(table, CsvTable):
        raise DataError(f"{path}: header_line: {file} is no text file, and has no lines")
    table, description = tables_beside(path, description, table)
    wanted = [] if clock is None else [clock.column]
    wanted += [c for axis in description.axes.values() for c in axis.columns.values()]
    for name, axis in description.axes.items():
        for signal, column in axis.columns.items():
            if column not in table.names:
                key = f"axes.{name}.{signal}.column"
                raise DataError(f"{path}: {key}: {table.missing(column)}")
    read = table.read(wanted)
    for name, axis in description.axes.items():
        for signal, column in axis.columns.items():
            if column in table.in_seconds:
                raise DataError(
                    f"{path}: axes.{name}.{signal}.column: column '{column}' of "
                    f"{table.holding(column).path} has times where numbers are needed"
                )
    if clock and clock.column in table.in_seconds and "scale" in clock.model_fields_set:
        raise DataError(
            f"{path}: time.scale: column '{clock.column}' of {file} has dates or times, which "
            "become seconds; leave scale out"
        )
    if clock is not None:  # without one, the rows are the clock
        read = table.without_empty_rows(read, clock.column)
        read = table.from_where_the_clock_runs(read, clock.column)
    columns, together = brought_together(read, description)
    if clock is not None:
        columns = table.without_repeated_times(columns, clock.column)
    described = [axis.motion.column for axis in description.axes.values()]
    speeds = {axis.columns.get("velocity") for axis in description.axes.values()}
    sound, wild = _without_wild(table, columns, described, speeds)
    sound, turns = with_turns_counted(table, sound, description, path)
    if clock is None:
        assert description.sample_rate_hz is not None
        rows = len(columns[wanted[0]])
        grid = grid_of_rate(table, rows, description.sample_rate_hz)
    else:
        motion = [sound[name] for name in described]
        unit_s = 1.0 if clock.column in table.in_seconds else clock.seconds
        time_s = sound[clock.column] * unit_s
        grid = grid_of_time(table, clock.column, time_s, motion=motion)
    for part, span in description.segments.given.items():
        _require_within(path, part, span, grid)
    return Recording(
        source=str(path),
        sample_rate_hz=grid.sample_rate_hz,
        time_s=grid.time_s,
        axes={
            name: _described_axis(table, sound, name, axis, grid)
            for name, axis in description.axes.items()
        },
        segments=description.segments.given,
        notes=(
            *table.notes,
            *together,
            *wild,
            *turns,
            *grid.notes,
            *_description_notes(columns, description),
        ),
    )


def _without_wild(
    table: Table,
    columns: Mapping[str, Array],
    names: Iterable[str],
    speeds: Collection[str | None] = (),
) -> tuple[dict[str, Array], list[str]]:
    """Return columns in which the damaged values of some are blank, and notes."""
    out, notes = dict(columns), []
    for name in dict.fromkeys(names):
        out[name], told = without_wild(table, name, columns[name], is_speed=name in speeds)
        notes += told
    return out, notes


def _described_axis(
    table: Table, columns: Mapping[str, Array], name: str, axis: AxisDescription, grid: Grid
) -> AxisRecording:
    blanks: list[NDArray[np.bool_] | None] = []

    def taken(
        described: PositionColumn | VelocityColumn | CommandColumn, held: bool = False
    ) -> Array:
        values, blank = table.without_blanks(described.column, columns[described.column])
        blanks.append(blank)
        brought = grid.floats(values, held) * described.factor
        if described.late_s:
            rows = np.arange(len(brought))
            brought = np.interp(rows + described.late_s * grid.sample_rate_hz, rows, brought)
        return brought

    motion, reference = axis.motion, axis.reference
    position = taken(motion)
    if axis.velocity is not None:
        seconds = np.arange(len(position)) / grid.sample_rate_hz
        position = np.asarray(cumulative_trapezoid(position, seconds, initial=0))
    return AxisRecording(
        name=name,
        position=position,
        command=taken(axis.command, held=True),
        reference=None if reference is None else taken(reference),
        position_unit=motion.base_unit,
        command_unit=axis.command.base_unit,
        force_per_command=axis.force_per_command.known if axis.force_per_command else None,
        resolution=None if axis.position is None else axis.position.count,
        recorded=grid.recorded_without(blanks),
        uneven=grid.resampled,
    )


def _blank_notes(columns: Mapping[str, Array], names: Iterable[str]) -> Iterator[str]:
    """Say what was filled in."""
    for name in names:
        if count := int(np.count_nonzero(np.isnan(columns[name]))):
            yield (
                f"{count} of {len(columns[name])} values of column '{name}' are blank: left out of "
                "every judgement"
            )


def _learned_notes(columns: Mapping[str, Array]) -> Iterator[str]:
    """Say which commands have in them what was learned for a program."""
    ending = f".{_FLOATS['learned']}"
    for name in columns:
        if not name.endswith(ending):
            continue
        largest_v = float(np.nanmax(np.abs(columns[name]), initial=0.0))
        if largest_v > 0.0:
            yield (
                f"axis {name.removesuffix(ending)}: up to {largest_v:.3g} V of its command was "
                "learned for a program that repeats; that explains nothing, and is in the command"
            )


def _description_notes(columns: Mapping[str, Array], description: Description) -> Iterator[str]:
    """Say what was filled in, and what was never recorded."""
    for name, axis in description.axes.items():
        yield from _blank_notes(columns, axis.columns.values())
        if axis.velocity is not None:
            yield f"axis {name}: its position is the integral of column '{axis.velocity.column}'"


def _require_within(path: Path, part: str, span: tuple[float, float], grid: Grid) -> None:
    first, last = float(grid.time_s[0]), float(grid.time_s[-1]) + 1.0 / grid.sample_rate_hz
    slack = 0.5 / grid.sample_rate_hz
    if span[0] < first - slack or span[1] > last + slack:
        raise DataError(
            f"{path}: segments.{part}: [{span[0]:g}, {span[1]:g}] s reaches beyond the recording, "
            f"which lasts from {first:g} to {last:g} s"
        )


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _number(value: object) -> float | None:
    if isinstance(value, int | float) and math.isfinite(value) and value > 0:
        return float(value)
    return None
