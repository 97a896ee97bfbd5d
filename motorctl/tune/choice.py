"""The gains of least predicted error among those that keep the margins."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import LoopGains, LoopMargins, loop_margins
from motorctl.control import CommandFilter, command_filter
from motorctl.errors import RunError
from motorctl.tune.candidates import LoopShapes, MarginsWanted
from motorctl.tune.command_filters import filters_to_try
from motorctl.tune.predicted import Prediction, Predictor
from motorctl.tune.recorded_loop import RecordedLoop

Array = NDArray[np.float64]

ZEROS_PER_DECADE = 6
"""Of the grid of k1 and gamma_d/ks in the first pass. More takes time, fewer may begin beside the
best: what follows only looks near."""
SLOWEST_K1, FASTEST_K1 = 5e-4, 0.2
"""Range of k1, as parts of the Nyquist frequency in rad/s. Beyond the higher one the backward
difference has no phase left to give, below the lower one the loop hardly holds a position."""
SLOWEST_K2 = 5e-5
"""Lowest gamma_d/ks that is tried, as such a part; d0_hat then follows within some ten seconds."""
GAINS_PER_OCTAVE = 3
"""Of the grid of ks. More takes time, fewer leaves margin unused before it is refined."""
GAIN_OCTAVES = 10
"""ks is tried over so many octaves around what crosses over at the fastest k1."""
ZOOMS = 3
"""Passes around the best, each with a third of the step before. Fewer leave some per cent of error,
more takes time."""
SPARE_DEG, SPARE_GAIN = 0.2, 1.005
"""Margin beyond what is asked [degrees, 1] that the search keeps, for it interpolates between
frequencies and what is written is rounded. Less may fall short of what is asked, more gives error
away."""
DIGITS = 4
"""Significant digits of the gains that are written. Fewer move the margins, more pretend."""
STEP_BACK, MOST_STEPS_BACK = 0.995, 20
"""Factor on ks and gamma_d while rounded gains do not keep exactly what is asked, and how often. A
smaller factor gives error away, fewer steps refuse what is nearly right."""
WORTH = 0.005
"""Part of the error that a step must win for its limit to count as what binds. Larger finds nothing
in the way, smaller names limits beyond which nothing is won."""
WORTH_A_FILTER = 0.95
"""A filter is chosen where it leaves less than this part of the error without one: it is one thing
more that has to stay true of the machine. Nearer to 1 takes one for nothing."""
FILTER_ZEROS_PER_DECADE = 3
"""Of the grid of zeros behind each filter. More takes time, fewer may take the wrong filter."""
DETUNED = 0.05
"""So much a resonance may move, as a part of its frequency, with the loop still stable behind the
filter. By hand: a load or a place that changes moves it by some per cent."""
ANY_MARGINS = MarginsWanted(0.0, 1.0)
AS_GOOD = 0.02
"""Errors that differ by so little count as equal; the larger phase margin decides. Smaller gives
margin away for an error that no prediction is sure of, larger gives error away."""


@dataclass(frozen=True)
class Candidate:
    """Gains that keep what was asked, and what they would do."""

    gains: LoopGains
    phase_deg: float
    gain: float
    """By which factor the loop gain may grow, and shrink."""
    prediction: Prediction


@dataclass(frozen=True)
class GainChoice:
    """The chosen gains, and everything that was tried."""

    chosen: Candidate
    margins: LoopMargins
    """Of the chosen gains, computed exactly."""
    tried: tuple[Candidate, ...]
    """Stable gains, whatever their margins and noise."""
    bound_by: str
    """Which limit keeps the gains from going further, in words."""
    without_filter: Candidate | None = None
    """The best without a filter, where one was chosen, and there is any."""
    filters_tried: int = 0


def choose_gains(
    loop: RecordedLoop,
    wanted: MarginsWanted,
    progress: Callable[[str, float], None],
) -> GainChoice:
    """Return the gains of least predicted eF among those that keep the margins.

    Stable at every corner of the bounds, with the margins at the plant as it was identified, no
    more noise in the command than is wanted, and d0_hat within its bound.

    Parameters
    ----------
    loop
        What a log tells of the axis' loop.
    wanted
        The margins, and the noise that the amplifier may see.
    progress
        Told what is being done, and the share of it that is.

    Returns
    -------
    GainChoice
        The choice, its margins, and what else was tried.

    Raises
    ------
    RunError
        No gains that were tried keep all of it; the message says which limit is in the way.
    """
    search = _Search(loop, wanted)
    # Without a response nobody knows what a filter is there for: it stays.
    base = None if loop.measured is not None else loop.gains.command_filter
    found = search.first_pass(lambda share: progress("trying gains", share), base)
    kept = [candidate for candidate in found if search.keeps(candidate)]
    filters = filters_to_try(loop)
    filtered = _with_filters(search, filters, progress)
    if not kept and not filtered:
        raise RunError(search.why_none(found))
    if kept:
        kept = _refined(search, kept, progress)
    plain = search.as_written(search.best(kept)) if kept else None
    best = plain
    if filtered:
        behind = search.as_written(search.best(_refined(search, filtered, progress)))
        if plain is None or _error(behind) < WORTH_A_FILTER * _error(plain):
            best = behind
    assert best is not None
    margins = margins_of(loop, best.gains)
    return GainChoice(
        best,
        margins,
        (*found, *kept),
        search.bound_by(best),
        None if best is plain else plain,
        len(filters),
    )


def _refined(
    search: _Search, kept: list[Candidate], progress: Callable[[str, float], None]
) -> list[Candidate]:
    """Return candidates with those around the best, finer and finer."""
    step = 1.0 / ZEROS_PER_DECADE
    for number in range(ZOOMS):
        progress("refining gains", number / ZOOMS)
        step /= 3.0
        least = search.least(kept)
        assert least is not None  # the one that `kept` begins with
        kept = kept + search.near(least.gains, step)
    return kept


def _with_filters(
    search: _Search, filters: list[CommandFilter], progress: Callable[[str, float], None]
) -> list[Candidate]:
    """Return what keeps everything behind the filter of least error, by a coarse grid of each."""
    best: list[Candidate] = []
    for number, own in enumerate(filters):
        progress("trying filters", number / len(filters))
        found = search.kept_behind(own)
        least = search.least(found)
        if least is not None and (not best or _error(least) < _error(best[0])):
            best = [least]
    return best


def shapes_of(loop: RecordedLoop) -> LoopShapes:
    """Return what tells the margins of gains around a loop's plant."""
    plant = loop.plant
    corners = plant.corners(loop.period_s)
    return LoopShapes(plant.nominal(loop.period_s), corners, loop.measured)


