"""A motion that is a sum of sines of equal speed and random phases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sum_of_sines(seed: int, time_s: Array, lines_hz: Array, each_m_s: float) -> tuple[Array, Array]:
    """Return position [m] and speed [m/s], (N,), of sines that move so fast each."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(lines_hz))
    waves = 2.0 * np.pi * np.outer(lines_hz, time_s) + phases[:, None]
    position = each_m_s * np.sum(np.sin(waves) / lines_hz[:, None], axis=0) / (2.0 * np.pi)
    return position, each_m_s * np.cos(waves).sum(axis=0)
