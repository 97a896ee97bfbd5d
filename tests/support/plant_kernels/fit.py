"""The axis of `fit_plant` under its controller, sample by sample."""

import math

import numpy as np
from numba import njit


@njit
def _acceleration(v, u, w, theta, slope):
    drive = u + theta[4] * u * abs(u) + theta[5] * u**3
    friction = theta[1] * v + theta[2] * 2.0 / math.pi * math.atan(slope * v)
    return (drive - friction + theta[3] + w) / theta[0]


@njit
def _invert(v, theta, limit):
    """Find u with v = u + theta5 u|u| + theta6 u^3 by bisection."""
    low, high = -limit, limit
    for _ in range(40):
        middle = 0.5 * (low + high)
        if middle + theta[4] * middle * abs(middle) + theta[5] * middle**3 < v:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@njit(cache=True)
def closed_loop(
    xd,
    vd,
    ad,
    force,
    theta,
    ff,
    slope,
    period,
    delay,
    resolution,
    bandwidth,
    limit,
    substeps,
    cogging,
    pitch_m,
):
    n = len(xd)
    y, u = np.zeros(n), np.zeros(n)
    x, v, before = 0.0, 0.0, 0.0
    for k in range(n):
        y[k] = np.round(x / resolution) * resolution
        if k == 0:
            before = y[0]
        e, de = y[k] - xd[k], (y[k] - before) / period - vd[k]
        before = y[k]
        drive = ff[0] * ad[k] + ff[1] * vd[k] - ff[3]
        drive += ff[2] * 2.0 / math.pi * math.atan(slope * vd[k])
        drive -= 2.0 * bandwidth * theta[0] * (de + bandwidth * e)
        u[k] = min(max(_invert(drive, ff, limit), -limit), limit)
        # the command of tick j acts from (j + delay) periods on, so it changes once in a period
        whole = math.floor(delay)
        change = delay - whole
        for part in range(2):
            j = k - whole - 1 + part
            command = u[j] if j >= 0 else 0.0
            span = change if part == 0 else 1.0 - change
            h = span * period / substeps
            for _ in range(substeps):
                w = force[k] + cogging * math.sin(2.0 * math.pi * x / pitch_m)
                # classical Runge-Kutta over one substep of constant command
                a1 = _acceleration(v, command, w, theta, slope)
                a2 = _acceleration(v + 0.5 * h * a1, command, w, theta, slope)
                a3 = _acceleration(v + 0.5 * h * a2, command, w, theta, slope)
                a4 = _acceleration(v + h * a3, command, w, theta, slope)
                x += h * v + h * h * (a1 + a2 + a3) / 6.0
                v += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
    return y, u
