"""Shapes that several terms share: harmonics, tabulated profiles, a hysteresis."""

from __future__ import annotations

import math
from typing import Any

from motorctl.hal import inner_kernel
from motorctl_sim.physics.plant_records import PROFILE_CELLS


@inner_kernel
def harmonics(series: Any, x: float) -> float:
    """Sum amplitude sin(wave_number x + phase); `series` is a record of HARMONICS."""
    total = 0.0
    for k in range(series.count):
        total += series.amplitude[k] * math.sin(series.wave_number[k] * x + series.phase[k])
    return total


@inner_kernel
def profile(table: Any, x: float) -> float:
    """Interpolate a record of PROFILE by cubic Hermite polynomials; constant beyond its ends."""
    if table.cells_per_m == 0.0:
        return 0.0
    place = (x - table.start) * table.cells_per_m
    if not place >= 0.0:  # no number has no cell either
        place = 0.0
    place = min(place, float(PROFILE_CELLS))
    cell = min(int(place), PROFILE_CELLS - 1)
    s = place - cell
    y0, m0 = table.nodes[cell, 0], table.nodes[cell, 1]
    y1, m1 = table.nodes[cell + 1, 0], table.nodes[cell + 1, 1]
    rise = y1 - y0
    bent = 3.0 * rise - 2.0 * m0 - m1 + s * (m0 + m1 - 2.0 * rise)
    return float(y0 + s * (m0 + s * bent))


@inner_kernel
def dahl(h: float, moved: float, length: float) -> float:
    """Advance h, in -1 to 1, over a motion: dh/dx = (sgn - h)/length, exactly.

    Dahl (1968) with exponent 1; the energy lost depends on the path, not on its speed.
    """
    if moved == 0.0:
        return h
    target = math.copysign(1.0, moved)
    return target + (h - target) * math.exp(-abs(moved) / length)
