"""Which signal of the force balance stands on the left, and the way from one side to the other.

Command on the left:       u = sum theta_i psi_i.
Acceleration on the left:  a = (1/theta_1) u - sum_{i>1} (theta_i/theta_1) psi_i,

the same equation divided by the inertia.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Side = Literal["acceleration", "command"]


def turned(b: Array, inertia: int = 0) -> Array:
    """Return the coefficients, (n,), with the other signal on the left; its own inverse.

    Parameters
    ----------
    b
        Coefficients of the right side, (n,).
    inertia
        Which of them belongs to the signal that changes sides.
    """
    other: Array = -b / b[inertia]
    other[inertia] = 1.0 / b[inertia]
    return other


def turned_jacobian(b: Array, inertia: int = 0) -> Array:
    """Return the derivative of `turned`, (n, n)."""
    jacobian: Array = -np.eye(len(b)) / b[inertia]
    jacobian[:, inertia] = b / b[inertia] ** 2
    jacobian[inertia, inertia] = -1.0 / b[inertia] ** 2
    return jacobian


def acceleration_form(b: Array, side: Side) -> Array:
    """Return coefficients with the acceleration on the left, of a fit with either side there."""
    return b if side == "acceleration" else turned(b)
