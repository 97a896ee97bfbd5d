"""One axis of a recording as the identification takes it, and what makes it unusable."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.axis_units import PositionUnit
from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.filters import velocity_of
from motorctl.log import Recording, read_recording
from motorctl.log.sample import AxisState, SampleFlag
from motorctl.log.units import CommandUnit, unit_for

Array = NDArray[np.float64]

SIGNALS = (
    "position_m", "command_v", "reference_m", "reference_velocity_m_s", "state", "flags",
    "learned_v",
)  # fmt: skip
"""What of a log is looked at."""
IN_FORCE = (AxisState.IDLE, AxisState.RUNNING, AxisState.STOPPING)
"""States in which the axis follows its command and its coordinate stands still."""
SHORTEST_S = 0.2
"""Shortest recording of an axis that is accepted [s]. Smaller lets a fit begin that hardly any
motion carries, larger refuses short tests. Chosen by hand."""
SHORTEST_SAMPLES = 100
"""Fewest samples of an axis that are accepted. Smaller leaves filters nothing but their settling,
larger refuses slow logs. Chosen by hand."""
SLOWEST_RATE_HZ = 1.0
"""Sample rate below which no change of an axis' speed is seen: what its inertia asks for lies
between two rows. Larger refuses slow logs of heavy axes, smaller takes tables of settled speeds for
recordings. Chosen by hand: those of other hands that tell anything have 8 Hz and more, such a
table 0.2 Hz."""
LONGEST_STRETCH = 1 << 19
"""Samples in one piece of a long recording: longer ones are cut. Larger takes more memory, smaller
loses more rows to settling at cuts. Chosen by hand; 2^19 samples are 105 s at 5 kHz."""
MOVED_COUNTS = 10
"""A position that stays within so many encoder counts does not move. Larger refuses very small
motions, smaller takes flicker of the encoder for motion. Chosen by hand."""
SATURATED_SHARE = 0.95
"""Part of the samples with the command at one of its extremes, from which it is called saturated.
Smaller refuses hard but useful motion, larger lets clipped commands pass. Chosen by hand."""
FEW_REVERSALS = 20
"""A command at its extremes with fewer reversals is saturated, with more it is a binary test
signal. Larger refuses short test signals, smaller accepts a command that is stuck at its limits.
Chosen by hand."""
STEPPED = 0.99
"""Share of samples at the extremes, of both signs, from which the command is a test in steps: a
saturated controller leaves its limits between them. Larger refuses steps with rounded edges,
smaller accepts a command that is stuck at its limits. Chosen by hand."""


@dataclass(frozen=True)
class Measured:
    """Signals of one axis, arrays of shape (N,) at a constant rate except where time jumps."""

    source: str
    axis: str
    sample_rate_hz: float
    time_s: Array
    position: Array
    command: Array
    usable: NDArray[np.bool_]
    """Where the command acted on the axis: enabled, and not while it was being homed."""
    reference: Array | None = None
    reference_velocity: Array | None = None
    saturated: NDArray[np.bool_] | None = None
    resolution: float | None = None
    """One count of the encoder, where it is known."""
    position_unit: PositionUnit = "m"
    command_unit: CommandUnit = "V"
    uneven: bool = False
    """Whether the samples were taken unevenly and brought to this rate."""
    force_per_command: float | None = None
    force_unit: str = "N"
    inertia: tuple[float, float] | None = None
    """Between what values its inertia is known to lie, in units of the command; None: not known."""
    others: Mapping[str, Measured] = field(default_factory=dict, repr=False)
    """The other axes that move, by name, at the same times; empty where nobody asked for them."""

    @property
    def period_s(self) -> float:
        """Ts."""
        return 1.0 / self.sample_rate_hz

    @property
    def desired_velocity(self) -> Array | None:
        """The reference's velocity, differenced where the recording has only its position."""
        if self.reference_velocity is not None or self.reference is None:
            return self.reference_velocity
        return velocity_of(self.reference, self.period_s)

    def unit(self, model_unit: str) -> str:
        """Translate a unit of the model, which is in V and m, to the axis' own."""
        return unit_for(model_unit, self.position_unit, self.command_unit)

    @property
    def place(self) -> str:
        """Name the data in messages."""
        return f"{self.source}: axis {self.axis}"

    def stretches(self, shortest: int) -> Iterator[slice]:
        """Yield the runs of at least `shortest` usable samples without a gap in time.

        Very long runs come in pieces, so that memory stays bounded.
        """
        gap = np.abs(np.diff(self.time_s) - self.period_s) > 0.5 * self.period_s
        broken = np.concatenate([[True], gap | (self.usable[1:] != self.usable[:-1])])
        starts = np.flatnonzero(broken)
        stops = np.append(starts[1:], len(broken))
        for start, stop in zip(starts, stops, strict=True):
            if not self.usable[start] or stop - start < shortest:
                continue
            pieces = -(-(stop - start) // max(LONGEST_STRETCH, shortest))
            edges = np.linspace(start, stop, pieces + 1).astype(int)
            yield from (slice(int(a), int(b)) for a, b in pairwise(edges))


def within(data: Measured, spans: Sequence[tuple[float, float]]) -> Measured:
    """Return an axis of which nothing but the samples between these times [s] are usable."""
    inside = np.zeros(len(data.time_s), dtype=np.bool_)
    for begin_s, end_s in spans:
        inside |= (data.time_s >= begin_s) & (data.time_s < end_s)
    return replace(data, usable=data.usable & inside)


def read_measured(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], *, whole_run: bool = False
) -> Recording:
    """Read what is looked at of a recording, every row as it was recorded (see `read_recording`).

    A log has three times as many columns, and of ten minutes all together take a gigabyte.
    """
    return read_recording(path, gaps="keep", whole_run=whole_run, signals=SIGNALS)


