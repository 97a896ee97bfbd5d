"""Assumption 2: the slope of the input map v(u) over the voltage range."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


def smallest_slope(model: EffectList, theta: Array, u_max: float) -> tuple[float, float]:
    """Give the smallest dv/du over |u| <= u_max [V], and the u [V] at which it stands.

    theta (n,) as in the list. Chen, Yao, Wang 2013, Assumption 2.
    """
    slopes = [(float(model.kernels.input_slope(u, theta)), u) for u in _grid(u_max)]
    return min(slopes, key=lambda pair: pair[0])


def corner_slopes(
    model: EffectList, lower: Sequence[float], upper: Sequence[float], u_max: float
) -> list[CornerSlope]:
    """Give the smallest dv/du at every corner of the input map's parameters, worst first.

    lower, upper (n,): bounds of theta. Empty where the model has no input effect; beyond
    `MAX_CORNERS` corners only the worst is given.
    """
    indices = input_indices(model)
    if not indices:
        return []
    grid = _grid(u_max)
    slopes = np.empty((len(grid), len(indices)))
    theta = np.zeros(len(model))
    for column, i in enumerate(indices):
        theta[:] = 0.0
        theta[i] = 1.0
        slopes[:, column] = [model.kernels.input_slope(u, theta) - 1.0 for u in grid]
    low = np.array([lower[i] for i in indices])
    high = np.array([upper[i] for i in indices])
    if 2 ** len(indices) <= MAX_CORNERS:
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    else:
        worst = np.minimum(slopes * low, slopes * high).sum(axis=1).argmin()
        corners = np.where(slopes[worst] * low < slopes[worst] * high, low, high)[None]
    at_corners = 1.0 + slopes @ corners.T
    names = [model.parameter_names[i] for i in indices]
    found = [
        CornerSlope(dict(zip(names, map(float, corner), strict=True)), float(line[k]), grid[k])
        for corner, line in zip(corners, at_corners.T, strict=True)
        for k in [int(line.argmin())]
    ]
    return sorted(found, key=lambda corner: corner.slope)


def input_indices(model: EffectList) -> list[int]:
    """Give the places in theta of the input map's parameters."""
    kinds = [effect.kind for effect in model.effects for _ in effect.parameters]
    return [i for i, kind in enumerate(kinds) if kind == "input"]


def _grid(u_max: float) -> list[float]:
    return [float(u) for u in np.linspace(u_max, -u_max, GRID)]
