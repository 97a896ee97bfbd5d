"""One column against another: error over position, the phase plane, a path with its error."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.identify.compare.error_across import error_across
from motorctl.scope.shown import Shown
from motorctl.scope.wire import Answer

Array = NDArray[np.float64]
MOST_ROWS = 3_000_000
"""Rows that are looked at for one picture: ten minutes at 5 kHz, 24 MB a column. By hand."""
MOST_POINTS = 20_000
"""Up to so many rows are told one after the other and drawn as a line. More than that fill a
picture: then each of its pixels that a row falls onto is told once, and none is left out."""
GRID = 600
"""Pixels of such a picture along each side. As large as it is drawn, or a little larger."""
LEAST_SPEED = 1e-4
"""Of the reference [unit/s], below which a path has no direction, and so no error across it."""


def plane(shown: Shown, x: str, y: str, begin_s: float, end_s: float) -> Answer:
    """Return the points of one column against another over a stretch of time.

    Parameters
    ----------
    shown
        The log.
    x, y
        Its columns.
    begin_s, end_s
        From when to when [s] by the log's own clock.

    Returns
    -------
    Answer
        `x` and `y`; `line` where they are rows in their order, else each is a pixel that rows fall
        onto.
    """
    first, last, told = _rows(shown, begin_s, end_s)
    for name in (x, y):
        _must_have(shown, name)
    return _points(
        shown.pyramid.rows(x, first, last).astype(float),
        shown.pyramid.rows(y, first, last).astype(float),
        told,
    )


def path(
    shown: Shown, x_axis: str, y_axis: str, begin_s: float, end_s: float, magnified: float
) -> Answer:
    """Return the path of two axes, with the error across it magnified.

    Metres and radians have no distance in common, so nothing is across the path of a linear and a
    rotary axis: there each axis' own error is magnified, with what it lags behind on the path.

    Parameters
    ----------
    shown
        The log.
    x_axis, y_axis
        Two axes.
    begin_s, end_s
        From when to when [s] by the log's own clock.
    magnified
        How often larger than the path the error is drawn.

    Returns
    -------
    Answer
        `x` and `y` of the reference moved by the magnified error, `reference_x` and `reference_y`.
        In what is told `worst` and `rms` of the error across the path, or `worst_x` and `worst_y`
        where the axes' units differ.
    """
    if not 1 <= magnified <= 1e6:
        raise UsageError(f"magnified: {magnified:g}, which is not between 1 and 1e6")
    first, last, told = _rows(shown, begin_s, end_s)
    signals = ("reference_m", "reference_velocity_m_s", "following_error_m")
    columns = [f"{axis}.{signal}" for axis in (x_axis, y_axis) for signal in signals]
    for name in columns:
        _must_have(shown, name)
    rx, vx, ex, ry, vy, ey = (
        shown.pyramid.rows(name, first, last).astype(float) for name in columns
    )
    units = shown.log.units
    if units.get(f"{x_axis}.position_m") == units.get(f"{y_axis}.position_m"):
        across, normal_x, normal_y = error_across(vx, vy, ex, ey, LEAST_SPEED)
        ex, ey = across * normal_x, across * normal_y
        told = told | _sizes(across)
    else:
        sizes = {"worst_x": _sizes(ex), "worst_y": _sizes(ey)}
        told = told | {name: size["worst"] for name, size in sizes.items() if size}
    drawn = _points(rx + magnified * ex, ry + magnified * ey, told)
    reference = _points(rx, ry, {})
    arrays = {f"reference_{name}": values for name, values in reference.arrays.items()}
    return Answer(
        {**drawn.told, "reference_line": reference.told["line"]}, {**drawn.arrays, **arrays}
    )


def _sizes(error: Array) -> dict[str, float]:
    """Return the largest and the rms value of an error; nothing where none is known."""
    known = error[np.isfinite(error)]
    if not len(known):
        return {}
    return {"worst": float(np.max(np.abs(known))), "rms": float(np.sqrt(np.mean(known**2)))}


def _rows(shown: Shown, begin_s: float, end_s: float) -> tuple[int, int, dict[str, Any]]:
    first, last = shown.rows_between(begin_s, end_s)
    if last - first <= MOST_ROWS:
        return first, last, {}
    seconds = MOST_ROWS / shown.rate_hz()
    note = f"the first {seconds:.4g} s of this view: zoom in for others"
    return first, first + MOST_ROWS, {"note": note}


def _must_have(shown: Shown, name: str) -> None:
    if name not in shown.log.columns:
        raise UsageError(f"no column '{name}' in {shown.name}")


def _points(x: Array, y: Array, told: dict[str, Any]) -> Answer:
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there], y[there]
    if len(x) <= MOST_POINTS:
        return Answer({**told, "line": True}, {"x": x, "y": y})
    column, x_low, x_step = _pixel(x)
    row, y_low, y_step = _pixel(y)
    lit = np.unique(row * GRID + column)
    row, column = np.divmod(lit, GRID)
    arrays = {"x": x_low + (column + 0.5) * x_step, "y": y_low + (row + 0.5) * y_step}
    return Answer({**told, "line": False}, arrays)


def _pixel(values: Array) -> tuple[NDArray[np.int64], float, float]:
    low, high = float(values.min()), float(values.max())
    step = (high - low) / GRID or 1.0
    return np.minimum(((values - low) / step).astype(np.int64), GRID - 1), low, step
