"""Margins of the sampled position loop: rigid mass, hold, delay, and the law's feedback part."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRID = 2000
SLOWEST = 1e-5
"""Lowest frequency looked at, as a fraction of the Nyquist frequency."""


@dataclass(frozen=True)
class LoopMargins:
    """How far the loop is from instability; None where the loop has no such crossing."""

    delay_s: float
    lag_s: float
    stable: bool
    crossover_rad_s: float | None
    phase_margin_deg: float | None
    """At the crossover that is nearest to -180 degrees."""
    gain_margin: float | None
    """The loop gain may grow by less than this factor."""
    gain_reduction: float | None
    """The loop gain may shrink to no less than this factor."""


def loop_margins(
    theta1: float,
    theta2: float,
    *,
    k1_1_s: float,
    ks_v_s_m: float,
    gamma_d: float,
    period_s: float,
    delay_s: float = 0.0,
    lag_s: float = 0.0,
    stiffness: float = 0.0,
) -> LoopMargins:
    """Return the margins of the loop around theta1 [V s^2/m], theta2 [V s/m], stiffness [V/m].

    Plant 1/(theta1 s^2 + theta2 s + stiffness) behind a zero-order hold, `delay_s` of any length
    and a first-order lag; controller (ks + gamma_d Ts/(z - 1)) ((z - 1)/(Ts z) + k1), which is what
    law and skew loop run: p with the velocity error by backward difference, -ks p, and the fast
    adaptation of d0 (Chen, Yao, Wang 2013, eqs 11, 18) while it is off its bound and the command
    not saturated.

    Parameters
    ----------
    theta1, theta2
        Inertia [V s^2/m] and viscous friction [V s/m].
    k1_1_s
        Gain k1 of the position error [1/s].
    ks_v_s_m
        Robust gain ks [V s/m].
    gamma_d
        Gain of the fast adaptation [V/m].
    period_s
        Period of the loop, Ts [s].
    delay_s, lag_s
        Dead time and time constant between the command and the force [s]; 0 is none.
    stiffness
        Spring between the plant and the ground [V/m]; 0 is none.

    Returns
    -------
    LoopMargins
        Whether the loop is stable, its crossover [rad/s], phase margin [degrees] and gain margins.
    """
    plant = _DelayedPlant((theta1, theta2, stiffness), period_s, delay_s, lag_s)
    stable = bool(
        np.abs(np.linalg.eigvals(_closed_loop(plant, k1_1_s, ks_v_s_m, gamma_d, period_s))).max()
        < 1.0
    )

    def loop(w: Array) -> NDArray[np.complex128]:
        z = np.exp(1j * w * period_s)
        error = (z - 1.0) / (period_s * z) + k1_1_s
        feedback = ks_v_s_m + gamma_d * period_s / (z - 1.0)
        result: NDArray[np.complex128] = feedback * error * plant.response(w)
        return result

    nyquist = math.pi / period_s
    w = np.geomspace(SLOWEST * nyquist, 0.9999 * nyquist, GRID)
    response = loop(w)

    def log_gain(x: float) -> float:
        return float(np.log(np.abs(loop(np.array([x]))[0])))

    def across(x: float) -> float:
        return float(loop(np.array([x]))[0].imag)

    crossovers = _zeros(w, np.log(np.abs(response)), log_gain)
    margins = [180.0 + math.degrees(np.angle(loop(np.array([x]))[0])) for x in crossovers]
    signed = [m - 360.0 if m > 180.0 else m for m in margins]
    worst = min(range(len(signed)), key=lambda i: abs(signed[i]), default=None)

    real = [float(loop(np.array([x]))[0].real) for x in _zeros(w, response.imag, across)]
    inside = [-1.0 / r for r in real if -1.0 < r < 0.0]
    outside = [-1.0 / r for r in real if r < -1.0]
    return LoopMargins(
        delay_s=delay_s,
        lag_s=lag_s,
        stable=stable,
        crossover_rad_s=None if worst is None else crossovers[worst],
        phase_margin_deg=None if worst is None else signed[worst],
        gain_margin=min(inside, default=None),
        gain_reduction=max(outside, default=None),
    )


class _DelayedPlant:
    """x+ = phi x + late u[k - whole - 1] + prompt u[k - whole]; x is position, velocity, current.

    The current is there only behind a lag.
    """

    def __init__(
        self, balance: tuple[float, float, float], period_s: float, delay_s: float, lag_s: float
    ) -> None:
        self.whole = int(delay_s / period_s)
        part = delay_s - self.whole * period_s
        self._period_s = period_s
        self.phi, prompt = _held(balance, lag_s, period_s - part)
        before, late = _held(balance, lag_s, part)
        self.late = self.phi @ late
        self.prompt = prompt
        self.phi = self.phi @ before

    def response(self, w: Array) -> NDArray[np.complex128]:
        """Return the transfer from command to position at frequencies w [rad/s]."""
        z = np.exp(1j * w * self._period_s)
        drive = (self.late[:, None] / z + self.prompt[:, None]) / z**self.whole
        system = z[:, None, None] * np.eye(len(self.phi)) - self.phi
        result: NDArray[np.complex128] = np.linalg.solve(system, drive.T[:, :, None])[:, 0, 0]
        return result


def _held(
    balance: tuple[float, float, float], lag_s: float, duration_s: float
) -> tuple[Array, Array]:
    """Return transition and input vector of the plant over a held command.

    balance: theta1, theta2 and stiffness.
    """
    from scipy.linalg import expm  # long to load, and the loop never asks

    states = 3 if lag_s else 2
    system = np.zeros((states + 1, states + 1))
    system[0, 1] = 1.0
    theta1, theta2, stiffness = balance
    system[1, :3] = -stiffness / theta1, -theta2 / theta1, 1.0 / theta1
    if lag_s:
        system[2, 2], system[2, 3] = -1.0 / lag_s, 1.0 / lag_s
    full = expm(system * duration_s)
    return full[:states, :states], full[:states, states]


def _closed_loop(
    plant: _DelayedPlant, k1_1_s: float, ks_v_s_m: float, gamma_d: float, period_s: float
) -> Array:
    """Return the transition matrix of [the plant's states, last position, d0, past commands]."""
    states, past = len(plant.phi), plant.whole + 1
    last, d0, first = states, states + 1, states + 2
    size = first + past
    law = np.zeros(size)  # u = law . state
    p = np.zeros(size)
    p[0], p[last] = 1.0 / period_s + k1_1_s, -1.0 / period_s
    law -= ks_v_s_m * p
    law[d0] = -1.0
    matrix = np.zeros((size, size))
    matrix[:states, :states] = plant.phi
    matrix[last, 0] = 1.0
    matrix[d0] = gamma_d * period_s * p
    matrix[d0, d0] += 1.0
    matrix[:states, first + plant.whole] += plant.late  # the oldest command still at work
    if plant.whole:
        matrix[:states, first + plant.whole - 1] += plant.prompt
    else:
        matrix[:states] += np.outer(plant.prompt, law)
    matrix[first] = law
    for i in range(1, past):
        matrix[first + i, first + i - 1] = 1.0
    if gamma_d == 0.0:  # d0 stands still: its eigenvalue of 1 is no part of the loop
        matrix = np.delete(np.delete(matrix, d0, axis=0), d0, axis=1)
    return matrix


def _zeros(x: Array, y: Array, function: Callable[[float], float]) -> list[float]:
    """Refine every change of sign of samples y(x)."""
    from scipy.optimize import brentq  # long to load, and the loop never asks

    changes = np.nonzero(np.signbit(y[:-1]) != np.signbit(y[1:]))[0]
    return [float(brentq(function, x[i], x[i + 1])) for i in changes]
