"""The yardstick that no hypothesis can change: the recorded position, predicted by simulation.

The modelled acceleration along the recorded command and motion is integrated twice, from the
measured state at the beginning of each window. Over short windows the noise of that state rules,
over long ones the drift of whatever small force is unknown; so several lengths are asked, and that
one is told at which the declared model's error first stands clear of the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gmean

from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.whole_model import InertiaRange, can_move

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]
Missed = Mapping[float, float]
"""What a model misses of position or velocity, rms, by the length of the windows [s], shortest
first."""

WINDOWS_S = (0.01, 0.03, 0.1)
"""Lengths of the windows [s], a half decade apart. Shorter ones show the noise of the measured
state, in longer ones drift rules. Chosen by hand."""
FEWEST_SAMPLES = 4
"""Samples of a window at least. Fewer show no motion. Arithmetic: a state and its change."""
CLEAR_OF_NOISE = 5.0
"""What the declared model misses, over the rms of the position's noise, from which a window tells
of the model. Larger tells of longer windows, smaller of the noise. Chosen by hand."""


@dataclass(frozen=True)
class Simulated:
    """What two models miss of the position, over windows of one length and over all lengths."""

    window_s: float
    before_rms: float
    after_rms: float
    ratio: float
    """After over before, the geometric mean over all lengths."""

    @property
    def worse(self) -> float:
        """Return how much worse the second is, by the length that is told or by all."""
        return max(self.ratio, self.after_rms / max(self.before_rms, 1e-300))


def judge_by_simulation(signals: Signals, before: Missed, after: Missed) -> Simulated | None:
    """Compare two models by the position that they predict.

    Parameters
    ----------
    signals
        The rows of both.
    before, after
        What each misses (see `simulated_position`).

    Returns
    -------
    Simulated or None
        None where no window is whole.
    """
    ratios = ratios_of(before, after)
    if not ratios:
        return None
    noise = CLEAR_OF_NOISE * signals.position_noise_rms
    told = next((w for w in ratios if before[w] > noise), list(ratios)[-1])
    return Simulated(told, before[told], after[told], float(gmean(list(ratios.values()))))


def ratios_of(before: Missed, after: Missed) -> dict[float, float]:
    """Return what one model misses over what another does, by the windows that both have [s]."""
    common = [window for window in before if window in after]
    return {w: max(after[w], 1e-300) / max(before[w], 1e-300) for w in common}


def simulated_position(hypothesis: Hypothesis, held: Rows | None = None) -> Missed:
    """Return what a model misses of the position [m, rms], by the length of the windows [s].

    Parameters
    ----------
    hypothesis
        The model.
    held
        Which rows are asked, (m,); all by default.

    Returns
    -------
    dict
        Without lengths of which no window is whole.
    """
    return missed_by(hypothesis.predicted_acceleration(), hypothesis.regressors.signals, held)


def simulated_motion(hypothesis: Hypothesis, held: Rows | None = None) -> tuple[Missed, Missed]:
    """Return what a model misses of the position and of the velocity, as `simulated_position`."""
    return _motion_missed(hypothesis.predicted_acceleration(), hypothesis.regressors.signals, held)


def position_of_declared(
    base: Hypothesis, held: Rows | None = None, known: Sequence[InertiaRange] = ()
) -> Missed:
    """Return what the declared model misses of the position, that any other is compared with.

    Nothing where its inertia would be negative, as beside a weight that outweighs it, or far beyond
    what is `known`: such a model cannot be simulated, or does not move.
    """
    return simulated_position(base, held) if can_move(base, known) else {}


def missed_by(predicted: Sequence[Array], signals: Signals, held: Rows | None = None) -> Missed:
    """Return what any prediction of the acceleration misses of the position [m, rms].

    Parameters
    ----------
    predicted
        The acceleration at every sample of each stretch, (N,).
    signals
        The motion.
    held
        Which rows are asked, (m,); all by default.
    """
    return _motion_missed(predicted, signals, held)[0]


def _motion_missed(
    predicted: Sequence[Array], signals: Signals, held: Rows | None
) -> tuple[Missed, Missed]:
    """Return what a prediction misses of the position [m, rms] and of the velocity [m/s, rms]."""
    chosen = _samples(signals, held)
    lengths = {max(FEWEST_SAMPLES, round(w / signals.period_s)): None for w in WINDOWS_S}
    position: dict[float, float] = {}
    velocity: dict[float, float] = {}
    for length in lengths:
        squares = [
            _missed(s.x, s.v, a, used, length, signals.period_s)
            for s, a, used in zip(signals.stretches, predicted, chosen, strict=True)
        ]
        for found, parts in zip((position, velocity), zip(*squares, strict=True), strict=True):
            every = np.concatenate(parts)
            if len(every):
                found[length * signals.period_s] = math.sqrt(float(np.mean(every)))
    return position, velocity


def _samples(signals: Signals, held: Rows | None) -> list[Rows]:
    """Return for each stretch the samples whose rows are asked."""
    found, start = [], 0
    for s, kept in zip(signals.stretches, signals.kept, strict=True):
        used = kept.copy()
        if held is not None:
            used[kept] = held[start : start + int(kept.sum())]
            start += int(kept.sum())
        found.append(np.repeat(used, signals.decimation)[: len(s.x)])
    return found


def _missed(
    x: Array, v: Array, a: Array, used: Rows, length: int, dt: float
) -> tuple[Array, Array]:
    """Return the mean squares missed of position and velocity in each whole window of a stretch."""
    windows = max(len(x) // length - 1, 0)
    part = slice(length, length * (windows + 1))  # the filter's start is no motion
    if not windows:
        return np.zeros(0), np.zeros(0)
    whole = used[part].reshape(windows, length).all(axis=1)
    x, v, a = (signal[part].reshape(windows, length)[whole] for signal in (x, v, a))
    speed = v[:, :1] + dt * (np.cumsum(a, axis=1) - 0.5 * (a[:, :1] + a))
    place = x[:, :1] + dt * (np.cumsum(speed, axis=1) - 0.5 * (speed[:, :1] + speed))
    return np.mean((place - x) ** 2, axis=1), np.mean((speed - v) ** 2, axis=1)
