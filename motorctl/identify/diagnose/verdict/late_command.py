"""A command column that was recorded later than it acted: no cause comes after its effect."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import later
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.model import Effect

Array = NDArray[np.float64]
Leads = NDArray[np.int64]

NEAR_S, LONGEST_S = 0.02, 0.25
"""Up to where a lateness is looked for closely, and at all [s]. Larger takes time and finds slow
feedback, smaller misses slow loggers. Chosen by hand."""
STEP_S = 5e-4
"""Between two times that are tried [s]. Larger tells it roughly, smaller takes time. Chosen by
hand."""
LEAST_S = 1e-3
"""Shortest lateness that is told [s]. Larger misses late columns, smaller tells of what lags and
sampling blur. Chosen by hand."""
LEAST_SAMPLES = 1.5
"""The same in samples: columns may be latched at either end of one. Larger misses late columns at
low rates, smaller tells of that. Arithmetic: one sample, with half of one as room."""
FITS_BETTER = 0.9
"""Squared acceleration that an earlier command leaves, over what the recorded one leaves, from
which it is told. Nearer to 1 suspects sound recordings, smaller misses late columns. Chosen by
hand: of 48 sound machines of other hands one is below, of the same with a command 4 ms late 27."""
FITS_MUCH_BETTER = 0.6
"""The same where the lateness is no near one, which slow feedback imitates. Nearer to 1 suspects
sound recordings, smaller misses late columns. Chosen by hand: of 91 sound real axes none is told,
an arm's joint with a current that is 115 and 190 ms late has 0.3."""
TINY = 1e-300
"""Variance of a command that does nothing: keeps divisions whole. Any other would do that is below
every signal's and above zero. Convention."""
SHIFTED = 4
"""The command is shifted by one row in so many, at most. Larger misses late columns of short
motion, smaller compares a few rows. Chosen by hand."""

READ_PLAINLY = 0.7
"""Squared acceleration that is left with the command half a period earlier, over that with it held
from its row on, below which it counts as read where samples are even. Larger moves commands of
machines that lack something else, smaller leaves measured currents half a period late. Chosen by
hand: of 94 real axes none is below 0.84, currents that were measured at 45 and 100 Hz leave 0.12 to
0.49."""


@dataclass(frozen=True)
class LateColumn:
    """How late a command was recorded, and what squared residual that leaves, in which band."""

    late_s: float
    left: float
    """Squared acceleration that the earlier command leaves."""
    recorded: float
    """What the one leaves that was recorded."""
    band_hz: float

    def told(self) -> str:
        """Return a hint that tells of it."""
        part = 100.0 * self.left / self.recorded
        return (
            f"the motion answers to the command {1e3 * self.late_s:.3g} ms before it was recorded "
            f"(this leaves {part:.0f} % of the squared residual): where the "
            f"column is late, give the command late_s: {self.late_s:.3g} in the description"
        )


def late_command(heard: Hypothesis, band_hz: float = math.inf) -> LateColumn | None:
    """Return how late the command column is against the position, None where it is not.

    Parameters
    ----------
    heard
        The declared model over the band in which motion outweighs noise.
    band_hz
        Band of the motion itself [Hz]: where that is narrower it is asked first, as noise hides
        late columns in the wider one.
    """
    found = None
    if band_hz < heard.regressors.signals.band_hz:
        found = _late(_in_band(heard, band_hz), FITS_MUCH_BETTER)
    return found or _late(heard, FITS_BETTER)


def _late(heard: Hypothesis, near_limit: float) -> LateColumn | None:
    signals = heard.regressors.signals
    rows = heard.problem.joined(signals.rows)
    step = max(1, round(STEP_S / signals.period_s))
    near = round(NEAR_S / signals.period_s) + step
    leads = np.arange(0, near + 1, step)
    left = _left_by_leads(signals, rows, leads)
    best, limit = int(np.argmin(left)), near_limit
    later_ones = -leads[1:]
    near_one = 0 < best < len(leads) - 1 and left[best] <= near_limit * left[0]
    if not near_one and (around := _far_lead(signals, rows)) is not None:
        leads = np.concatenate([[0], around])
        left = _left_by_leads(signals, rows, leads)
        best, limit = int(np.argmin(left)), FITS_MUCH_BETTER
    late_s = float(leads[best]) * signals.period_s
    least_s = max(LEAST_S, LEAST_SAMPLES * signals.period_s)
    if late_s < least_s or left[best] > limit * left[0]:
        return None
    if best == len(leads) - 1:  # slow feedback, or a wave
        return None
    later_left = min(_left_later(signals, rows), _left_by_leads(signals, rows, later_ones).min())
    if later_left <= left[best]:
        return None  # a later one does as well: of a wave, any period may seem to
    of_command = {effect.name for effect in heard.of_kind("input")}
    motion = rows[[k for k, name in enumerate((*heard.names, "")) if k and name not in of_command]]
    recorded, earlier = (_unexplained(signals, motion, lead) for lead in (0, int(leads[best])))
    if earlier >= recorded:
        return None  # seen by one of two regressions: noise of the acceleration
    return LateColumn(late_s, float(left[best]), float(left[0]), signals.band_hz)


def _unexplained(signals: Signals, motion: Array, lead: int) -> float:
    """Return the part of the command's variance that the motion leaves, at a lead.

    Effects of the command itself would explain it as it was recorded, whenever it acted.
    """
    (command,) = signals.filtered([_earlier(s.command, lead)[None] for s in signals.stretches])
    X = np.vstack([motion, np.ones((1, len(command)))]).T
    rest = command - X @ np.linalg.lstsq(X, command, rcond=None)[0]
    return float(np.var(rest) / max(float(np.var(command)), TINY))


