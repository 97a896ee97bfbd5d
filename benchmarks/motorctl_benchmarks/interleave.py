"""Measure several things in turn, so that whatever disturbs the machine disturbs all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from motorctl.latency.progress import Progress

Array = NDArray[np.float64]


def interleaved(
    subjects: Mapping[str, Callable[[], float]], rounds: int, progress: Progress
) -> dict[str, Array]:
    """Run A B … A B …, after a round to warm up.

    Parameters
    ----------
    subjects
        What to measure, by name; each call returns one result.
    rounds
        How often each is measured.
    progress
        Called with the share done, 0 to 1.

    Returns
    -------
    dict of str to ndarray
        Each subject's results, shape (rounds,).
    """
    results = {name: np.empty(rounds) for name in subjects}
    for measure in subjects.values():
        measure()
    for k in range(rounds):
        for name, measure in subjects.items():
            results[name][k] = measure()
        progress((k + 1) / rounds)
    return results


def median_ratio(numerator: Array, denominator: Array) -> float:
    """Return the median of the ratios within each round."""
    return float(np.median(numerator / denominator))
