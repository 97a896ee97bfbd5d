"""Gains on a grid, and which of them keep the margins.

The law's feedback part is ks (s + k1)(s + k2)/s with k2 = gamma_d/ks: two zeros and a gain. For
each pair of zeros one response tells the margins of every gain, for the open loop is proportional
to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import DelayedPlant, Frequencies, LoopGains, is_stable

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

GRID = 800
"""Frequencies of a response, evenly over its logarithm. Fewer step over a crossing, more takes
time; the margins of what is chosen are computed anew."""
SLOWEST = 1e-4
"""Lowest frequency of a response, as a part of the Nyquist frequency. Higher overlooks crossings of
slow loops, lower spends the grid where nothing crosses."""


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
        return LoopGains(self.k1_1_s, ks, ks * self.k2_1_s)

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
    """

    def __init__(self, plant: DelayedPlant, corners: Sequence[DelayedPlant]) -> None:
        nyquist = math.pi / plant.period_s
        self._w = np.geomspace(SLOWEST * nyquist, 0.9999 * nyquist, GRID)
        self._plant = plant.response(self._w)
        self._at = Frequencies.at(self._w, plant.period_s)
        self._everywhere = (plant, *corners)

    def shape(self, k1_1_s: float, k2_1_s: float, ks_v_s_m: Array) -> Shape:
        """Return the margins of a pair of zeros [1/s] at some gains [V s/m]."""
        once = LoopGains(k1_1_s, 1.0, k2_1_s).feedback(self._at) * self._plant
        log_size, angle = np.log(np.abs(once)), np.unwrap(np.angle(once))
        grow, shrink = _gain_margins(once, ks_v_s_m)
        phase = np.array([_phase_margin(log_size + math.log(ks), angle) for ks in ks_v_s_m])
        return Shape(k1_1_s, k2_1_s, ks_v_s_m, phase, grow, shrink)

    def stable_everywhere(self, gains: LoopGains) -> bool:
        """Return whether the loop is stable with the plant and at all corners of its bounds."""
        return all(is_stable(plant, gains) for plant in self._everywhere)

    def unstable_corners(self, gains: LoopGains) -> Iterator[int]:
        """Yield the numbers of the corners, from 0, with which the loop is unstable."""
        for number, plant in enumerate(self._everywhere[1:]):
            if not is_stable(plant, gains):
                yield number


def _phase_margin(log_size: Array, angle: Array) -> float:
    """Return the smallest phase margin over the frequencies at which the size is 1 [degrees]."""
    at = np.flatnonzero(np.signbit(log_size[:-1]) != np.signbit(log_size[1:]))
    if not len(at):
        return math.nan
    share = log_size[at] / (log_size[at] - log_size[at + 1])
    crossing = np.degrees(angle[at] + share * (angle[at + 1] - angle[at]))
    margins = (crossing + 180.0 + 180.0) % 360.0 - 180.0
    return float(margins[np.argmin(np.abs(margins))])


def _gain_margins(once: ComplexArray, ks: Array) -> tuple[Array, Array]:
    """Return by which factors each gain may grow, and by which it may shrink."""
    imag, real = once.imag, once.real
    at = np.flatnonzero(np.signbit(imag[:-1]) != np.signbit(imag[1:]))
    share = imag[at] / (imag[at] - imag[at + 1])
    crossing = real[at] + share * (real[at + 1] - real[at])
    limits = -1.0 / crossing[crossing < 0.0]  # the gains at which the loop passes -1
    over = limits[None, :] / ks[:, None]
    grow = np.min(np.where(over > 1.0, over, np.inf), axis=1, initial=np.inf)
    shrink = np.min(np.where(over <= 1.0, 1.0 / over, np.inf), axis=1, initial=np.inf)
    return grow, shrink
