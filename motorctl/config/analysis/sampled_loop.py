"""The sampled position loop around a rigid mass: plant behind hold and delay, law, stability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.control import CommandFilter

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Frequencies:
    """Frequencies, and what the law's difference and sum are at them."""

    difference: ComplexArray
    """(z - 1)/(Ts z), the backward difference [1/s]."""
    integral: ComplexArray
    """Ts/(z - 1), the sum that the fast adaptation is [s]."""
    z: ComplexArray
    """exp(j w Ts)."""

    @classmethod
    def at(cls, w: Array, period_s: float) -> Frequencies:
        """Return those at frequencies w [rad/s], above 0, at a period Ts [s]."""
        z = np.exp(1j * w * period_s)
        return cls((z - 1.0) / (period_s * z), period_s / (z - 1.0), z)


@dataclass(frozen=True)
class LoopGains:
    """The gains of the law's feedback part."""

    k1_1_s: float
    """k1 [1/s]."""
    ks_v_s_m: float
    """ks [V s/m]."""
    gamma_d: float
    """gamma_d of the fast adaptation [V/m]; 0: d0 stands still."""
    command_filter: CommandFilter | None = None
    """What both go through before they are a command."""

    def feedback(self, at: Frequencies) -> ComplexArray:
        """Return the law's transfer from position error to minus the command [V/m].

        (ks + gamma_d Ts/(z - 1)) ((z - 1)/(Ts z) + k1): p with the velocity error by backward
        difference, -ks p, and the fast adaptation of d0 (Chen, Yao, Wang 2013, eqs 11, 18) while it
        is off its bound and the command not saturated; behind the filter, where there is one.

        Parameters
        ----------
        at
            The frequencies.

        Returns
        -------
        ndarray
            The response at each of them.
        """
        result: ComplexArray = self.feedback_of_p(at) * (at.difference + self.k1_1_s)
        return result

    def feedback_of_p(self, at: Frequencies) -> ComplexArray:
        """Return its transfer from p = de/dt + k1 e to minus the command [V s/m]."""
        result: ComplexArray = self.ks_v_s_m + self.gamma_d * at.integral
        if self.command_filter is not None:
            result = result * self.command_filter.response(at.z)
        return result


class DelayedPlant:
    """1/(theta1 s^2 + theta2 s + stiffness) behind a zero-order hold, a delay and a lag.

    x+ = phi x + late u[k - whole - 1] + prompt u[k - whole]; x is position, velocity, current. The
    current is there only behind a lag.

    Parameters
    ----------
    balance
        theta1 [V s^2/m], theta2 [V s/m] and stiffness [V/m].
    period_s
        Period of the loop, Ts [s].
    delay_s, lag_s
        Dead time of any length and time constant between the command and the force [s].
    """

    def __init__(
        self,
        balance: tuple[float, float, float],
        period_s: float,
        delay_s: float = 0.0,
        lag_s: float = 0.0,
    ) -> None:
        self.whole = int(delay_s / period_s)
        part = delay_s - self.whole * period_s
        self.period_s = period_s
        self.phi, prompt = _held(balance, lag_s, period_s - part)
        before, late = _held(balance, lag_s, part)
        self.late = self.phi @ late
        self.prompt = prompt
        self.phi = self.phi @ before

    def response(self, w: Array) -> ComplexArray:
        """Return the transfer from command to position [m/V] at frequencies w [rad/s], (n,)."""
        z = np.exp(1j * w * self.period_s)
        drive = (self.late[:, None] / z + self.prompt[:, None]) / z**self.whole
        system = z[:, None, None] * np.eye(len(self.phi)) - self.phi
        result: ComplexArray = np.linalg.solve(system, drive.T[:, :, None])[:, 0, 0]
        return result


def open_loop(plant: DelayedPlant, gains: LoopGains, w: Array) -> ComplexArray:
    """Return L, the law's feedback times the plant.

    Parameters
    ----------
    plant
        Command to position, sampled.
    gains
        Of the law around it.
    w
        Frequencies [rad/s], (n,), above 0 and below the Nyquist frequency.

    Returns
    -------
    ndarray
        The open loop [1] at each of them, (n,), complex.
    """
    result: ComplexArray = gains.feedback(Frequencies.at(w, plant.period_s)) * plant.response(w)
    return result


def is_stable(plant: DelayedPlant, gains: LoopGains) -> bool:
    """Return whether the closed loop's eigenvalues lie inside the unit circle.

    Parameters
    ----------
    plant
        The sampled plant.
    gains
        Of the law around it.

    Returns
    -------
    bool
        Whether the loop is stable.
    """
    return bool(np.abs(np.linalg.eigvals(_closed_loop(plant, gains))).max() < 1.0)


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


def _closed_loop(plant: DelayedPlant, gains: LoopGains) -> Array:
    """Return the transition matrix of the loop.

    Its state: the plant's, last position, d0, past commands, and the filter's two.
    """
    states, past, period_s = len(plant.phi), plant.whole + 1, plant.period_s
    last, d0, first = states, states + 1, states + 2
    own = gains.command_filter
    memory = first + past
    size = memory + (2 if own else 0)
    law = np.zeros(size)  # u = law . state
    p = np.zeros(size)
    p[0], p[last] = 1.0 / period_s + gains.k1_1_s, -1.0 / period_s
    law -= gains.ks_v_s_m * p
    law[d0] = -1.0
    matrix = np.zeros((size, size))
    if own is not None:
        feedback = law
        law = own.b0 * feedback
        law[memory] += 1.0
        matrix[memory] = own.b1 * feedback - own.a1 * law
        matrix[memory, memory + 1] += 1.0
        matrix[memory + 1] = own.b2 * feedback - own.a2 * law
    matrix[:states, :states] = plant.phi
    matrix[last, 0] = 1.0
    matrix[d0] = gains.gamma_d * period_s * p
    matrix[d0, d0] += 1.0
    matrix[:states, first + plant.whole] += plant.late  # the oldest command still at work
    if plant.whole:
        matrix[:states, first + plant.whole - 1] += plant.prompt
    else:
        matrix[:states] += np.outer(plant.prompt, law)
    matrix[first] = law
    for i in range(1, past):
        matrix[first + i, first + i - 1] = 1.0
    if gains.gamma_d == 0.0:  # d0 stands still: its eigenvalue of 1 is no part of the loop
        matrix = np.delete(np.delete(matrix, d0, axis=0), d0, axis=1)
    return matrix
