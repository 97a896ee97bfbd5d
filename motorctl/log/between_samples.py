"""What a smooth column is between its samples, which may be uneven or missing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

Array = NDArray[np.float64]

TOO_NEAR = 0.25
"""Step between two samples, in usual ones, below which their difference is rather noise than slope.
Larger rounds off true changes, smaller overshoots between samples that nearly coincide. Chosen by
hand."""


def smooth_between(places: Array, values: Array, wanted: Array) -> Array:
    """Return a smooth column at other places, by cubics through its samples.

    Each sample has the slope of the parabola through it and its neighbours, so that a steady
    acceleration is met exactly, however uneven the samples are. Where two nearly coincide it has
    that of monotone cubics, which never overshoot.

    Parameters
    ----------
    places
        Of the samples, increasing, (N,).
    values
        The samples, (N,).
    wanted
        Other places, (M,).

    Returns
    -------
    ndarray
        (M,)
    """
    steps = np.diff(places)
    slopes = np.diff(values) / steps
    near = steps < TOO_NEAR * float(np.median(steps))
    left, right = steps[:-1], steps[1:]
    inner = (right * slopes[:-1] + left * slopes[1:]) / (left + right)
    every = np.asarray(PchipInterpolator(places, values).derivative()(places))
    every[1:-1] = np.where(near[:-1] | near[1:], every[1:-1], inner)
    return np.asarray(CubicHermiteSpline(places, values, every)(wanted))
