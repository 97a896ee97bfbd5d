"""Alignment of the held command with the differenced position.

The amplifier holds u_k from tick k to tick k + 1 (zero-order hold), d samples later where
there is an input delay. A second difference of positions around tick k is the acceleration
averaged with a triangle of half-width one period, so the command that belongs to it is the held
command averaged with the same triangle: (u_k + u_{k-1})/2 without delay, and for 0 <= d <= 1

    (1 - d)^2/2 u_k + (1/2 + d - d^2) u_{k-1} + d^2/2 u_{k-2}.

This is linear in u; for a nonlinear term it holds of h(u_k), formed before. A positive delay
means that the command acts later than the tick in which it was written.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Taps:
    """A short filter: the sum of weights[i] u_{k - lags[i]}."""

    lags: NDArray[np.int64]
    weights: Array


def hold_taps(delay_samples: float, half_width: int) -> Taps:
    """Weigh the held commands that act within the triangle around a tick.

    `half_width` of the triangle is in samples: 1 for a second difference, 2 for a central
    difference taken twice.
    """
    first = math.ceil(delay_samples - half_width) - 1
    last = math.floor(delay_samples + half_width) + 1
    lags = np.arange(first, last + 1, dtype=np.int64)
    edges = delay_samples - np.append(lags, last + 1) + 1.0
    area = _triangle_area(edges / half_width)
    weights = area[:-1] - area[1:]
    used = weights > 0.0
    return Taps(lags[used], weights[used])


def sample_taps(delay_samples: float) -> Taps:
    """Take the command at its tick, with no regard to the hold; between ticks interpolated."""
    whole = math.floor(delay_samples)
    part = delay_samples - whole
    if part == 0.0:
        return Taps(np.array([whole], dtype=np.int64), np.array([1.0]))
    return Taps(np.array([whole, whole + 1], dtype=np.int64), np.array([1.0 - part, part]))


def _triangle_area(s: Array) -> Array:
    """Integrate the triangle max(0, 1 - |s|) from minus infinity."""
    s = np.clip(s, -1.0, 1.0)
    return np.where(s < 0.0, 0.5 * (1.0 + s) ** 2, 1.0 - 0.5 * (1.0 - s) ** 2)
