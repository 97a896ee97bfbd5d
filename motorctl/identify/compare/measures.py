"""The published measures of a run: eM, eF, L2[e] and uM, and its timing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.measured import IN_FORCE
from motorctl.identify.columns.repetition import find_period, repeats
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState

Array = NDArray[np.float64]

SYMBOLS = ("eM", "eF", "L2[e]", "uM")
EXPLAINED = (
    "e = position - reference; eM: largest over the run; eF: largest over the last two periods, or "
    "the last third of a motion without a period; L2[e]: root mean square; uM: largest command."
)
PERIODS_AT_END = 2
"""Periods of the reference at the end of a run from which the final error is taken. More counts
what the adaptation still had to learn, fewer lets one disturbance decide. Convention of the
published table."""
STANDSTILL = 1e-6
"""Distance from the reference's last value, as a part of its range, within which it stands still.
Larger cuts the end of slow moves off the last periods, smaller takes rounding for motion, so that a
long standstill counts as the end of the run. Chosen by hand."""


@dataclass(frozen=True)
class Measures:
    """The measures of one axis in one run, with e = position - reference.

    In metres and volts, or in what the recording has: rad, A, N, N*m.
    """

    eM_m: float  # noqa: N815 (the paper's symbols)
    """max |e| over the whole run."""
    eF_m: float  # noqa: N815
    """max |e| over the last two periods."""
    L2_m: float
    """sqrt(1/T integral e^2 dt)."""
    uM_V: float  # noqa: N815
    """max |u|."""


@dataclass(frozen=True)
class MeasuredRun:
    """The measures, and over what they were taken."""

    measures: Measures
    rows: slice
    """The run within the recording: from the first row that follows a program to the last."""
    last_rows: slice
    """The last two periods of it."""
    period_s: float | None
    period_from: str
    """How the period was found, in words."""


@dataclass(frozen=True)
class DurationFigures:
    """Median, percentiles and the worst of a duration that is measured once a tick."""

    median_s: float
    p99_s: float
    p999_s: float
    worst_s: float
    worst_at_s: float


@dataclass(frozen=True)
class Timing:
    """The timing of a recording; None where it was not measured, as in virtual time."""

    turnaround: DurationFigures | None
    lateness: DurationFigures | None


def measure_axis(
    recording: Recording,
    name: str,
    period_s: float | None = None,
    *,
    settling_periods: int = 0,
    left_out: NDArray[np.bool_] | None = None,
) -> MeasuredRun:
    """Measure one axis over the rows in which it is under control.

    The first `settling_periods` do not count, nor does the way to where the program begins, nor
    rows that are left out.

    Where `period_s` is not given, it is the one of the program that the log's configuration
    names, if the reference repeats so; else it is looked for in the reference; else the last
    third counts as the end. Raises DataError where the reference is not known, or nothing counts.
    """
    axis = recording.axes[name]
    error = axis.following_error
    if error is None or axis.reference is None:
        raise DataError(
            f"{recording.source}: axis {name}: no reference is known, so the tracking error "
            "cannot be computed: record the reference too"
        )
    rows = _run(axis)
    time_s, reference = recording.time_s[rows], axis.reference[rows]
    period, words = _period(recording, name, time_s, reference, period_s)
    first, last = _end(time_s, reference, period)
    counted = _under_control(axis)[rows]
    if period is not None and settling_periods:
        counted &= time_s - time_s[0] >= settling_periods * period
        if not counted.any():
            raise DataError(
                f"{recording.source}: axis {name}: {time_s[-1] - time_s[0]:.1f} s without a gap; "
                f"more than {settling_periods} x {period:g} s are needed, because the first "
                "periods do not count: record longer"
            )
    if left_out is not None and np.any(counted & ~left_out[rows]):
        counted = counted & ~left_out[rows]
    e, u = np.abs(error[rows]), np.abs(axis.command[rows])
    at_end = counted.copy()
    at_end[:first] = at_end[last:] = False
    measures = Measures(
        eM_m=float(e[counted].max()),
        eF_m=float(e[at_end].max()) if at_end.any() else float(e[counted].max()),
        L2_m=float(np.sqrt(np.mean(e[counted] ** 2))),
        uM_V=float(u[counted].max()),
    )
    last_rows = slice(rows.start + first, rows.start + last)
    return MeasuredRun(measures, rows, last_rows, period, words)


def measure_recording(
    recording: Recording, period_s: float | None = None
) -> dict[str, MeasuredRun]:
    """Measure every axis whose reference is known."""
    return {
        name: measure_axis(recording, name, period_s)
        for name, axis in recording.axes.items()
        if axis.reference is not None
    }


def measure_timing(recording: Recording) -> Timing:
    """Return percentiles and the worst case of turnaround and lateness."""
    return Timing(
        _durations(recording.time_s, recording.turnaround_s),
        _durations(recording.time_s, recording.lateness_s),
    )


def measured_document(
    run: MeasuredRun, position_unit: str = "m", command_unit: str = "V"
) -> dict[str, Any]:
    """Return the measures of an axis, by the paper's symbols, as they stand in JSON documents."""
    units = (position_unit, position_unit, position_unit, command_unit)
    return dict(zip(SYMBOLS, astuple(run.measures), strict=True)) | {
        "units": dict(zip(SYMBOLS, units, strict=True)),
        "period_s": run.period_s,
        "period_from": run.period_from,
    }


