"""The rows of a log in which an excitation repeats while the axis moves evenly, as windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState, SampleFlag

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK = 16
"""Values in a row that must be alike for a period to be over. Fewer take two places of a multisine
for one, more need more of a short period."""
SETTLE_PERIODS = 0.25
"""Of the excitation, after a change of the motion, until its answer is the lasting one. Less leaves
the change in the response, more throws rows away. By hand."""
EVEN = 1e-6
"""Change of the reference's velocity from row to row that is none, as a share of its largest."""
JITTER, SEED = 0.1, 1
"""Of a period, by which the distance of two windows varies at random. An even motion passes the
counts of the encoder evenly, and at even distances what it rounds away would not average out."""
STANDING = 1e-3
"""Share of the largest speed below which an axis stands. Any between rounding and 1 would do."""
LATE = "where the computer missed a tick"
AT_LIMIT = "with the command at its limit"
WITHOUT_SAMPLE = "without a sample of the encoder"
NOT_RECORDED = "not recorded"
NOT_LED = "while the axis was not led"
"""Why a row tells no response, as a message says it."""
LEAST_WINDOWS = 4
"""Fewer say nothing of the scatter from period to period."""


@dataclass(frozen=True)
class Windows:
    """Windows of one period each, overlapping by about half."""

    period_s: float
    """Of the axis' rows."""
    ticks: int
    """Rows in a window: a period of the excitation."""
    excitation: Array
    """(m, ticks) [V]."""
    command: Array
    """(m, ticks) [V]."""
    error: Array
    """(m, ticks) position - reference [m]."""
    speed_m_s: float
    """Of the motion meanwhile; 0 where the axis stood."""


def excited_windows(recording: Recording, name: str, divisor: int = 1) -> Windows:
    """Return the windows of an axis' excitation.

    Parameters
    ----------
    recording
        With the excitation's column.
    name
        The axis.
    divisor
        Rows in one tick of the axis.

    Raises
    ------
    DataError
        Where it has none: no such axis, no excitation, or no whole period in even motion.
    """
    if name not in recording.axes:
        known = ", ".join(recording.axes)
        raise DataError(f"{recording.source}: no axis '{name}'; it has: {known}")
    axis = recording.axes[name]
    place = f"{recording.source}: axis {name}"
    if axis.excitation is None or not np.any(axis.excitation):
        raise DataError(f"{place}: it was not excited: record it with `motorctl response {name}`")
    error, reference_velocity = axis.following_error, axis.reference_velocity
    if error is None or reference_velocity is None:
        raise DataError(f"{place}: its reference was not recorded")
    own = _own_rows(axis, divisor)
    excitation = axis.excitation[own]
    ticks, whole = _period(excitation, place)
    velocity = reference_velocity[own]
    spoiled = _spoiled(recording, axis, own, divisor)
    good = whole & ~np.any(list(spoiled.values()), axis=0)
    fastest = float(np.abs(velocity[whole]).max(initial=0.0))
    if fastest > 0.0 and np.any(moving := np.abs(velocity) > STANDING * fastest):
        good &= moving
    starts = _starts(good, velocity, ticks, EVEN * fastest)
    if len(starts) < LEAST_WINDOWS:
        raise DataError(
            f"{place}: only {len(starts)} windows of a whole period ({ticks} rows) in which the "
            f"axis moves evenly and no row is spoiled; needs {LEAST_WINDOWS}; "
            f"{_what_spoiled(spoiled, whole)}"
        )
    rows = starts[:, None] + np.arange(ticks)
    used = own[rows]
    return Windows(
        period_s=recording.period_s * divisor,
        ticks=ticks,
        excitation=excitation[rows],
        command=axis.command[used],
        error=error[used],
        speed_m_s=float(np.abs(velocity[rows]).mean()),
    )


def _own_rows(axis: AxisRecording, divisor: int) -> NDArray[np.intp]:
    """Return the rows of the axis' own ticks; a slower driver's axis repeats the last between."""
    if axis.flags is not None:
        return np.flatnonzero((axis.flags & int(SampleFlag.BETWEEN)) == 0)
    return np.arange(0, len(axis.position), divisor)


