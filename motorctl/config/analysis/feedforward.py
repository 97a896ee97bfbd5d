"""The voltage that a motion needs: the model at the desired motion, through the inverse map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.model import EffectList

Array = NDArray[np.float64]

LEAST_SLOPE = 1e-3
NEWTON_STEPS = 8
NUDGE_V = 1e-4
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
    """Return the function that tells an axis' command for a desired motion.

    The sum of theta_i psi_i over the state effects at the desired motion (va1, our reconstruction
    of Chen, Yao, Wang 2013, eq. 13), through the inverse of the input map (eq. 9). Time counts as
    0; what effects remember, and other axes' motion, counts as nothing.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    theta
        Parameters in the list's order, (n,).
    u_max
        Voltage limit [V]; beyond it the input map is continued by straight lines.

    Returns
    -------
    callable
        Of position [m], velocity [m/s] and acceleration [m/s^2], all (N,); it returns the command
        [V], (N,).
    """
    each = [effect for effect in model.effects for _ in effect.parameters]
    state = np.where([e.kind == "state" and not e.memory_size for e in each], theta, 0.0)
    varying = np.where([e.kind == "input" and e.varies for e in each], theta, 0.0)
    u = np.linspace(-u_max, u_max, MAP_POINTS)
    fixed = theta - varying
    mapped, slope = model.input_over(u, fixed)
    low, high = float(slope[0]), float(slope[-1])
    slopes = low, high
    inverse_slopes = 1.0 / max(low, LEAST_SLOPE), 1.0 / max(high, LEAST_SLOPE)

    def command(x: Array, v: Array, a: Array) -> Array:
        still = np.zeros_like(x)
        virtual = model.regressor(x, v, a, v, still, still) @ state
        needed = _extended(virtual, mapped, u, inverse_slopes)
        if not varying.any():
            return needed

        def mapped_at(command_v: Array) -> Array:
            psi: Array = model.regressor(x, v, still, v, still, command_v)
            return _extended(command_v, u, mapped, slopes) - psi @ varying

        # Newton's method, from the command that the map without its varying part would need.
        for _ in range(NEWTON_STEPS):
            change = mapped_at(needed + NUDGE_V) - mapped_at(needed - NUDGE_V)
            slope = np.maximum(change / (2.0 * NUDGE_V), LEAST_SLOPE)
            needed = needed - (mapped_at(needed) - virtual) / slope
        return needed

    return command


def command_peak(t: Array, u: Array) -> CommandPeak:
    """Find the largest command of a motion, with its sign.

    Parameters
    ----------
    t
        Times [s], (N,).
    u
        Commands at these times [V], (N,); N is at least 1.

    Returns
    -------
    CommandPeak
        The command of the largest magnitude [V] and its time [s]; of equals the first.
    """
    k = int(np.abs(u).argmax())
    return CommandPeak(float(u[k]), float(t[k]))


def _extended(value: Array, at: Array, onto: Array, steepness: tuple[float, float]) -> Array:
    """Interpolate the function with values `onto` at `at`; straight lines beyond both ends."""
    found = np.interp(value, at, onto)
    for end, beyond in ((0, value < at[0]), (-1, value > at[-1])):
        found[beyond] += (value[beyond] - at[end]) * steepness[end]
    return found