def measured(recording: Recording, axis: str) -> Measured:
    """Take one axis out of a recording. Raises UsageError where it has no such axis."""
    if axis not in recording.axes:
        known = ", ".join(recording.axes) or "none"
        raise UsageError(f"{recording.source}: no axis '{axis}'; it has: {known}")
    record = recording.axes[axis]
    usable = np.ones(len(record.position), dtype=np.bool_)
    if record.state is not None:
        usable &= np.isin(record.state, IN_FORCE)
    if record.recorded is not None:
        usable &= record.recorded
    if record.flags is not None:
        usable &= (record.flags & SampleFlag.HELD) == 0
    force = record.force_per_command
    data = Measured(
        source=recording.source,
        axis=axis,
        sample_rate_hz=recording.sample_rate_hz,
        time_s=recording.time_s,
        position=record.position,
        command=record.command,
        usable=usable,
        reference=record.reference,
        reference_velocity=record.reference_velocity,
        saturated=None if record.flags is None else (record.flags & SampleFlag.SATURATED) > 0,
        resolution=record.resolution,
        position_unit=record.position_unit,
        command_unit=record.command_unit,
        uneven=record.uneven,
        force_per_command=None if force is None else force.value,
        force_unit="N" if force is None else force.force_unit,
    )
    return data if record.flags is None else _own_ticks(data, record.flags)


def counterpart(recording: Recording, axis: str) -> str:
    """Return the axis of another recording that stands for `axis`: of that name, or its only one.

    Raises
    ------
    UsageError
        Where it has several axes and none of that name.
    """
    if axis in recording.axes:
        return axis
    if len(recording.axes) == 1:
        return next(iter(recording.axes))
    known = ", ".join(recording.axes)
    raise UsageError(f"{recording.source}: no axis '{axis}' to evaluate on; it has: {known}")


def _own_ticks(data: Measured, flags: NDArray[np.int64]) -> Measured:
    """Leave out the rows between the ticks of an axis that has fewer than its log has rows."""
    own = np.flatnonzero((flags & SampleFlag.BETWEEN) == 0)
    if len(own) in (0, 1, len(flags)):
        return data
    divisor = int(np.median(np.diff(own)))
    return _picked(replace(data, sample_rate_hz=data.sample_rate_hz / divisor), own)


def _picked(data: Measured, rows: NDArray[np.int64]) -> Measured:
    length = len(data.position)
    columns: dict[str, Any] = {
        each.name: value[rows]
        for each in fields(data)
        if isinstance(value := getattr(data, each.name), np.ndarray) and len(value) == length
    }
    return replace(data, **columns)


