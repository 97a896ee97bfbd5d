"""The yardstick that no hypothesis can change: the recorded position, predicted by simulation.

The modelled acceleration along the recorded command and motion is integrated twice, from the
measured state at the beginning of each window. Over short windows the noise of that state rules,
over long ones the drift of whatever small force is unknown; so several lengths are asked, and that
one is told at which the declared model's error first stands clear of the noise.

Friction is that of the recorded speed. But where a delay does in one model what inertia does in the
other, friction at the simulated speed brings that back: of an axis that follows its command at
once, as one behind a drive of its speed, nothing else tells where it goes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import gmean

from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.whole_model import InertiaRange, can_move, inertia_of

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]
ByWindow = Mapping[float, float]
"""What a model misses of position or velocity, rms, by the length of the windows [s], shortest
first."""

WINDOWS_S = (0.01, 0.03, 0.1)
"""Lengths of the windows [s], a half decade apart. Shorter ones show the noise of the measured
state, in longer ones drift rules. Chosen by hand."""
LONG_WINDOWS_S = (0.3, 1.0, 3.0)
"""Lengths of windows for models that differ in whether inertia or a delay makes the motion late
[s]. Larger ones fit into few recordings, smaller ones end while an axis with much inertia still
goes on as it went. Chosen by hand: on from the others."""
FORGOTTEN = 3.0
"""Length of such windows, over the time for which the heavier model keeps its speed. Larger leaves
few windows; smaller counts for the heavier model that it goes on as it was measured, which the
lighter one does not. Arithmetic: a twentieth is left of the speed at the beginning."""
LIGHTER = 2.0
"""Factor in inertia from which that is so. Larger asks light models for what they cannot know,
smaller lets drift decide. Convention: twofold, as inertia that is far off."""
FASTER = 0.01
"""Part by which a motion is taken to be faster to see how friction grows. Larger leaves the
straight line, smaller drowns in rounding. Chosen by hand."""
FEWEST_SAMPLES = 4
"""Samples of a window at least. Fewer show no motion. Arithmetic: a state and its change."""
CLEAR_OF_NOISE = 5.0
"""What the declared model misses, over the rms of the position's noise, from which a window tells
of the model. Larger tells of longer windows, smaller of the noise. Chosen by hand."""


@dataclass(frozen=True, eq=False)
class Motion:
    """How a model moves on its own, beside the recorded motion."""

    model: Hypothesis
    held: Rows | None
    """Which rows are asked, (m,); all by default."""

    @cached_property
    def along(self) -> tuple[ByWindow, ByWindow]:
        """What is missed of position and velocity, friction as at the recorded speed."""
        return self._missed(WINDOWS_S, math.inf)

    @cached_property
    def brought_back(self) -> tuple[ByWindow, ByWindow]:
        """The same, in longer windows as well, friction as at the simulated speed."""
        return self._missed((*WINDOWS_S, *LONG_WINDOWS_S), self.keeps_s)

    @cached_property
    def keeps_s(self) -> float:
        """How long friction lets the model keep a speed: inertia over viscous friction [s]."""
        return _keeps_s(self.model)

    @cached_property
    def _predicted(self) -> list[Array]:
        return self.model.predicted_acceleration()

    def _missed(self, windows_s: Sequence[float], keeps_s: float) -> tuple[ByWindow, ByWindow]:
        signals = self.model.regressors.signals
        return _motion_missed(self._predicted, signals, self.held, windows_s, keeps_s)


@dataclass(frozen=True, eq=False)
class Missed:
    """What a model misses of position or velocity [rms], by the length of the windows [s]."""

    motion: Motion | None = None
    """None: of a model that cannot be simulated."""
    of_velocity: bool = False

    @property
    def by_window(self) -> ByWindow:
        """In windows of WINDOWS_S, without those of which none is whole; friction as recorded."""
        return {} if self.motion is None else self.motion.along[self.of_velocity]

    @property
    def brought_back(self) -> ByWindow:
        """In longer windows as well, friction as at the simulated speed."""
        return {} if self.motion is None else self.motion.brought_back[self.of_velocity]


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


def judge_by_simulation(
    signals: Signals, before: Missed, after: Missed, instead: bool | None = None
) -> Simulated | None:
    """Compare two models by the position that they predict.

    Parameters
    ----------
    signals
        The rows of both.
    before, after
        What each misses (see `simulated_position`).
    instead
        Whether to ask as where a delay does in one what inertia does in the other; None: as
        `delays_instead` says of the two.

    Returns
    -------
    Simulated or None
        None where no window is whole.
    """
    pairs = _pairs(before, after, instead)
    if not pairs:
        return None
    noise = CLEAR_OF_NOISE * signals.position_noise_rms
    told = next((w for w, (missed, _) in pairs.items() if missed > noise), list(pairs)[-1])
    return Simulated(told, *pairs[told], float(gmean(list(_ratios(pairs).values()))))


def ratios_of(before: Missed, after: Missed, instead: bool | None = None) -> dict[float, float]:
    """Return what one model misses over what another does, by the windows that tell of both [s].

    `instead` is that of `judge_by_simulation`.
    """
    return _ratios(_pairs(before, after, instead))


def _ratios(pairs: Mapping[float, tuple[float, float]]) -> dict[float, float]:
    return {w: max(second, 1e-300) / max(first, 1e-300) for w, (first, second) in pairs.items()}


def _pairs(before: Missed, after: Missed, instead: bool | None) -> dict[float, tuple[float, float]]:
    """Return what two models miss in the windows that tell of both [s]."""
    if not (delays_instead(before, after) if instead is None else instead):
        first, second = before.by_window, after.by_window
        return {w: (first[w], second[w]) for w in first if w in second}
    first, second = before.brought_back, after.brought_back
    shortest = FORGOTTEN * max(m.motion.keeps_s for m in (before, after) if m.motion is not None)
    return {w: (first[w], second[w]) for w in first if w in second and w >= shortest}


def delays_instead(before: Missed, after: Missed) -> bool:
    """Return whether a delay does in the second model what inertia does in the first."""
    first, second = before.motion, after.motion
    if first is None or second is None:
        return False
    later = second.model.path.delay_s > first.model.path.delay_s
    lighter = later and inertia_of(second.model) * LIGHTER < inertia_of(first.model) < math.inf
    return lighter and second.keeps_s < WINDOWS_S[-1] and first.keeps_s < math.inf


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
    Missed
        Simulated when it is first asked.
    """
    return Missed(Motion(hypothesis, held))


