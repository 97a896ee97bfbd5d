"""Angles that begin anew after a turn, as absolute encoders and robots' joints tell them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN_RAD = 2.0 * math.pi
WRAPS = 0.75
"""Part of a turn that an angle jumps by where it begins anew; the rest is what the axis moved
meanwhile. Larger misses it in fast motion, smaller takes damaged values for it. Arithmetic: as far
from a whole turn as `MOVES` is from none."""
MOVES = 0.25
"""Part of a turn that every other step stays below. Larger unwraps noise of an angle that jumps
everywhere, smaller leaves fast motion as it is. Arithmetic."""
ROUNDING = 1e-3
"""Part of a turn by which such an angle may reach beyond one. Larger takes an axis that turns
further for one, smaller misses angles that were rounded. Chosen by hand."""


def counted_on(angle_rad: Array) -> tuple[Array, int]:
    """Return an angle that counts whole turns on where it began anew, and how often it did.

    Parameters
    ----------
    angle_rad
        Of one row after the other [rad], (N,), finite.

    Returns
    -------
    angle_rad : ndarray
        The same, (N,), where it never left one turn and jumped by about a turn between neighbouring
        rows, but nowhere by half of one; else as it came in.
    wraps : int
        How often it began anew; 0 where nothing was done.
    """
    turns = angle_rad / TURN_RAD
    steps = np.diff(turns)
    wraps = np.abs(steps) > WRAPS
    others = np.abs(steps[~wraps])
    if not wraps.any() or np.ptp(turns) > 1.0 + ROUNDING or others.max(initial=0.0) > MOVES:
        return angle_rad, 0
    whole = np.concatenate([[0.0], np.cumsum(np.sign(steps) * wraps)])
    return angle_rad - TURN_RAD * whole, int(np.count_nonzero(wraps))
