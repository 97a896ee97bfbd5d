"""Where sampled values change their sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sign_changes(values: Array) -> tuple[NDArray[np.intp], Array]:
    """Return where values change their sign, by the chords between them.

    Parameters
    ----------
    values
        Samples of a function, (n,).

    Returns
    -------
    ndarray
        After which of them the sign changes, (m,).
    ndarray
        At which part of the way to the next one a straight line is zero, (m,), from 0 to 1.
    """
    at = np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))
    return at, np.asarray(values[at] / (values[at] - values[at + 1]))
