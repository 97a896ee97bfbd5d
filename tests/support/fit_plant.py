"""A simulated axis for the tests of identification, written apart from the model's kernels.

Fine-step integration of  theta1 a = f(u) - theta2 v - theta3 (2/pi) atan(slope v) + theta4 + w,
f(u) = u + theta5 u|u| + theta6 u^3, under a sampled controller with zero-order hold and delay.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from motorctl.identify.columns.measured import Measured
from motorctl.model import EffectList, effect_class, make_effect

COGGING_PITCH_M = 0.05
X_THETA = (0.197, 0.2265, 0.139, 0.012, -0.0122, -0.00104)
"""Inertia, viscous, Coulomb, offset, quadratic and cubic part of the published gantry's X."""


@dataclass(frozen=True)
class Run:
    """What a simulated run leaves, arrays of shape (N,)."""

    rate_hz: float
    time_s: np.ndarray
    position: np.ndarray
    command: np.ndarray
    reference: np.ndarray
    reference_velocity: np.ndarray
    reference_acceleration: np.ndarray

    def measured(self, **changes):
        """Hand it to the identification, with some of its fields replaced."""
        given = {
            "source": "run.csv",
            "axis": "x",
            "sample_rate_hz": self.rate_hz,
            "time_s": self.time_s,
            "position": self.position,
            "command": self.command,
            "usable": np.ones(len(self.position), dtype=bool),
            "reference": self.reference,
            "reference_velocity": self.reference_velocity,
        }
        return Measured(**given | changes)


def model_of(*names):
    """Make a list of known effects with their default options."""
    return EffectList([make_effect(effect_class(name)) for name in names])


C1 = model_of("inertia", "viscous_friction", "coulomb_friction", "offset")
C2 = model_of(*C1.names, "em_quadratic", "em_cubic")


def input_map(theta, u):
    """Return v(u) = u + theta5 u|u| + theta6 u^3."""
    return u + theta[4] * u * np.abs(u) + theta[5] * u**3


def simulate(
    *,
    theta=X_THETA,
    rate_hz=5000.0,
    duration_s=12.0,
    delay_samples=0.46,
    resolution=0.5e-6,
    slope=900.0,
    force_noise=0.0,
    cogging=0.0,
    peak_acceleration=40.0,
    peak_velocity=1.0,
    travel=0.4,
    limit=10.0,
    seed=0,
    substeps=8,
):
    """Follow random point-to-point moves in closed loop and record what a drive would."""
    period = 1.0 / rate_hz
    rng = np.random.default_rng(seed)
    reference = random_moves(rng, duration_s, rate_hz, peak_acceleration, peak_velocity, travel)
    theta = np.array([*theta, *([0.0] * (6 - len(theta)))])
    force = force_noise * rng.standard_normal(len(reference[0]))
    # a quick loop for the plant's own scale, slow enough for its sample rate
    bandwidth = min(250.0, 0.05 * rate_hz)
    feedforward = theta.copy()
    feedforward[0] *= 0.9
    feedforward[4:] *= 0.5
    y, u = _closed_loop(
        *reference, force, theta, feedforward, slope, period, delay_samples, resolution, bandwidth,
        limit, substeps, cogging,
    )  # fmt: skip
    time = np.arange(len(y)) * period
    return Run(rate_hz, time, y, u, *reference)


def random_moves(rng, duration_s, rate_hz, peak_acceleration, peak_velocity, travel):
    """Join quintic moves between random places, with rests between them."""
    count = int(duration_s * rate_hz)
    x, v, a = np.zeros(count), np.zeros(count), np.zeros(count)
    k = int(0.1 * rate_hz)
    here = 0.0
    while k < count:
        there = rng.uniform(0.0, travel)
        span = there - here
        length = max(
            math.sqrt(5.7735 * abs(span) / (peak_acceleration * rng.uniform(0.2, 1.0))),
            1.875 * abs(span) / peak_velocity,
            20.0 / rate_hz,
        )
        n = int(length * rate_hz)
        s = np.arange(n) / (length * rate_hz)
        stop = min(k + n, count)
        part = s[: stop - k]
        x[k:stop] = here + span * part**3 * (10 - 15 * part + 6 * part**2)
        v[k:stop] = span / length * 30 * part**2 * (1 - part) ** 2
        a[k:stop] = span / length**2 * 60 * part * (1 - part) * (1 - 2 * part)
        rest = min(stop + int(rng.uniform(0.02, 0.2) * rate_hz), count)
        x[stop:rest] = there
        here, k = there, rest
    return x, v, a


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


@njit
def _closed_loop(
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
                w = force[k] + cogging * math.sin(2.0 * math.pi * x / COGGING_PITCH_M)
                # classical Runge-Kutta over one substep of constant command
                a1 = _acceleration(v, command, w, theta, slope)
                a2 = _acceleration(v + 0.5 * h * a1, command, w, theta, slope)
                a3 = _acceleration(v + 0.5 * h * a2, command, w, theta, slope)
                a4 = _acceleration(v + h * a3, command, w, theta, slope)
                x += h * v + h * h * (a1 + a2 + a3) / 6.0
                v += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
    return y, u
