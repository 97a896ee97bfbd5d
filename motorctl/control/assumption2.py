"""Assumption 2 as half-planes: the input map stays strictly monotonic over the voltage range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.control.input_slopes import fixed_slopes, input_indices, worst_varying
from motorctl.control.law_records import MAX_HALF_PLANES
from motorctl.errors import UsageError
from motorctl.model import EffectList

GRID = 32
"""Points of the voltage range, on each side, at which the slope is kept above the margin."""
HALVINGS = 12
"""Further points between the first of them and 0, each half as far out as the one before."""
ROUNDING = 1e-9

Array = NDArray[np.float64]


def monotonicity_half_planes(
    model: EffectList,
    lower: Array,
    upper: Array,
    u_max: float,
    margin: float,
    travel_m: tuple[float, float] = (0.0, 0.0),
) -> tuple[Array, Array]:
    """Return the half-planes normal . theta >= offset that keep Assumption 2.

    dv/du = 1 + sum theta_i h_i'(u) >= margin for |u| <= u_max is one half-plane for each u (Chen,
    Yao, Wang 2013, Assumption 2). Those that follow from the box and from the others are left out;
    with theta6 <= 0 one remains, at u_max.

    An effect that varies with place or time, or remembers, would need a half-plane at every place
    and for every past. Instead the others must leave room for the worst that it can do anywhere on
    the travel, at any time, after any past that it names, for any of its parameters within the box:
    that is added to the offsets. It is more than needed, so narrow bounds of such effects leave the
    others more room.

    Parameters
    ----------
    model
        The axis' effects, with n parameters.
    lower, upper
        Bounds of theta, (n,), in units of the parameters.
    u_max
        Voltage limit [V]: the map is looked at from -u_max to u_max.
    margin
        Least dv/du [V/V].
    travel_m
        Both ends of the travel [m], over which a map that varies with place is looked at.

    Returns
    -------
    tuple
        Normals, (K, n), and offsets, (K,).

    Raises
    ------
    UsageError
        Where more than the law can hold remain, bounds are not finite, or what varies leaves no
        theta.
    """
    used = np.zeros(len(model), np.bool_)
    used[input_indices(model)] = True
    if not (np.isfinite(lower[used]).all() and np.isfinite(upper[used]).all()):
        raise UsageError(
            "the parameters of the input map need finite lower and upper bounds: give `bounds`"
        )
    points = voltage_points(model, u_max)
    slopes = fixed_slopes(model, points)
    worst = worst_varying(model, points, lower, upper, travel_m)
    offsets = margin - 1.0 - worst
    # In the box's own coordinates, 0 to 1 along each side: rows . s >= limits.
    width = (upper - lower)[used]
    rows = slopes[:, used] * width
    limits = offsets - slopes[:, used] @ lower[used]
    if worst.any() and (np.maximum(rows, 0.0).sum(axis=1) < limits - ROUNDING).any():
        raise UsageError(
            "the input map cannot stay monotonic for every theta within its bounds: narrow the "
            "bounds of the parameters that vary with place, time or the past"
        )
    lowest = np.minimum(rows, 0.0).sum(axis=1)
    kept = [k for k in range(len(rows)) if rows[k].any() and lowest[k] < limits[k] - ROUNDING]
    for k in list(kept):
        others = [i for i in kept if i != k]
        if not _can_fall_below(rows[k], limits[k], rows[others], limits[others]):
            kept.remove(k)
    if len(kept) > MAX_HALF_PLANES:
        raise UsageError(
            f"the input map needs {len(kept)} half-planes to stay monotonic within its bounds; "
            f"at most {MAX_HALF_PLANES} are possible: narrow the bounds of its parameters"
        )
    return slopes[kept].reshape(-1, len(model)), offsets[kept]


def voltage_points(model: EffectList, u_max: float) -> list[float]:
    """Return the voltages at which the slope of the model's input map is looked at."""
    sides = [u_max * k / GRID for k in range(GRID, 0, -1)]
    sides += [u_max / GRID / 2.0**k for k in range(1, HALVINGS + 1)]
    inputs = [effect for effect in model.effects if effect.kind == "input"]
    if not all(effect.odd and not effect.remembers() for effect in inputs):
        sides += [-u for u in sides]
    return [*sides, 0.0]


def _can_fall_below(row: Array, limit: float, rows: Array, limits: Array) -> bool:
    """Return whether row . s < limit is possible in the unit box while rows . s >= limits."""
    from scipy.optimize import linprog  # long to load, and the loop never asks

    scale = np.abs(row).max()
    lengths = np.abs(rows).max(axis=1, initial=0.0)
    result = linprog(
        row / scale,
        A_ub=-rows / lengths[:, np.newaxis] if len(rows) else None,
        b_ub=-limits / lengths if len(rows) else None,
        bounds=[(0.0, 1.0)] * len(row),
    )
    # Only an answer that says otherwise lets a half-plane go.
    return not (result.status == 0 and result.fun * scale >= limit - ROUNDING)