def with_others(recording: Recording, axis: str) -> Measured:
    """Take one axis out of a recording, and those that move beside it. Raises UsageError."""
    data = measured(recording, axis)
    others = (measured(recording, name) for name in recording.axes if name != axis)
    beside = {o.axis: _at_times(o, data.time_s) for o in others if np.ptp(o.position) > 0.0}
    return replace(data, others=beside)


def _at_times(other: Measured, time_s: Array) -> Measured:
    """Return an axis at the times of another, which may have another rate."""
    if np.array_equal(other.time_s, time_s):
        return other
    nearest = np.clip(np.searchsorted(other.time_s, time_s), 0, len(other.time_s) - 1)
    position = np.interp(time_s, other.time_s, other.position)
    return replace(_picked(other, nearest), time_s=time_s, position=position)


def check_usable(data: Measured) -> None:
    """Raise DataError where nothing can be identified from `data`, whatever the model."""
    where, rows = data.place, data.usable
    length = len(data.position)
    if length < SHORTEST_SAMPLES or length < SHORTEST_S * data.sample_rate_hz:
        many = length >= SHORTEST_SAMPLES
        wrong_unit = ", or are its times in another unit than is said?" if many else ""
        raise DataError(
            f"{where}: too short: {length} samples at {data.sample_rate_hz:g} Hz are "
            f"{length / data.sample_rate_hz:.3g} s; at least {SHORTEST_SAMPLES} samples and "
            f"{SHORTEST_S:g} s are needed: record a longer motion{wrong_unit}"
        )
    if data.sample_rate_hz < SLOWEST_RATE_HZ:
        raise DataError(
            f"{where}: too slow: {data.sample_rate_hz:.3g} Hz, its rows are {data.period_s:.3g} s "
            "apart, and an axis speeds up and slows down within a part of that; at least "
            f"{SLOWEST_RATE_HZ:g} Hz is needed, and ten rows in each change of speed: record it at "
            "a higher rate, or are its times in another unit than is said?"
        )
    for name, column in (("position", data.position), ("command", data.command)):
        bad = ~np.isfinite(column) & rows
        if bad.any():
            first = data.time_s[np.argmax(bad)]
            raise DataError(
                f"{where}: {name} is not a number in {bad.sum()} rows, first at {first:g} s: "
                "repair these rows or cut them out"
            )
    if not rows.any():
        raise DataError(
            f"{where}: the axis was never enabled: no sample has its command in force; record it "
            "while it runs"
        )
    _check_motion(data)
    _check_command(data)


def _check_motion(data: Measured) -> None:
    position = data.position[data.usable]
    span = float(np.ptp(position))
    count = data.resolution or resolution_of(position)
    if span == 0.0:
        raise DataError(
            f"{data.place}: no motion: the position stays at {position[0]:.6g} "
            f"{data.position_unit}: record a motion, or check which column is the position"
        )
    if count > 0.0 and span <= MOVED_COUNTS * count:
        raise DataError(
            f"{data.place}: no motion beyond {MOVED_COUNTS} counts of the encoder: the position "
            f"passes {span / count:.0f} of {count:.3g} {data.position_unit} each: record a longer "
            "motion, or with a finer encoder, or check which column is the position"
        )


def _check_command(data: Measured) -> None:
    command = data.command[data.usable]
    unit = data.command_unit
    if np.ptp(command) == 0.0:
        raise DataError(
            f"{data.place}: the command is constant at {command[0]:g} {unit}: record a motion, or "
            "check which column is the command"
        )
    largest = float(np.max(np.abs(command)))
    at_limit = np.abs(command) >= 0.999 * largest
    reversals = np.count_nonzero(np.diff(np.sign(command[at_limit])))
    share = float(np.mean(at_limit))
    if data.saturated is not None:
        share = float(np.mean(data.saturated[data.usable]))
    elif reversals >= FEW_REVERSALS or (reversals and share > STEPPED):
        return
    if share > SATURATED_SHARE:
        raise DataError(
            f"{data.place}: the command is saturated throughout: {100 * share:.0f} % of its "
            f"samples are at {largest:g} {unit}, the limit is {100 * SATURATED_SHARE:.0f} %: "
            "record a motion with less acceleration"
        )


def resolution_of(position: Array) -> float:
    """Return the smallest step between neighbouring samples, 0 where there is none."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 1e-12 * max(1.0, float(np.max(np.abs(position))))]
    return float(np.min(steps)) if len(steps) else 0.0
