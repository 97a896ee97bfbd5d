"""The voltage that a motion needs: the model at the desired motion, through the inverse map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis.input_map import input_indices
from motorctl.model import EffectList

Array = NDArray[np.float64]

MAP_POINTS = 2001
"""Points of the tabulated input map; between them it is straight to about 1e-7 V."""


@dataclass(frozen=True)
class CommandPeak:
    """Where model compensation alone asks most of the amplifier."""

    command_v: float
    """u [V]; beyond the voltage limit the map is continued by a straight line."""
    at_s: float


def required_command(
    model: EffectList, theta: Array, u_max: float
) -> Callable[[Array, Array, Array], Array]:
    """Give the function (x [m], v [m/s], a [m/s^2]), all (N,) -> u [V], (N,) of an axis.

    theta (n,). The sum of theta_i psi_i over the state effects at the desired motion (va1, our
    reconstruction of Chen, Yao, Wang 2013, eq. 13), through the inverse of the input map (eq. 9).
    """
    state = theta.copy()
    state[input_indices(model)] = 0.0
    u = np.linspace(-u_max, u_max, MAP_POINTS)
    mapped = np.array([model.kernels.input_map(float(value), theta) for value in u])

    def command(x: Array, v: Array, a: Array) -> Array:
        still = np.zeros_like(x)
        virtual = model.regressor(x, v, a, v, still, still) @ state
        needed = np.interp(virtual, mapped, u)
        for end, beyond in ((0, virtual < mapped[0]), (-1, virtual > mapped[-1])):
            slope = float(model.kernels.input_slope(u[end], theta))
            needed[beyond] += (virtual[beyond] - mapped[end]) / max(slope, 1e-3)
        return needed

    return command


def command_peak(t: Array, u: Array) -> CommandPeak:
    """Find the largest |u| [V] of samples over times t [s], with its sign."""
    k = int(np.abs(u).argmax())
    return CommandPeak(float(u[k]), float(t[k]))