def margins_of(loop: RecordedLoop, gains: LoopGains) -> LoopMargins:
    """Return the margins of some gains around the plant: exact ones around one that was fitted."""
    if loop.measured is not None:
        return shapes_of(loop).margins(gains, loop.plant.delay_s, loop.plant.lag_s)
    plant = loop.plant
    return loop_margins(
        plant.theta1,
        plant.theta2,
        **vars(gains),
        period_s=loop.period_s,
        delay_s=plant.delay_s,
        lag_s=plant.lag_s,
    )


def keeps(margins: LoopMargins, wanted: MarginsWanted) -> bool:
    """Return whether a loop is stable and has the phase and gain margins that are wanted."""
    gain = min(margins.gain_margin or math.inf, 1.0 / (margins.gain_reduction or 1e-9))
    phase = margins.phase_margin_deg
    firm = phase is not None and phase >= wanted.phase_deg
    return margins.stable and firm and gain >= wanted.gain


def _error(candidate: Candidate) -> float:
    return candidate.prediction.eF_m


class _Search:
    def __init__(self, loop: RecordedLoop, wanted: MarginsWanted) -> None:
        self._loop, self._wanted = loop, wanted
        self._kept = replace(
            wanted, phase_deg=wanted.phase_deg + SPARE_DEG, gain=wanted.gain * SPARE_GAIN
        )
        self._shapes = shapes_of(loop)
        self._predictor = Predictor(loop)
        self._nyquist = math.pi / loop.period_s

    def first_pass(
        self,
        progress: Callable[[float], None],
        own: CommandFilter | None,
        per_decade: int = ZEROS_PER_DECADE,
        least: MarginsWanted = ANY_MARGINS,
    ) -> list[Candidate]:
        """Try the whole grid with a filter; return what is stable with these margins at least."""
        k1s = _log_grid(SLOWEST_K1 * self._nyquist, FASTEST_K1 * self._nyquist, per_decade)
        k2s = _log_grid(SLOWEST_K2 * self._nyquist, FASTEST_K1 * self._nyquist, per_decade)
        middle = self._loop.plant.theta1 * FASTEST_K1 * self._nyquist
        octaves = np.arange(-GAIN_OCTAVES * GAINS_PER_OCTAVE, 2 * GAINS_PER_OCTAVE + 1)
        ks = middle * 2.0 ** (octaves / GAINS_PER_OCTAVE)
        found: list[Candidate] = []
        for number, k1 in enumerate(k1s):
            progress(number / len(k1s))
            for k2 in k2s[k2s <= k1 * (1.0 + 1e-9)]:
                found += self._stable(float(k1), float(k2), ks, own, least)
        return found

    def near(self, gains: LoopGains, decades: float) -> list[Candidate]:
        """Try gains around some; return those that keep everything."""
        k2 = gains.gamma_d / gains.ks_v_s_m
        steps = 10.0 ** (decades * np.arange(-2, 3))
        ks = gains.ks_v_s_m * 10.0 ** (decades * np.linspace(-2.0, 2.0, 13))
        found: list[Candidate] = []
        for k1_by in steps:
            for k2_by in steps:
                found += self._stable(
                    float(gains.k1_1_s * k1_by),
                    float(k2 * k2_by),
                    ks,
                    gains.command_filter,
                    self._kept,
                )
        return [candidate for candidate in found if self.keeps(candidate)]

    def as_written(self, best: Candidate) -> Candidate:
        """Return the gains as they are written, rounded; a little lower until exactly all is kept.

        Raises RunError where that does not help.
        """
        gains = best.gains
        for _ in range(MOST_STEPS_BACK):
            rounded = replace(
                gains,
                k1_1_s=_rounded(gains.k1_1_s),
                ks_v_s_m=_rounded(gains.ks_v_s_m),
                gamma_d=_rounded(gains.gamma_d),
            )
            told = margins_of(self._loop, rounded)
            if told.stable and self._shapes.stable_everywhere(rounded):
                exact = Candidate(
                    rounded,
                    told.phase_margin_deg or 0.0,
                    min(told.gain_margin or math.inf, 1.0 / (told.gain_reduction or 1e-9)),
                    self._predictor.predict(rounded),
                )
                if not self._broken(exact, self._wanted):
                    return exact
            gains = replace(
                gains, ks_v_s_m=gains.ks_v_s_m * STEP_BACK, gamma_d=gains.gamma_d * STEP_BACK
            )
        raise RunError(
            f"axis {self._loop.axis}: gains near {best.gains} do not keep the margins exactly; ask "
            "for a little less"
        )

    def keeps(self, candidate: Candidate) -> bool:
        """Return whether a stable candidate keeps everything that is wanted."""
        return not self._broken(candidate, self._kept)

    def kept_behind(self, own: CommandFilter) -> list[Candidate]:
        """Return what keeps everything behind a filter, by a coarse grid."""
        found = self.first_pass(lambda share: None, own, FILTER_ZEROS_PER_DECADE, self._kept)
        return [candidate for candidate in found if self.keeps(candidate)]

    def least(self, kept: list[Candidate]) -> Candidate | None:
        """Return the one of least error that bears a resonance beside its filter; None: none."""
        ranked = sorted(kept, key=_error)
        return next((each for each in ranked if self.bears_a_detuned_filter(each)), None)

    def best(self, kept: list[Candidate]) -> Candidate:
        """Return the one of least error; of those that are as good, that of the largest margin."""
        least = self.least(kept)
        assert least is not None  # they come of one that bears it
        good = [c for c in kept if _error(c) <= (1.0 + AS_GOOD) * _error(least)]
        firmest = sorted(good, key=lambda candidate: -candidate.phase_deg)
        return next(each for each in firmest if self.bears_a_detuned_filter(each))

    def bears_a_detuned_filter(self, candidate: Candidate) -> bool:
        """Return whether the loop stays stable where the filter is beside the resonance."""
        own, gains = candidate.gains.command_filter, candidate.gains
        if own is None:
            return True
        moved = (
            command_filter(
                own.kind, own.frequency_hz * by, own.damping, own.depth, self._loop.period_s
            )
            for by in (1.0 - DETUNED, 1.0 + DETUNED)
        )
        return all(
            self._shapes.stable_everywhere(replace(gains, command_filter=each)) for each in moved
        )

    def bound_by(self, best: Candidate) -> str:
        """Say which limits gains a little larger would break."""
        words: list[str] = []
        for k1_by, ks_by, k2_by in ((1.0, 1.1, 1.0), (1.1, 1.0, 1.0), (1.0, 1.0, 1.1)):
            gains = LoopGains(
                best.gains.k1_1_s * k1_by,
                best.gains.ks_v_s_m * ks_by,
                best.gains.gamma_d * ks_by * k2_by,
                best.gains.command_filter,
            )
            k2 = gains.gamma_d / gains.ks_v_s_m
            if self._predictor.predict(gains).eF_m > (1.0 - WORTH) * _error(best):
                continue  # nobody would go there
            further = self._stable(
                gains.k1_1_s, k2, np.array([gains.ks_v_s_m]), gains.command_filter
            )
            words += (
                self._broken(further[0], self._kept) if further else [self._corner_words(gains)]
            )
        return ", ".join(dict.fromkeys(words)) or "nothing: further gains would not lower the error"

    def why_none(self, found: list[Candidate]) -> str:
        """Say why no gains keep everything."""
        wanted, loop = self._wanted, self._loop
        begin = (
            f"axis {loop.axis}: no gains keep a phase margin of {wanted.phase_deg:g} degrees, a "
            f"gain margin of {20.0 * math.log10(wanted.gain):.3g} dB and "
            f"{wanted.command_noise_v or math.inf:.3g} V rms of noise in the command"
        )
        if not found:
            low, high = loop.plant.theta1_bounds
            unit = loop.units.words("V*s^2/m")
            return (
                f"{begin}: none are stable at every corner of the bounds, inertia {low:g} to "
                f"{high:g} {unit}; narrower bounds allow more: `motorctl refine` writes what a "
                "recording tells"
            )
        widest = max(candidate.phase_deg for candidate in found)
        calmest = min(candidate.prediction.command_noise_v for candidate in found)
        stillest = min(candidate.prediction.d0_hat_v for candidate in found)
        in_the_way = Counter(words for each in found for words in self._broken(each, self._kept))
        return (
            f"{begin}, and d0_hat within {loop.d_hat_max_v:g} V: of {len(found)} stable ones most "
            f"fail by {in_the_way.most_common(1)[0][0]}; the best phase margin is {widest:.3g} "
            f"degrees, the least noise {calmest:.3g} V, the least d0_hat {stillest:.3g} V. The "
            f"command is {loop.plant.delay_s * 1e3:.3g} ms late; ask for less"
        )

    def _stable(
        self,
        k1: float,
        k2: float,
        ks: Array,
        own: CommandFilter | None,
        least: MarginsWanted = ANY_MARGINS,
    ) -> list[Candidate]:
        shape = self._shapes.shape(k1, k2, ks, own)
        found = []
        for index in shape.keeping(least):
            gains = shape.gains(int(index))
            if self._shapes.stable_everywhere(gains):
                found.append(
                    Candidate(
                        gains,
                        float(shape.phase_deg[index]),
                        float(min(shape.gain[index], shape.reduction[index])),
                        self._predictor.predict(gains),
                    )
                )
        return found

    def _broken(self, candidate: Candidate, wanted: MarginsWanted) -> list[str]:
        """Name what a stable candidate does not keep."""
        told = candidate.prediction
        broken = []
        if candidate.phase_deg < wanted.phase_deg:
            broken.append("the phase margin")
        if candidate.gain < wanted.gain:
            broken.append("the gain margin")
        most_v = wanted.command_noise_v
        if most_v is not None and told.command_noise_v > most_v:
            broken.append("the noise of the command")
        if told.d0_hat_v > self._loop.d_hat_max_v:
            broken.append("d_hat_max_v")
        return broken

    def _corner_words(self, gains: LoopGains) -> str:
        if self._shapes.crosses_beyond(gains):
            return "the band of the measured response"
        corners = self._loop.plant.at_bounds
        unstable = [corners[number] for number in self._shapes.unstable_corners(gains)]
        if not unstable:
            return "stability"
        theta1, theta2 = unstable[0]
        return self._loop.units.words(
            f"stability with parameters at their bounds, inertia {theta1:g} V*s^2/m and viscous "
            f"friction {theta2:g} V*s/m"
        )


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _log_grid(low: float, high: float, per_decade: int) -> Array:
    steps = math.ceil(per_decade * math.log10(high / low))
    return np.geomspace(low, high, steps + 1)
