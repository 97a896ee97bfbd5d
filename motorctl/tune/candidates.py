"""Gains on a grid, and which of them keep the margins.

The law's feedback part is ks (s + k1)(s + k2)/s with k2 = gamma_d/ks: two zeros and a gain. For
each pair of zeros one response tells the margins of every gain, for the open loop is proportional
to it.

Around a plant that was measured, each margin is what is left of it where the plant is as far off as
its error: at a crossing, e of the loop's size turn it by arcsin(e), and make it 1 + e larger.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import (
    DelayedPlant,
    Frequencies,
    LoopGains,
    LoopMargins,
    is_stable,
    sign_changes,
)
from motorctl.control import CommandFilter

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

GRID = 800
"""Frequencies of a response, evenly over its logarithm. Fewer step over a crossing, more takes
time; the margins of what is chosen are computed anew."""
SLOWEST = 1e-4
"""Lowest frequency of a response, as a part of the Nyquist frequency. Higher overlooks crossings of
slow loops, lower spends the grid where nothing crosses."""


class KnownPlant(Protocol):
    """A plant whose response is known frequency by frequency, as it is where it was measured."""

    @property
    def rigid(self) -> DelayedPlant:
        """It without the parts that ring."""

    @property
    def band_hz(self) -> tuple[float, float]:
        """From where to where it is known [Hz]."""

    def frequencies(self, w: Array) -> Array:
        """Return frequencies [rad/s] with those besides that a grid of them may step over."""

    def response(self, w: Array) -> ComplexArray:
        """Return the transfer from command to position [m/V] at frequencies w [rad/s], (n,)."""

    def error(self, w: Array) -> Array:
        """Return the relative error that margins bear there, (n,)."""


@dataclass(frozen=True)
class MarginsWanted:
    """What a loop must keep."""

    phase_deg: float
    """Phase margin [degrees]."""
    gain: float
    """The loop gain may grow and shrink by this factor."""
    command_noise_v: float | None = None
    """Noise of the command at rest, at most [V rms]; None: any."""


@dataclass(frozen=True)
class Shape:
    """The margins of one pair of zeros at many gains."""

    k1_1_s: float
    k2_1_s: float
    command_filter: CommandFilter | None
    ks_v_s_m: Array
    """(m,) gains ks that were looked at [V s/m]."""
    phase_deg: Array
    """(m,) phase margins [degrees]; NaN where the loop does not cross 1."""
    gain: Array
    """(m,) factors by which the loop gain may grow; inf: by any."""
    reduction: Array
    """(m,) factors by which it may shrink; inf: by any."""

    def gains(self, index: int) -> LoopGains:
        """Return the gains of one of them."""
        ks = float(self.ks_v_s_m[index])
        return LoopGains(self.k1_1_s, ks, ks * self.k2_1_s, self.command_filter)

    def keeping(self, wanted: MarginsWanted) -> NDArray[np.intp]:
        """Return the indices of the gains that keep the margins, not looking at the noise."""
        good = (
            (self.phase_deg >= wanted.phase_deg)
            & (self.gain >= wanted.gain)
            & (self.reduction >= wanted.gain)
        )
        return np.flatnonzero(good)


class LoopShapes:
    """Shapes of the loop around one plant.

    Parameters
    ----------
    plant
        The plant as it was identified.
    corners
        Plants with which the loop must be stable.
    measured
        The plant as it was measured, in place of `plant`.
    """

    def __init__(
        self,
        plant: DelayedPlant,
        corners: Sequence[DelayedPlant],
        measured: KnownPlant | None = None,
    ) -> None:
        nyquist = math.pi / plant.period_s
        self._w = np.geomspace(SLOWEST * nyquist, 0.9999 * nyquist, GRID)
        self._measured = measured
        if measured is None:
            self._plant, self._error = plant.response(self._w), np.zeros(len(self._w))
            self._highest_rad_s = math.inf
        else:
            plant = measured.rigid
            self._w = measured.frequencies(self._w)
            self._plant, self._error = measured.response(self._w), measured.error(self._w)
            self._highest_rad_s = 2.0 * math.pi * measured.band_hz[1]
        self._rigid = plant.response(self._w)
        self._at = Frequencies.at(self._w, plant.period_s)
        self._everywhere = (plant, *corners)

    def shape(
        self, k1_1_s: float, k2_1_s: float, ks_v_s_m: Array, own: CommandFilter | None = None
    ) -> Shape:
        """Return the margins of a pair of zeros [1/s] at some gains [V s/m], behind a filter."""
        once = LoopGains(k1_1_s, 1.0, k2_1_s, own).feedback(self._at) * self._plant
        log_size, angle = np.log(np.abs(once)), np.unwrap(np.angle(once))
        grow, shrink = _gain_margins(once, ks_v_s_m, self._error)
        phase = np.array([self._phase(log_size + math.log(ks), angle)[0] for ks in ks_v_s_m])
        return Shape(k1_1_s, k2_1_s, own, ks_v_s_m, phase, grow, shrink)

    def margins(self, gains: LoopGains, delay_s: float, lag_s: float) -> LoopMargins:
        """Return the margins of some gains from the same frequencies; delay and lag are told."""
        once = gains.feedback(self._at) * self._plant
        phase, crossover = self._phase(np.log(np.abs(once)), np.unwrap(np.angle(once)))
        grow, shrink = (float(each[0]) for each in _gain_margins(once, np.ones(1), self._error))
        return LoopMargins(
            delay_s=delay_s,
            lag_s=lag_s,
            stable=is_stable(self._everywhere[0], gains) and self._rings_out(gains),
            crossover_rad_s=None if math.isnan(crossover) else crossover,
            phase_margin_deg=None if math.isnan(phase) else phase,
            gain_margin=None if math.isinf(grow) else grow,
            gain_reduction=None if math.isinf(shrink) else 1.0 / shrink,
        )

    def stable_everywhere(self, gains: LoopGains) -> bool:
        """Return whether the loop is stable with the plant and at all corners of its bounds."""
        return all(is_stable(plant, gains) for plant in self._everywhere) and self._rings_out(gains)

    def crosses_beyond(self, gains: LoopGains) -> bool:
        """Return whether the loop is above 1 where no measured line tells the plant."""
        size = np.abs(gains.feedback(self._at) * self._plant)
        return bool(np.any(size[self._w > self._highest_rad_s] >= 1.0))

    def _rings_out(self, gains: LoopGains) -> bool:
        """Return whether the loop that is stable around the rigid plant is so around the measured.

        Parts on springs add no unstable poles to the open loop, so by Nyquist's criterion both are
        alike where one return difference over the other does not go round 0.
        """
        if self._measured is None:
            return True
        feedback = gains.feedback(self._at)
        over = (1.0 + feedback * self._plant) / (1.0 + feedback * self._rigid)
        turned = np.unwrap(np.angle(over))
        return bool(abs(turned[-1] - turned[0]) < math.pi)

    def _phase(self, log_size: Array, angle: Array) -> tuple[float, float]:
        """Return phase margin [degrees] and where it is [rad/s]; NaN where nothing crosses, or
        where it does beyond what was measured."""
        if np.any(log_size[self._w > self._highest_rad_s] >= 0.0):
            return math.nan, math.nan
        return _phase_margin(log_size, angle, self._error, self._w)

    def unstable_corners(self, gains: LoopGains) -> Iterator[int]:
        """Yield the numbers of the corners, from 0, with which the loop is unstable."""
        for number, plant in enumerate(self._everywhere[1:]):
            if not is_stable(plant, gains):
                yield number


def _phase_margin(log_size: Array, angle: Array, error: Array, w: Array) -> tuple[float, float]:
    """Return the smallest phase margin over the frequencies at which the size is 1 [degrees].

    Less what the plant's relative error turns the loop by; and where that is [rad/s].
    """
    at, share = sign_changes(log_size)
    if not len(at):
        return math.nan, math.nan
    crossing = np.degrees(angle[at] + share * (angle[at + 1] - angle[at]))
    margins = (crossing + 180.0 + 180.0) % 360.0 - 180.0
    turned = np.degrees(np.arcsin(np.minimum(np.maximum(error[at], error[at + 1]), 1.0)))
    worst = int(np.argmin(np.abs(margins) - turned))
    left = abs(float(margins[worst])) - float(turned[worst])
    return (left if margins[worst] >= 0.0 else -left), float(w[at[worst]])


def _gain_margins(once: ComplexArray, ks: Array, error: Array) -> tuple[Array, Array]:
    """Return by which factors each gain may grow, and by which it may shrink.

    Less what the plant's relative error may have made of it already.
    """
    imag, real = once.imag, once.real
    at, share = sign_changes(imag)
    crossing = real[at] + share * (real[at + 1] - real[at])
    limits = -1.0 / crossing[crossing < 0.0]  # the gains at which the loop passes -1
    spare = 1.0 + np.maximum(error[at], error[at + 1])[crossing < 0.0]
    over = limits[None, :] / ks[:, None]
    grow = np.min(np.where(over > 1.0, over / spare, np.inf), axis=1, initial=np.inf)
    shrink = np.min(np.where(over <= 1.0, 1.0 / over / spare, np.inf), axis=1, initial=np.inf)
    return grow, shrink