def _in_band(heard: Hypothesis, band_hz: float) -> Hypothesis:
    """Return a hypothesis over the same rows in a narrower band."""
    every = heard.regressors
    plain = every.signals.plain(band_hz)
    regressors = Regressors(plain, every.declared, every.blocks, every.side, every.catalogue)
    return Hypothesis(regressors, heard.added).refreshed()


def _left_later(signals: Signals, rows: Array) -> float:
    """Return the least that a command later by whole rows leaves, infinity in a short recording."""
    return min(
        (_left_row(rows, -lead) for lead in range(1, _longest(signals, rows) + 1)), default=np.inf
    )


def _left_row(rows: Array, lead: int) -> float:
    """Return what a command so many rows earlier leaves: those are filtered already."""
    return _left(_earlier(rows[0], lead), rows)


def _longest(signals: Signals, rows: Array) -> int:
    """Return by how many rows a command is shifted at most."""
    return int(min(round(LONGEST_S / signals.row_period_s), rows.shape[1] // SHIFTED))


def _far_lead(signals: Signals, rows: Array) -> Leads | None:
    """Return leads around the far one that leaves least; None where that is not little enough."""
    end = _longest(signals, rows)
    if end < 2:
        return None
    earlier = np.array([_left_row(rows, lead) for lead in range(end + 1)])
    best = int(np.argmin(earlier))
    if best in (0, end) or earlier[best] > FITS_MUCH_BETTER * earlier[0]:
        return None
    step, d = max(1, round(STEP_S / signals.period_s)), signals.decimation
    around = np.arange((best - 1) * d, (best + 1) * d + 1, step)
    return around[around > 0]


def late_beside(
    heard: Hypothesis, found: Sequence[Effect], band_hz: float, late: LateColumn | None
) -> LateColumn | None:
    """Return how late a command column still is beside what was found; None where it is not.

    What is still to be explained may look late by chance: it does where what was found leaves less
    than a late column would. A lag, a delay or a resonance may themselves be found for a column
    that is late, so nothing counts that filters the command. Of two times in one band the one that
    leaves less counts: what was found in a late column is bent by that.

    Parameters
    ----------
    heard, band_hz
        As of `late_command`.
    found
        The effects that the declared model lacks.
    late
        What was told without them.
    """
    kept = [e for e in found if e.kind == "state" and "resonance" not in e.groups]
    if not kept:
        return late or late_command(heard, band_hz)
    beside = Hypothesis(heard.regressors, tuple(kept)).refreshed()
    again = late_command(beside, band_hz)
    if late is None:
        return again
    if again is not None and again.band_hz == late.band_hz:
        return min(late, again, key=lambda each: each.left)
    in_band = _in_band(beside, late.band_hz)
    rows = in_band.problem.joined(in_band.regressors.signals.rows)
    (left,) = _left_by_leads(in_band.regressors.signals, rows, np.zeros(1, np.int64))
    return late if late.left < left else again


def read_between(
    data: Measured, heard: Hypothesis, late: LateColumn | None = None
) -> tuple[Measured, str | None]:
    """Return an axis with its command where it acted, if it was read and not written.

    Who writes a row with each command knows when that began to act. A recorder that comes by reads
    what was written before: then it is half a period late on average, and the motion shows it. So
    is a current that was measured with the position, beside one that is held from its row on. Even
    samples are mostly a loop's own, so that of these the motion must show it plainly.

    Parameters
    ----------
    data
        The axis as measured.
    heard
        As of `late_command`.
    late
        What was found by that: a column that is later still is not half of it earlier.

    Returns
    -------
    Measured
        With the command half a period earlier where the motion answers to that.
    str or None
        A note that says so.
    """
    if late and not data.uneven:
        return data, None
    signals = heard.regressors.signals
    rows = heard.problem.joined(signals.rows)
    earlier = [_half_earlier(s.command) for s in signals.stretches]
    read = signals.filtered([0.5 * (u + later(u, 1))[None] for u in earlier])[0]
    part = _left(read, rows) / max(_left(rows[heard.regressors.command_column], rows), 1e-300)
    if part >= (1.0 if data.uneven else READ_PLAINLY):
        return data, None
    earlier_by = f"the motion answers to a command {500.0 * data.period_s:.2g} ms before it was"
    return replace(data, command=_half_earlier(data.command)), (
        f"samples are uneven, and {earlier_by} recorded: it was taken as one that was written "
        "before the sample came"
        if data.uneven
        else f"{earlier_by} recorded (this leaves {100.0 * part:.0f} % of the squared error): it "
        "was taken as one that was measured with the position, and not held from its row on"
    )


def _left_by_leads(signals: Signals, rows: Array, leads: Leads) -> Array:
    """Return the squared acceleration that commands so many samples earlier leave."""
    shifted = signals.filtered(
        [np.stack([_earlier(s.command, int(k)) for k in leads]) for s in signals.stretches]
    )
    return np.array([_left(command, rows) for command in shifted])


def _half_earlier(u: Array) -> Array:
    return 0.5 * (u + _earlier(u, 1))


def _earlier(u: Array, samples: int) -> Array:
    if samples < 0:
        return later(u, -samples)
    return u if samples == 0 else np.concatenate([u[samples:], np.full(samples, u[-1])])


def _left(command: Array, rows: Array) -> float:
    """Return the squared acceleration that a command and the model's other columns leave."""
    X = np.vstack([command[None], rows[1:-1]]).T
    rest = rows[-1] - X @ np.linalg.lstsq(X, rows[-1], rcond=None)[0]
    return float(rest @ rest)
