"""Whether a recording is one move again and again: then all that happens repeats with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 0.01
LEAST_PERIOD_S = 0.3
FEWEST_PERIODS = 3
SAME = 0.9
"""Correlation of the velocity with itself a period later."""
MOVING = 0.1
"""Part of the top speed that counts as motion."""
TURNS_OF_ONE = 2.5
"""Turns in a period of one move there and back, at most."""


def period_of(velocity: Array, sample_period_s: float) -> float:
    """Give the period [s] of one move, there and back, that is made again and again; else 0."""
    every = max(1, round(STEP_S / sample_period_s))
    v, step_s = velocity[::every], every * sample_period_s
    lags = np.arange(max(1, int(LEAST_PERIOD_S / step_s)), len(v) // FEWEST_PERIODS)
    if len(lags) < 3 or not v.any():
        return 0.0
    size = 2 * len(v)
    same = np.fft.irfft(np.abs(np.fft.rfft(v, size)) ** 2, size)[: len(v)]
    power = np.cumsum(v**2)
    # the overlapping parts' own energies: first ones without their end, last ones without the start
    energy = np.sqrt(power[len(v) - 1 - lags] * (power[-1] - power[lags - 1]))
    likeness = same[lags] / np.maximum(energy, 1e-300)
    inner = (likeness[1:-1] >= likeness[:-2]) & (likeness[1:-1] >= likeness[2:])
    again = np.flatnonzero(inner & (likeness[1:-1] > SAME)) + 1
    if len(again) == 0:
        return 0.0
    left, peak, right = likeness[again[0] - 1 : again[0] + 2]
    bend = left - 2.0 * peak + right
    offset = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    period_s = float((lags[again[0]] + offset) * step_s)
    way = np.sign(np.where(np.abs(v) > MOVING * np.abs(v).max(), v, 0.0))
    turns = int(np.sum(np.diff(way[way != 0.0]) != 0.0))
    return period_s if turns * period_s < TURNS_OF_ONE * len(v) * step_s else 0.0