def _period(excitation: Array, place: str) -> tuple[int, Mask]:
    """Return the rows of a period, and where the excitation repeats exactly: at its full size.

    Of several excitations in one log it is the longest.
    """
    excited = _longest_run(np.flatnonzero(excitation))
    middle = int(excited[len(excited) // 2])
    block = excitation[middle : middle + BLOCK]
    alike = middle + 1 + np.flatnonzero(excitation[middle + 1 :] == block[0])
    found = next(
        (int(at) for at in alike if np.array_equal(excitation[at : at + len(block)], block)), None
    )
    if found is None or len(block) < BLOCK:
        raise DataError(f"{place}: its excitation does not repeat, so it tells no response")
    ticks = found - middle
    same = np.zeros(len(excitation), np.bool_)
    same[:-ticks] = excitation[:-ticks] == excitation[ticks:]
    whole = same.copy()
    whole[ticks:] |= same[:-ticks]
    first, last = int(excited[0]), int(excited[-1])
    whole[:first], whole[last + 1 :] = False, False
    return ticks, whole


def _longest_run(excited: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the rows of the longest excitation; between two there is none for a while."""
    runs = np.split(excited, np.flatnonzero(np.diff(excited) > BLOCK) + 1)
    return max(runs, key=len)


def _spoiled(
    recording: Recording, axis: AxisRecording, own: NDArray[np.intp], divisor: int
) -> dict[str, Mask]:
    """Return which of the axis' rows tell no response, by why."""
    steps = np.diff(recording.time_s[own]) * recording.sample_rate_hz / divisor
    spoiled = {LATE: np.concatenate([[False], np.abs(steps - 1.0) >= 0.5])}
    if axis.flags is not None:
        flags = axis.flags[own]
        spoiled[AT_LIMIT] = (flags & int(SampleFlag.SATURATED)) != 0
        spoiled[LATE] |= (flags & int(SampleFlag.SKIPPED)) != 0
        spoiled[WITHOUT_SAMPLE] = (flags & int(SampleFlag.HELD)) != 0
    if axis.recorded is not None:
        spoiled[NOT_RECORDED] = ~axis.recorded[own]
    halted = np.zeros(len(own), np.bool_)
    if axis.state is not None:
        halted |= ~np.isin(axis.state[own], (AxisState.IDLE, AxisState.RUNNING))
    if axis.fault is not None:
        halted |= axis.fault[own] != 0
    return {**spoiled, NOT_LED: halted}


def _what_spoiled(spoiled: dict[str, Mask], excited: Mask) -> str:
    """Return how many excited rows were spoiled and by what, and what helps against it."""
    counts = {why: int(np.count_nonzero(at & excited)) for why, at in spoiled.items()}
    lost = ", ".join(f"{count} {why}" for why, count in counts.items() if count)
    remedies = {
        LATE: "see `motorctl latency` for this computer",
        WITHOUT_SAMPLE: "see to the encoder or the bus",
        AT_LIMIT: "excite it with less amplitude",
    }
    remedy = "; ".join(do for why, do in remedies.items() if counts.get(why))
    return (
        f"of {int(excited.sum())} excited rows {lost or 'none'} {'were' if lost else 'was'} "
        f"spoiled: excite it for longer{'; ' if remedy else ''}{remedy}"
    )


def _starts(good: Mask, velocity: Array, ticks: int, even_m_s: float) -> NDArray[np.intp]:
    """Return where windows begin, about half a period apart within each even stretch."""
    steady = good.copy()
    steady[1:] &= np.abs(np.diff(velocity)) <= even_m_s
    edges = np.flatnonzero(np.diff(np.concatenate([[0], steady.view(np.int8), [0]])))
    settle, rng = round(SETTLE_PERIODS * ticks), np.random.default_rng(SEED)
    found: list[int] = []
    for begin, end in edges.reshape(-1, 2):
        at = int(begin) + settle
        while at + ticks <= end:
            found.append(at)
            at += round(ticks * (0.5 + rng.uniform(-JITTER, JITTER)))
    return np.array(found, np.intp)
