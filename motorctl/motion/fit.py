"""A smooth motion through points.

A quintic spline (four times continuously differentiable) passes through the points. Its jerk is
bounded, and it can start and end at rest in velocity *and* acceleration, which a cubic cannot.
"""

from __future__ import annotations

import numpy as np

from motorctl.errors import ConfigError, UsageError
from motorctl.motion.segments import Array, Segments, derivatives, hermite_segments
from motorctl.motion.table import PointTable
from motorctl.motion.trajectory import Trajectory

# An end of the points counts as at rest below this part of their highest speed.
REST_FRACTION = 0.05
EASED_ROWS = 6

# Derivatives that a spline takes at its first and last point: (order, value).
_Ends = tuple[list[tuple[int, float]], list[tuple[int, float]]]


def fit_points(table: PointTable, axis: str, ease_s: float | None = None) -> Trajectory:
    """Fit one axis of a table from rest to rest.

    Parameters
    ----------
    table
        The points.
    axis
        Name of the axis.
    ease_s
        Duration of a lead-in and a lead-out [s]; None: the points begin and end at rest.

    Raises
    ------
    ConfigError
        Where the points move at an end and are not eased, where they are too few for it, or where
        double precision cannot join them.
    """
    if ease_s is None:
        _require_rest(table, axis)
        at_rest = [(1, 0.0), (2, 0.0)]
        return _trajectory(_join(table, axis, (at_rest, at_rest)), table, axis)
    x = table.position_m[axis]
    if len(x) < EASED_ROWS:
        message = f"ease_s needs at least {EASED_ROWS} rows of points, there are {len(x)}"
        raise ConfigError([table.problem(None, axis, message)])
    segments = _join(table, axis, None)
    v, a = segments["c"][0, 1], 2 * segments["c"][0, 2]
    lead_in = _ease(x[0] - _eased_way(v, -a, ease_s), 0.0, 0.0, x[0], v, a, ease_s)
    _, (v,), (a,) = derivatives(segments["c"][-1:], segments["duration_s"][-1:])
    lead_out = _ease(x[-1], v, a, x[-1] + _eased_way(v, a, ease_s), 0.0, 0.0, ease_s)
    return _trajectory(np.concatenate([lead_in, segments, lead_out]), table, axis)


def _join(table: PointTable, axis: str, ends: _Ends | None) -> Segments:
    """Return the quintic spline through the points as a table."""
    from scipy.interpolate import make_interp_spline  # half of what a start would load

    t, x = table.time_s, table.position_m[axis]
    try:
        spline = make_interp_spline(t, x, k=5, bc_type=ends)  # type: ignore[arg-type]
    except (ValueError, np.linalg.LinAlgError) as error:
        message = f"no smooth curve fits the points: {error}"
        raise ConfigError([table.problem(None, axis, message)]) from error
    # By its states at the points, so that rounding cannot open the joints.
    return hermite_segments(np.diff(t), x, spline(t, 1), spline(t, 2))


def _trajectory(segments: Segments, table: PointTable, axis: str) -> Trajectory:
    try:
        return Trajectory(segments)
    except UsageError as error:
        message = f"no smooth curve fits the points: {error}"
        raise ConfigError([table.problem(None, axis, message)]) from error


def _eased_way(v: float, a: float, ease_s: float) -> float:
    """Return the way from (v, a) to rest where velocity is a cubic of time."""
    return ease_s * (v / 2 + ease_s * a / 12)


def _ease(
    x0: float, v0: float, a0: float, x1: float, v1: float, a1: float, ease_s: float
) -> Segments:
    return hermite_segments([ease_s], [x0, x1], [v0, v1], [a0, a1])


def _require_rest(table: PointTable, axis: str) -> None:
    t, x = table.time_s, table.position_m[axis]
    limit = REST_FRACTION * np.abs(np.diff(x) / np.diff(t)).max()
    start, end = _end_speed(t[:3], x[:3]), _end_speed(t[:-4:-1], x[:-4:-1])
    problems = [
        table.problem(
            line,
            axis,
            f"{verb} at {speed:.4g} m/s; it must rest there, or the program needs ease_s",
        )
        for verb, line, speed in (
            ("starts", table.first_line, start),
            ("ends", table.last_line, end),
        )
        if speed > limit
    ]
    if problems:
        raise ConfigError(problems)


def _end_speed(t: Array, x: Array) -> float:
    """Return the speed at the first of two or three points, so that motion from rest gives zero.

    The smaller of the difference of two points, which a dwell makes vanish, and the slope of the
    parabola through three, which constant acceleration from rest makes vanish.
    """
    if len(t) < 3:
        return 0.0
    first, second = (x[1] - x[0]) / (t[1] - t[0]), (x[2] - x[0]) / (t[2] - t[0])
    parabola = (first * (t[2] - t[0]) - second * (t[1] - t[0])) / (t[2] - t[1])
    return float(min(abs(first), abs(parabola)))
