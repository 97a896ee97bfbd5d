"""How far two axes are to the side of their path: what of their errors bends its shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def error_across(
    vx: Array, vy: Array, ex: Array, ey: Array, slowest: float
) -> tuple[Array, Array, Array]:
    """Return the error across a path, and the direction across it.

    Parameters
    ----------
    vx, vy
        Velocity of the reference in any unit, shape (N,).
    ex, ey
        Position - reference, shape (N,).
    slowest
        Speed up to which the path has no direction, in the velocities' unit.

    Returns
    -------
    across
        The part of the error to the left of the path, zero where the reference rests.
    normal_x, normal_y
        Unit vector to the left of it, zero where the reference rests.
    """
    speed = np.hypot(vx, vy)
    moving = speed > slowest
    safe = np.where(moving, speed, 1.0)
    normal_x, normal_y = np.where(moving, -vy / safe, 0.0), np.where(moving, vx / safe, 0.0)
    return ex * normal_x + ey * normal_y, normal_x, normal_y
