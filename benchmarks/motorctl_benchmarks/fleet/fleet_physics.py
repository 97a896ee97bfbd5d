"""One axis of a fleet under its drive's controller, integrated by Runge-Kutta in compiled steps.

m a = u_lagged - b v - c tanh(v / w) + o + cogging + marks of rolling elements + noise, in volts of
command: every force is over the motor's force constant. The scale that the encoder reads may be
dirty. The controller believes what was true when the machine was commissioned.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])

SUBSTEPS = 4
"""Integration steps in a sample: the fastest time constant, the amplifier's, is a sample or so."""


class Axis(NamedTuple):
    """What an axis is in one log; forces in volts of command."""

    inertia: float
    viscous: float
    coulomb: float
    offset: float
    cogging_sin: float
    cogging_cos: float
    cogging_second: float
    """Of the second order."""
    pitch_m: float
    lag_s: float
    """Of the amplifier."""
    mark: float
    """Force of a damaged rolling element's passing."""
    mark_pitch_m: float
    """Way between two passings."""
    dirt_m: float
    """Periodic error of the measured position."""
    dirt_pitch_m: float


class Drive(NamedTuple):
    """The controller and its sensor."""

    bandwidth_1_s: float
    integral_1_s: float
    period_s: float
    resolution_m: float
    limit_v: float
    turn_m_s: float
    """Velocity within which friction turns."""


def compiled(function: Function) -> Function:
    """Return the function compiled, with its type kept."""
    return cast("Function", numba.njit(cache=True, error_model="numpy")(function))


@compiled
def force_of_place(x: float, axis: Axis) -> float:
    """Return what magnets and rolling elements push at a place."""
    turn = 2.0 * math.pi * x / axis.pitch_m
    force = axis.cogging_sin * math.sin(turn) + axis.cogging_cos * math.cos(turn)
    force += axis.cogging_second * math.sin(2.0 * turn)
    # a passing is short: the cube of a raised cosine, without its mean
    passing = (0.5 + 0.5 * math.cos(2.0 * math.pi * x / axis.mark_pitch_m)) ** 3 - 0.3125
    return float(force + axis.mark * passing)


@compiled
def acceleration(x: float, v: float, u: float, w: float, axis: Axis, turn_m_s: float) -> float:
    """Return the carriage's acceleration under the amplifier's voltage."""
    friction = axis.viscous * v + axis.coulomb * math.tanh(v / turn_m_s)
    return float((u - friction + axis.offset + force_of_place(x, axis) + w) / axis.inertia)


@compiled
def closed_loop(
    goal: Array, force: Array, seen: Array, axis: Axis, believed: Axis, drive: Drive
) -> tuple[Array, Array, Array]:
    """Return measured position, command and true position.

    Parameters
    ----------
    goal
        Position, velocity and acceleration to follow, (3, N).
    force, seen
        Disturbing force and noise of the encoder, (N,).
    axis, believed
        What the machine is, and what its feedforward was made for.
    drive
        Controller and sensor.
    """
    n = goal.shape[1]
    position, command, true = np.zeros(n), np.zeros(n), np.zeros(n)
    x, v, u, sum_e = goal[0, 0], 0.0, 0.0, 0.0
    before = x
    bandwidth, period = drive.bandwidth_1_s, drive.period_s
    h = period / SUBSTEPS
    asked = 0.0
    for k in range(n):
        true[k] = x
        shown = x + axis.dirt_m * math.sin(2.0 * math.pi * x / axis.dirt_pitch_m) + seen[k]
        shown = round(shown / drive.resolution_m) * drive.resolution_m
        position[k] = shown
        error = goal[0, k] - shown
        speed = goal[1, k] - (shown - before) / period
        before = shown
        want = believed.inertia * goal[2, k] + believed.viscous * goal[1, k] - believed.offset
        want += believed.coulomb * math.tanh(goal[1, k] / drive.turn_m_s)
        want -= force_of_place(goal[0, k], believed)
        back = 2.0 * speed + bandwidth * error + drive.integral_1_s * sum_e
        want += believed.inertia * bandwidth * back
        held = min(max(want, -drive.limit_v), drive.limit_v)
        if held == want:
            sum_e += bandwidth * error * period
        command[k] = held
        kept = math.exp(-h / axis.lag_s)
        for _ in range(SUBSTEPS):
            middle = asked + (u - asked) * math.sqrt(kept)
            after = asked + (u - asked) * kept
            w = force[k]
            turn = drive.turn_m_s
            a1 = acceleration(x, v, u, w, axis, turn)
            a2 = acceleration(x + 0.5 * h * v, v + 0.5 * h * a1, middle, w, axis, turn)
            x3 = x + 0.5 * h * v + 0.25 * h * h * a1
            a3 = acceleration(x3, v + 0.5 * h * a2, middle, w, axis, turn)
            x4 = x + h * v + 0.5 * h * h * a2
            a4 = acceleration(x4, v + h * a3, after, w, axis, turn)
            x += h * v + h * h * (a1 + a2 + a3) / 6.0
            v += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
            u = after
        asked = held  # the amplifier gets a command with the next tick
    return position, command, true
