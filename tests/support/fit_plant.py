"""A simulated axis for the tests of identification, written apart from the model's kernels.

Fine-step integration of  theta1 a = f(u) - theta2 v - theta3 (2/pi) atan(slope v) + theta4 + w,
f(u) = u + theta5 u|u| + theta6 u^3, under a sampled controller with zero-order hold and delay.
"""

import math
from dataclasses import dataclass

import numpy as np

from motorctl.identify.columns.measured import Measured
from motorctl.kernels import kernels_cached
from motorctl.model import EffectList, effect_class, make_effect

with kernels_cached():
    from plant_kernels.fit import closed_loop

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
    y, u = closed_loop(
        *reference, force, theta, feedforward, slope, period, delay_samples, resolution, bandwidth,
        limit, substeps, cogging, COGGING_PITCH_M,
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
