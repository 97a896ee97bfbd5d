"""The cycles of a program in a log, one below the other: what repeats, and what does not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.learned_file import MOST_POINTS, require_repeating
from motorctl.errors import DataError, UsageError
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState, SampleFlag
from motorctl.motion import Program, Trajectory
from motorctl.tune.same_loop import require_sound_rows

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LEAST_CYCLES = 3
"""Of a program that can be learned for: one to settle in, and two whose difference is noise."""
SETTLING = 3
"""One in so many of the cycles is left to the adaptation to settle in. More lets its beginnings be
learned, fewer averages less noise out. By hand."""
OFF_COURSE_M = 1e-6
"""How far the recorded reference may be from the program's [m]: two counts of a usual encoder. Less
trips over rounded files, more takes another motion for the program. By hand."""
MOST_MISSING = 10
"""Rows that may be missing between two, as where a busy computer skipped periods: the error is
drawn straight over them. More bends what is learned, fewer refuses computers without real time. By
hand: 2 ms at 5 kHz."""
PLACING_ROUNDS = 4
"""Newton steps to the program's begin: each squares what is left of a period. Fewer leave some."""


@dataclass(frozen=True)
class Repetition:
    """The cycles of one run that count, (cycles, points) over the same places of the program."""

    axis: str
    source: str
    period_s: float
    """Of the program."""
    error: Array
    """Position error [m]."""
    learned: Array
    """What had been learned and was added, in its mean cycle (points,) [V]."""
    reference_velocity: Array
    """In one cycle (points,) [m/s]."""

    @property
    def points(self) -> int:
        """In a cycle."""
        return len(self.learned)

    @property
    def mean_error(self) -> Array:
        """What every cycle repeats (points,) [m]."""
        mean: Array = self.error.mean(axis=0)
        return mean

    @property
    def rms_m(self) -> float:
        """Of the whole error [m]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def left_over_rms_m(self) -> float:
        """Of what differs from cycle to cycle [m]."""
        count = len(self.error)
        spread = self.error - self.mean_error
        return float(np.sqrt(np.sum(spread**2) / (self.points * (count - 1))))

    @property
    def noise_of_mean_m(self) -> float:
        """What is left of that in the mean cycle [m rms]."""
        return self.left_over_rms_m / math.sqrt(len(self.error))

    @property
    def repeats_rms_m(self) -> float:
        """Of what repeats, without the noise that is left in the mean [m]."""
        square = np.mean(self.mean_error**2) - self.noise_of_mean_m**2
        return math.sqrt(max(float(square), 0.0))

    def spectrum(self) -> tuple[ComplexArray, Array]:
        """Return the mean error's spectrum and the variance of each of its lines."""
        spectra = np.fft.rfft(self.error, axis=1)
        mean: ComplexArray = spectra.mean(axis=0)
        count = len(self.error)
        variance = np.sum(np.abs(spectra - mean) ** 2, axis=0) / (count * (count - 1))
        return mean, np.asarray(variance)


def require_learnable(program: Program) -> None:
    """Raise UsageError where there are not enough cycles to tell what repeats."""
    require_repeating(program)
    if program.cycles < LEAST_CYCLES:
        raise UsageError(
            f"program '{program.name}' has {program.cycles} cycles: learning needs "
            f"{LEAST_CYCLES}, so that what repeats can be told from what does not"
        )


def cycles_of(recording: Recording, name: str, program: Program) -> Repetition:
    """Return the cycles of the last run of a program in a log.

    Parameters
    ----------
    recording
        A log of an axis that followed it to its end.
    name
        The axis.
    program
        What it followed.

    Raises
    ------
    UsageError
        The program does not repeat.
    DataError
        The axis did not follow it to its end, or rows are missing.
    """
    require_learnable(program)
    axis = recording.axes[name]
    trajectory = program.trajectories()[name]
    assert program.period_s is not None  # else it is not learnable
    period_s, cycles = program.period_s, program.cycles
    own = _own_rows(recording, axis)
    begin_s, rows = _begin(recording, axis, own, trajectory, program.name)
    require_sound_rows(recording, name, rows, MOST_MISSING)
    time_s = recording.time_s[own]
    tick_s = float(np.median(np.diff(time_s)))
    points = min(round(period_s / tick_s), MOST_POINTS)
    used = range(max(1, cycles // SETTLING), cycles)
    places = np.arange(points) / points
    at_s = begin_s + period_s * (np.array(used)[:, None] + places)
    error, learned = axis.following_error, axis.learned
    assert error is not None  # the reference was there
    added = np.zeros(points)
    if learned is not None:
        added = np.interp(at_s, time_s, learned[own]).mean(axis=0)
    return Repetition(
        axis=name,
        source=recording.source,
        period_s=period_s,
        error=np.interp(at_s, time_s, error[own]),
        learned=added,
        reference_velocity=trajectory.sample(period_s * places)[1],
    )


def _own_rows(recording: Recording, axis: AxisRecording) -> NDArray[np.intp]:
    """Return the rows of the axis' own ticks."""
    if axis.following_error is None or axis.reference is None or axis.state is None:
        raise DataError(
            f"{recording.source}: axis {axis.name}: its reference or state was not recorded: "
            "learning needs a log that motorctl wrote"
        )
    if axis.flags is None:
        return np.arange(len(axis.position))
    return np.flatnonzero(axis.flags & int(SampleFlag.BETWEEN) == 0)


def _begin(
    recording: Recording,
    axis: AxisRecording,
    own: NDArray[np.intp],
    trajectory: Trajectory,
    program: str,
) -> tuple[float, slice]:
    """Return when the first cycle began [s], and the rows from there to the end of the last."""
    assert axis.state is not None  # as `_own_rows` has seen
    assert axis.reference is not None
    place = f"{recording.source}: axis {axis.name}"
    running = np.flatnonzero(axis.state == AxisState.RUNNING)
    if not len(running):
        raise DataError(f"{place}: it followed no program: give a log of '{program}'")
    end = int(running[-1]) + 1
    begin_s = float(recording.time_s[end - 1]) - trajectory.duration_s
    inside = own[(own < end) & (recording.time_s[own] >= begin_s)]
    time_s, reference = recording.time_s[inside], axis.reference[inside]
    for _ in range(PLACING_ROUNDS):
        x, v, _ = trajectory.sample(time_s - begin_s)
        begin_s -= float(np.sum((reference - x) * v) / np.sum(v * v))
    off_m = float(np.abs(reference - trajectory.sample(time_s - begin_s)[0]).max(initial=0.0))
    whole = begin_s >= recording.time_s[0] and len(inside) > 0
    if not whole or not off_m <= OFF_COURSE_M:
        raise DataError(
            f"{place}: its last motion was not the whole of '{program}'"
            + (f" (its reference is {off_m * 1e6:.3g} µ{axis.position_unit} off)" if whole else "")
            + ": give a log that ends with it"
        )
    return begin_s, slice(int(inside[0]), end)
