"""Read a recording, whatever kind of file it is."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motorctl.errors import DataError
from motorctl.log.columns import THETA
from motorctl.log.description import AxisDescription, Description, read_description
from motorctl.log.open_table import open_table
from motorctl.log.recording import AxisRecording, Recording, read_only
from motorctl.log.table import Array, Table
from motorctl.log.timebase import Gaps, Grid, grid_of_rate, grid_of_time

_POSITION = ".position_m"
_COMMAND = ".command_v"
# Fields of AxisRecording, and the signals that they come from.
_FINITE = {
    "position": "position_m",
    "command": "command_v",
    "reference": "reference_m",
    "reference_velocity": "reference_velocity_m_s",
    "reference_acceleration": "reference_acceleration_m_s2",
}
_FLOATS = {"velocity": "velocity_m_s", "virtual_command": "virtual_command_v", "d0_hat": "d0_hat_v"}
_CODES = ("state", "fault", "flags")


def read_recording(path: str | os.PathLike[str], *, gaps: Gaps = "fill") -> Recording:
    """Read a log, a CSV, Parquet or MAT file with a log's columns, or a YAML description.

    Parameters
    ----------
    path
        The file.
    gaps
        "fill": periods that a log skipped are filled in linearly where at most 10 follow each
        other, and of a log with longer gaps the longest stretch without one is taken; `notes`
        tells.
        "keep": every row stays as it was recorded, and times are not uniform across gaps.

    Raises
    ------
    DataError
        With file, place and value, for whatever cannot be used.
    """
    file = Path(path)
    if file.suffix.lower() in (".yaml", ".yml"):
        return _read_described(file, read_description(file))
    return _read_columns(open_table(file), gaps)


def _read_columns(table: Table, gaps: Gaps) -> Recording:
    axes = [n.removesuffix(_POSITION) for n in table.names if n.endswith(_POSITION)]
    if "time_s" not in table.names or not axes:
        missing = "time_s" if "time_s" not in table.names else f"<axis>{_POSITION}"
        raise DataError(
            f"{table.path}: no column '{missing}'. There are: {table.listing()}. For a "
            "foreign file, write a YAML description that names its columns, and pass that instead"
        )
    for axis in axes:
        table.require(axis + _COMMAND)
    columns = table.read(_wanted(table, axes))
    config = _mapping(table.metadata.get("config"))
    grid = grid_of_time(
        table,
        "time_s",
        columns["time_s"],
        columns.get("tick"),
        _number(table.metadata.get("rate_hz")) or _number(config.get("rate_hz")),
        gaps,
    )
    described = _mapping(config.get("axes"))
    return Recording(
        source=str(table.path),
        sample_rate_hz=grid.sample_rate_hz,
        time_s=read_only(grid.time_s),
        axes={
            axis: _axis(table, columns, axis, grid, _mapping(described.get(axis))) for axis in axes
        },
        metadata=table.metadata,
        lateness_s=_measured(grid, columns.get("lateness_s")),
        turnaround_s=_measured(grid, columns.get("turnaround_s")),
        rows_filled=grid.rows_filled,
        notes=grid.notes,
    )


def _wanted(table: Table, axes: list[str]) -> list[str]:
    wanted = ["time_s", "tick", "lateness_s", "turnaround_s"]
    for axis in axes:
        signals = (*_FINITE.values(), *_FLOATS.values(), *_CODES)
        wanted += [f"{axis}.{signal}" for signal in signals]
        wanted += [name for name in table.names if name.startswith(f"{axis}.{THETA}_")]
    return [name for name in wanted if name in table.names]


def _axis(
    table: Table, columns: Mapping[str, Array], axis: str, grid: Grid, config: Mapping[str, Any]
) -> AxisRecording:
    found: dict[str, Any] = {}
    for field, signal in _FINITE.items():
        if (values := columns.get(f"{axis}.{signal}")) is not None:
            table.require_finite(f"{axis}.{signal}", values)
            found[field] = read_only(grid.floats(values))
    for field, signal in _FLOATS.items():
        if (values := columns.get(f"{axis}.{signal}")) is not None:
            found[field] = read_only(grid.floats(values))
    for code in _CODES:
        if (values := columns.get(f"{axis}.{code}")) is not None:
            table.require_finite(f"{axis}.{code}", values)
            found[code] = read_only(grid.integers(values))
    start = f"{axis}.{THETA}_"
    theta = {
        name.removeprefix(start): read_only(grid.floats(values))
        for name, values in columns.items()
        if name.startswith(start)
    }
    resolution = _number(_mapping(config.get("encoder")).get("resolution_m"))
    return AxisRecording(name=axis, theta_hat=theta, resolution=resolution, **found)


def _read_described(path: Path, description: Description) -> Recording:
    file = path.parent / description.file
    if file.suffix.lower() in (".yaml", ".yml"):
        raise DataError(f"{path}: file: {file} should be a CSV, Parquet or MAT file")
    table = open_table(file)
    clock = description.time
    wanted = [] if clock is None else [clock.column]
    for name, axis in description.axes.items():
        for signal in ("position", "command", "reference"):
            if (column := getattr(axis, signal)) is not None:
                wanted.append(column.column)
                if column.column not in table.names:
                    key = f"axes.{name}.{signal}.column"
                    raise DataError(f"{path}: {key}: {table.missing(column.column)}")
    columns = table.read(wanted)
    if clock is None:
        assert description.sample_rate_hz is not None
        rows = len(columns[wanted[0]])
        grid = grid_of_rate(table, rows, description.sample_rate_hz)
    else:
        grid = grid_of_time(table, clock.column, columns[clock.column] * clock.seconds)
    for part, span in description.segments.given.items():
        _require_within(path, part, span, grid)
    return Recording(
        source=str(path),
        sample_rate_hz=grid.sample_rate_hz,
        time_s=read_only(grid.time_s),
        axes={
            name: _described_axis(table, columns, name, axis, grid)
            for name, axis in description.axes.items()
        },
        segments=description.segments.given,
        notes=grid.notes,
    )


def _described_axis(
    table: Table, columns: Mapping[str, Array], name: str, axis: AxisDescription, grid: Grid
) -> AxisRecording:
    def taken(column: str, factor: float) -> Array:
        table.require_finite(column, columns[column])
        return read_only(grid.floats(columns[column]) * factor)

    reference = axis.reference
    return AxisRecording(
        name=name,
        position=taken(axis.position.column, axis.position.factor),
        command=taken(axis.command.column, 1.0),
        reference=None if reference is None else taken(reference.column, reference.factor),
        position_unit=axis.position.base_unit,
        command_unit=axis.command.base_unit,
        force_per_command=axis.force_per_command.known if axis.force_per_command else None,
        resolution=axis.position.count,
    )


def _require_within(path: Path, part: str, span: tuple[float, float], grid: Grid) -> None:
    first, last = float(grid.time_s[0]), float(grid.time_s[-1]) + 1.0 / grid.sample_rate_hz
    slack = 0.5 / grid.sample_rate_hz
    if span[0] < first - slack or span[1] > last + slack:
        raise DataError(
            f"{path}: segments.{part}: [{span[0]:g}, {span[1]:g}] s reaches beyond the recording, "
            f"which lasts from {first:g} to {last:g} s"
        )


def _measured(grid: Grid, values: Array | None) -> Array | None:
    return None if values is None else read_only(grid.measured(values))


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _number(value: object) -> float | None:
    if isinstance(value, int | float) and math.isfinite(value) and value > 0:
        return float(value)
    return None
