"""An axis with one effect that motorctl does not have, simulated apart from all kernels."""

from __future__ import annotations

import math

import numpy as np
from fit_plant import Run, random_moves
from numba import njit

from motorctl.errors import DataError

NOTHING, ZONE, CREEP, HALVES, CORE, MAGNET, CURRENT, JOINT, KNEE = range(9)
RATE_HZ = 4000.0
RESOLUTION_M = 0.5e-6
LIMIT_V = 10.0
SUBSTEPS = 10
SLOPE_S_M = 900.0
BASE = (0.197, 0.2265, 0.139, 0.012)
"""Inertia, viscous and Coulomb friction, offset."""


def run(kind: int, numbers: tuple[float, ...] = (), *, duration_s: float, seed: int) -> Run:
    """Follow random moves in closed loop.

    Parameters
    ----------
    kind
        What the axis has beside BASE.
    numbers
        What describes it, in SI units and volts; see `_closed_loop`.
    duration_s, seed
        Of the moves.
    """
    reference = random_moves(np.random.default_rng(seed), duration_s, RATE_HZ, 35.0, 1.0, 0.4)
    bandwidth = 100.0 if kind == CURRENT else 200.0
    own = np.array([*numbers, *([0.0] * (3 - len(numbers)))])
    y, u = _closed_loop(*reference, kind, own, bandwidth)
    if not np.isfinite(y).all():
        raise DataError("the simulated axis ran away")
    return Run(RATE_HZ, np.arange(len(y)) / RATE_HZ, y, u, *reference)


@njit
def _drive(u, x, kind, q, core):
    """What acts of a command that is there."""
    if kind == HALVES:
        return u * (1.0 + q[0]) if u > 0.0 else u * (1.0 - q[0])
    if kind == CORE:
        return u - q[0] * (u - core)
    if kind == MAGNET:
        return u * (1.0 - q[0] * math.exp(-((x - q[1]) ** 2) / q[2] ** 2))
    if kind == KNEE and u > q[2]:
        return u - q[0] * (u - q[2]) ** 2
    if kind == KNEE and u < -q[2]:
        return u + q[1] * (u + q[2]) ** 2
    return u


@njit
def _closed_loop(xd, vd, ad, kind, q, bandwidth):
    """Return what the encoder shows and what was commanded.

    q is: ZONE c, middle, half length - CREEP k, T - HALVES d - CORE q, T - MAGNET g, place, width -
    CURRENT corner [Hz], dead time in its periods - JOINT shift, place, width - KNEE p, q, knee.
    """
    n, h = len(xd), 1.0 / RATE_HZ / SUBSTEPS
    y, u = np.zeros(n), np.zeros(n)
    inertia, viscous, coulomb, offset = BASE
    x, v, before, stretch, core, current = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        shown = x
        if kind == JOINT:
            shown += q[0] * math.tanh((x - q[1]) / q[2])
        y[k] = np.round(shown / RESOLUTION_M) * RESOLUTION_M
        if k == 0:
            before = y[0]
        e, de = y[k] - xd[k], (y[k] - before) * RATE_HZ - vd[k]
        before = y[k]
        asked = inertia * ad[k] + viscous * vd[k] - offset
        asked += coulomb * 2.0 / math.pi * math.atan(SLOPE_S_M * vd[k])
        asked -= 2.0 * bandwidth * inertia * (de + 0.5 * bandwidth * e)
        u[k] = min(max(asked, -LIMIT_V), LIMIT_V)
        for part in range(SUBSTEPS):
            acts = u[k]
            if kind == CURRENT:
                at = k + (part + 0.5) / SUBSTEPS - q[1] / q[0] * RATE_HZ
                dead = u[math.floor(at)] if at >= 0.0 else 0.0
                decay = math.exp(-h * 2.0 * math.pi * q[0])
                acts = dead + (current - dead) * (1.0 - decay) / (h * 2.0 * math.pi * q[0])
                current = dead + (current - dead) * decay
            # the midpoint rule over one substep of constant command
            v0, x0, half = v, x, 0.5 * h
            for step in (half, h):
                pulls = viscous * v + coulomb * 2.0 / math.pi * math.atan(SLOPE_S_M * v) - offset
                if kind == ZONE:
                    # it ends within two millimetres
                    pulls += q[0] * v * min(max(0.5 + (q[2] - abs(x - q[1])) / 2e-3, 0.0), 1.0)
                if kind == CREEP:
                    pulls += q[0] * stretch
                a = (_drive(acts, x, kind, q, core) - pulls) / inertia
                speed = v
                x, v = x0 + step * speed, v0 + step * a
            if kind == CREEP:
                stretch = stretch * math.exp(-h / q[1]) + (x - x0)
        if kind == CORE:
            core = u[k] + (core - u[k]) * math.exp(-1.0 / RATE_HZ / q[1])
    return y, u