def table_headings(position_unit: str = "m", command_unit: str = "V") -> tuple[str, ...]:
    """Return the headings of `table_cells`: errors in millionths of m or rad."""
    micro = f"µ{position_unit}"
    return (f"eM {micro}", f"eF {micro}", f"L2[e] {micro}", f"uM {command_unit}")


def table_cells(measures: Measures) -> list[str]:
    """Return the measures with the digits of the published table."""
    return [
        f"{measures.eM_m * 1e6:.1f}",
        f"{measures.eF_m * 1e6:.1f}",
        f"{measures.L2_m * 1e6:.2f}",
        f"{measures.uM_V:.2f}",
    ]


def _durations(time_s: Array, values: Array | None) -> DurationFigures | None:
    if values is None or not np.any(values > 0.0):
        return None
    seen = np.isfinite(values)
    median, p99, p999 = np.percentile(values[seen], (50.0, 99.0, 99.9))
    worst = int(np.argmax(values[seen]))
    at_s = float(time_s[seen][worst])
    return DurationFigures(float(median), float(p99), float(p999), float(values[seen][worst]), at_s)


def _under_control(axis: AxisRecording) -> NDArray[np.bool_]:
    """Return the rows in which a tracking error means something; all where that is not known."""
    if axis.state is None or not np.isin(axis.state, IN_FORCE).any():
        return np.ones(len(axis.position), np.bool_)
    return np.isin(axis.state, IN_FORCE)


def _run(axis: AxisRecording) -> slice:
    """Return the rows from the first to the last that follow a program; all where none does."""
    if axis.state is not None:
        running = np.flatnonzero(axis.state == AxisState.RUNNING)
        if len(running):
            return slice(int(running[0]), int(running[-1]) + 1)
    return slice(0, len(axis.position))


def _period(
    recording: Recording, name: str, time_s: Array, reference: Array, given: float | None
) -> tuple[float | None, str]:
    if given is not None:
        return given, "as given"
    program = _program_period(recording.metadata, name)
    if program and repeats(time_s, reference, program):
        return program, "of the program"
    if found := find_period(time_s, reference):
        return found, "seen in the reference by autocorrelation"
    return None, "none found: the last third counts instead"


def _program_period(metadata: Mapping[str, Any], axis: str) -> float | None:
    try:
        config = metadata["config"]
        period = config["programs"][config["axes"][axis]["program"]]["period_s"]
        return float(period) if period else None
    except (KeyError, TypeError, ValueError):
        return None


def _end(time_s: Array, reference: Array, period_s: float | None) -> tuple[int, int]:
    """Return the rows of the last two periods, up to where the motion ended."""
    rows = len(time_s)
    if period_s is None:
        return rows - max(rows // 3, 1), rows
    span = float(np.ptp(reference))
    moved = np.flatnonzero(np.abs(reference - reference[-1]) > STANDSTILL * span)
    last = rows
    if len(moved) and time_s[-1] - time_s[moved[-1]] > period_s:
        last = int(moved[-1]) + 1  # it stood still for longer than any pause within a period
    begin_s = time_s[last - 1] - PERIODS_AT_END * period_s
    return min(int(np.searchsorted(time_s, begin_s, side="right")), last - 1), last