def simulated_motion(hypothesis: Hypothesis, held: Rows | None = None) -> tuple[Missed, Missed]:
    """Return what a model misses of the position and of the velocity, as `simulated_position`."""
    motion = Motion(hypothesis, held)
    return Missed(motion), Missed(motion, of_velocity=True)


def _keeps_s(model: Hypothesis) -> float:
    """Return how long friction lets an axis keep a speed that its command has not [s].

    By how all friction grows with the speed, on the whole of the motion. Not above 0 where a
    model's inertia is not seen and came out so; infinite where friction does not grow.
    """
    step = model.regressors.signals.decimation
    frictions = [e for e in model.of_kind("state") if "friction" in e.groups and not e.remembers()]
    gained = size = 0.0
    for s in model.regressors.signals.stretches:
        faster = replace(s, v=(1.0 + FASTER) * s.v, quiet=(1.0 + FASTER) * s.quiet)
        v = s.v[::step]
        size += float(v @ v)
        for effect in frictions:
            own = [i for i, name in enumerate(model.names) if name == effect.name]
            more = faster.columns(effect, step=step) - s.columns(effect, step=step)
            gained += float(model.b[own] @ more @ v) / FASTER
    # each over the inertia, as the acceleration stands on the left
    return -size / gained if gained * float(model.b[0]) < 0.0 else math.inf


def position_of_declared(
    base: Hypothesis, held: Rows | None = None, known: Sequence[InertiaRange] = ()
) -> Missed:
    """Return what the declared model misses of the position, that any other is compared with.

    Nothing where its inertia would be negative, as beside a weight that outweighs it, or far beyond
    what is `known`: such a model cannot be simulated, or does not move.
    """
    return simulated_position(base, held) if can_move(base, known) else Missed()


def missed_by(predicted: Sequence[Array], signals: Signals, held: Rows | None = None) -> ByWindow:
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
    return _motion_missed(predicted, signals, held, WINDOWS_S, math.inf)[0]


def _motion_missed(
    predicted: Sequence[Array],
    signals: Signals,
    held: Rows | None,
    windows_s: Sequence[float],
    keeps_s: float,
) -> tuple[ByWindow, ByWindow]:
    """Return what a prediction misses of the position [m, rms] and of the velocity [m/s, rms]."""
    chosen = _samples(signals, held)
    lengths = {max(FEWEST_SAMPLES, round(w / signals.period_s)): None for w in windows_s}
    position: dict[float, float] = {}
    velocity: dict[float, float] = {}
    for length in lengths:
        squares = [
            _missed(s.x, s.v, a, used, length, signals.period_s, keeps_s)
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
    x: Array, v: Array, a: Array, used: Rows, length: int, dt: float, keeps_s: float
) -> tuple[Array, Array]:
    """Return the mean squares missed of position and velocity in each whole window of a stretch."""
    windows = max(len(x) // length - 1, 0)
    part = slice(length, length * (windows + 1))  # the filter's start is no motion
    if not windows:
        return np.zeros(0), np.zeros(0)
    whole = used[part].reshape(windows, length).all(axis=1)
    if not whole.any():
        return np.zeros(0), np.zeros(0)
    x, v, a = (signal[part].reshape(windows, length)[whole] for signal in (x, v, a))
    speed = v[:, :1] + dt * (np.cumsum(a, axis=1) - 0.5 * (a[:, :1] + a))
    if keeps_s < math.inf:
        speed = v + _brought_back(speed - v, keeps_s / dt)
    place = x[:, :1] + dt * (np.cumsum(speed, axis=1) - 0.5 * (speed[:, :1] + speed))
    return np.mean((place - x) ** 2, axis=1), np.mean((speed - v) ** 2, axis=1)


def _brought_back(off: Array, samples: float) -> Array:
    """Return how far the speed is off where friction brings it back, (windows, length).

    `off` is how far it is without that: its steps are what drives it off.
    """
    steps = np.diff(off, axis=1, prepend=0.0)
    stays = math.exp(-1.0 / samples) if samples > 0.0 else 0.0
    return np.asarray(lfilter([(1.0 - stays) * samples], [1.0, -stays], steps, axis=1))
