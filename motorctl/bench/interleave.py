"""Measure several things in turn, so that whatever disturbs the machine disturbs all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Progress = Callable[[float], None]
"""Told the share that is done, 0 to 1."""


def interleaved(
    subjects: Mapping[str, Callable[[], float]], rounds: int, progress: Progress
) -> dict[str, Array]:
    """Run A B … A B …; gives each subject's results, shape (rounds,), after a round to warm up."""
    results = {name: np.empty(rounds) for name in subjects}
    for measure in subjects.values():
        measure()
    for k in range(rounds):
        for name, measure in subjects.items():
            results[name][k] = measure()
        progress((k + 1) / rounds)
    return results


def median_ratio(numerator: Array, denominator: Array) -> float:
    """Give the median of the ratios within each round."""
    return float(np.median(numerator / denominator))


def part_of(progress: Progress, begin: float, end: float) -> Progress:
    """Give the progress of one part of a longer work."""
    return lambda share: progress(begin + (end - begin) * share)
