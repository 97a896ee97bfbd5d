"""Assumption 2: the slope of the input map v(u) over the voltage range."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.control import fixed_slopes, input_indices, worst_varying
from motorctl.model import EffectList

Array = NDArray[np.float64]

GRID = 129
"""Points of the voltage range at which the slope is looked at, both ends and 0 included."""
MAX_CORNERS = 1024


@dataclass(frozen=True)
class CornerSlope:
    """The smallest dv/du that a corner of the parameters' box has, and where."""

    theta: dict[str, float]
    """Parameters of the input map by their names."""
    slope: float
    at_u_v: float


def smallest_slope(
    model: EffectList, theta: Array, u_max: float, travel_m: tuple[float, float] = (0.0, 0.0)
) -> tuple[float, float]:
    """Return the smallest dv/du that the input map of one theta has.

    A map that varies counts at its worst over travel and time. Chen, Yao, Wang 2013, Assumption 2.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    theta
        Parameters in the list's order, (n,).
    u_max
        Voltage limit [V]: the map is looked at from -u_max to u_max.
    travel_m
        Both ends of the travel [m], over which a map that varies with place is looked at.

    Returns
    -------
    tuple
        The slope [V/V], and the command [V] at which it stands.
    """
    return lowest_slope(model, theta, theta, u_max, travel_m)


def lowest_slope(
    model: EffectList, lower: Array, upper: Array, u_max: float, travel_m: tuple[float, float]
) -> tuple[float, float]:
    """Return the smallest dv/du that any theta between two bounds has.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    lower, upper
        Bounds of theta, (n,), in units of the parameters.
    u_max
        Voltage limit [V]: the map is looked at from -u_max to u_max.
    travel_m
        Both ends of the travel [m], over which a map that varies with place is looked at.

    Returns
    -------
    tuple
        The slope [V/V], and the command [V] at which it stands.
    """
    grid = _grid(u_max)
    slopes = fixed_slopes(model, grid)
    least = 1.0 + np.minimum(slopes * lower, slopes * upper).sum(axis=1)
    slopes = least + worst_varying(model, grid, lower, upper, travel_m)
    k = int(slopes.argmin())
    return float(slopes[k]), grid[k]


def corner_slopes(
    model: EffectList,
    lower: Sequence[float],
    upper: Sequence[float],
    u_max: float,
    travel_m: tuple[float, float] = (0.0, 0.0),
) -> list[CornerSlope]:
    """Return the smallest dv/du at every corner of the input map's parameters, worst first.

    Corners are those of the parameters whose effects stand still; effects that vary count at their
    worst over travel, time and their own bounds, and are not named.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    lower, upper
        Bounds of theta, (n,), in units of the parameters.
    u_max
        Voltage limit [V]: the map is looked at from -u_max to u_max.
    travel_m
        Both ends of the travel [m], over which a map that varies with place is looked at.

    Returns
    -------
    list
        Each corner with its slope [V/V] and the command [V] at which it has it. Empty where the
        model has no input effect; beyond `MAX_CORNERS` corners only the worst.
    """
    if not input_indices(model):
        return []
    indices = input_indices(model, varying=False)
    grid = _grid(u_max)
    slopes = fixed_slopes(model, grid)[:, indices]
    least = 1.0 + worst_varying(model, grid, np.asarray(lower), np.asarray(upper), travel_m)
    low = np.array([lower[i] for i in indices])
    high = np.array([upper[i] for i in indices])
    if 2 ** len(indices) <= MAX_CORNERS:
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    else:
        worst = np.minimum(slopes * low, slopes * high).sum(axis=1).argmin()
        corners = np.where(slopes[worst] * low < slopes[worst] * high, low, high)[None]
    at_corners = least[:, None] + slopes @ corners.T
    names = [model.parameter_names[i] for i in indices]
    found = [
        CornerSlope(dict(zip(names, map(float, corner), strict=True)), float(line[k]), grid[k])
        for corner, line in zip(corners, at_corners.T, strict=True)
        for k in [int(line.argmin())]
    ]
    return sorted(found, key=lambda corner: corner.slope)


def _grid(u_max: float) -> list[float]:
    return [float(u) for u in np.linspace(u_max, -u_max, GRID)]
