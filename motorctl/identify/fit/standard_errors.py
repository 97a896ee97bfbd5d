"""Standard errors that honour serial correlation of the residual.

W. K. Newey, K. D. West, "A Simple, Positive Semi-Definite, Heteroskedasticity and Autocorrelation
Consistent Covariance Matrix", Econometrica 55(3), 1987, with the bandwidth of D. W. K. Andrews,
"Heteroskedasticity and Autocorrelation Consistent Covariance Matrix Estimation", Econometrica
59(3), 1991, eqs. 6.2 and 6.4, for Bartlett's kernel and scores that are first-order autoregressive.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LONGEST_PART = 0.1
"""The bandwidth never exceeds this part of the record. Larger sums lags of which few pairs tell
anything, smaller cuts slow correlation off, so that standard errors come out too small. Chosen by
hand."""
ANDREWS_BARTLETT = 1.1447
"""Factor of the optimal bandwidth for Bartlett's kernel, (3 / 2)^(1/3). Published in Andrews 1991,
eq. 6.2."""
MOST_CORRELATED = 0.97
"""Correlation of one row's score with the next at most, either sign. Nearer to 1 lets the bandwidth
run away, which grows with (1 - rho)^(-2/3); smaller cuts slow correlation off, so that standard
errors come out too small. Chosen by hand."""


def long_run_covariance(scores: Array, at_least: int) -> Array:
    """Sum the autocovariances of `scores` (m, p) over lags, Bartlett-weighted; shape (p, p).

    `at_least` is the smallest bandwidth in rows.
    """
    m = len(scores)
    lags = max(at_least, math.ceil(_andrews_bandwidth(scores)))
    lags = min(lags, max(1, int(LONGEST_PART * m)))
    total = scores.T @ scores
    for lag in range(1, lags + 1):
        cross = scores[lag:].T @ scores[:-lag]
        total += (1.0 - lag / (lags + 1.0)) * (cross + cross.T)
    return np.asarray(total)


def sandwich(bread: Array, scores: Array, at_least: int) -> Array:
    """Return the covariance (p, p) of an estimate whose score is the rows of `scores` (m, p).

    `bread` is the inverse of the derivative of the summed score.
    """
    return np.asarray(bread @ long_run_covariance(scores, at_least) @ bread.T)


def _andrews_bandwidth(scores: Array) -> float:
    """Return the optimal bandwidth in rows; eq. 6.4 with the columns weighted to equal power."""
    before, after = scores[:-1], scores[1:]
    power = np.sum(before**2, axis=0)
    power = np.where(power > 0.0, power, 1.0)
    rho = np.clip(np.sum(before * after, axis=0) / power, -MOST_CORRELATED, MOST_CORRELATED)
    variance = np.sum((after - rho * before) ** 2, axis=0) / power
    numerator = np.sum(4.0 * rho**2 * variance**2 / ((1 - rho) ** 6 * (1 + rho) ** 2))
    denominator = np.sum(variance**2 / (1.0 - rho) ** 4)
    if denominator == 0.0:
        return 0.0
    return float(ANDREWS_BARTLETT * (numerator / denominator * len(scores)) ** (1.0 / 3.0))
