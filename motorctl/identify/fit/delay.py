"""The input delay that lets the declared model explain most.

Positive means that the command acts later than the tick in which it was written. A command that
is written during tick k and acts at once has delay zero: its hold begins at the tick, and the
half sample by which the held command lags its samples is part of the alignment, not of the delay.
A first-order lag of the amplifier shows up here as well; the two are nearly collinear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from motorctl.identify.columns.left_side import Side
from motorctl.identify.fit.regression import regression
from motorctl.identify.fit.regression_data import RegressionData, delay_range_s

Array = NDArray[np.float64]

STEPS_PER_PERIOD = 8
"""Trials of the scan in a period of the highest frequency in the band [1]: the error over the delay
has no valley narrower than that period. More takes time, fewer may step over the lowest valley.
Chosen by hand."""
FEWEST_TRIALS = 9
"""Trials of the scan at least, however narrow the range. More takes time, fewer leaves the
refinement no two neighbours around the best. Chosen by hand."""
TOLERANCE_SAMPLES = 1e-4
"""Accuracy of the delay [samples]. Larger adds to the parameters' errors, smaller takes time.
Chosen by hand."""
AT_END_SAMPLES = 0.01
"""Distance from an end of the range within which the delay stands there [samples]. Larger warns of
sound delays, smaller overlooks that the search stops just short of its end. Chosen by hand: a
hundred times its accuracy."""
DIFFERENCE_SAMPLES = 0.02
"""Half step of the difference quotient over the delay [samples]. Larger is no slope any more,
smaller drowns in rounding. Chosen by hand."""


@dataclass(frozen=True)
class DelayEstimate:
    """The best delay, and whether it lies at an end of the range that was sought."""

    delay_s: float
    at_end: bool


def estimate_delay(data: RegressionData) -> DelayEstimate:
    """Scan the delay, then refine it; every other parameter is fitted at each trial."""
    trials = delay_trials(data)
    low, high = float(trials[0]), float(trials[-1])
    costs = [unexplained(data, float(delay)) for delay in trials]
    best = int(np.argmin(costs))
    found = minimize_scalar(
        lambda delay: unexplained(data, float(delay)),
        bounds=(trials[max(best - 1, 0)], trials[min(best + 1, len(trials) - 1)]),
        method="bounded",
        options={"xatol": TOLERANCE_SAMPLES * data.period_s},
    )
    delay = float(found.x)
    margin = AT_END_SAMPLES * data.period_s
    return DelayEstimate(delay, delay - low < margin or high - delay < margin)


def delay_trials(data: RegressionData) -> Array:
    """Return the delays of a scan that cannot step over the best."""
    assert data.options.filter_hz is not None
    low, high = delay_range_s(data.options, 1.0 / data.period_s)
    step = 1.0 / (STEPS_PER_PERIOD * data.options.filter_hz)
    return np.linspace(low, high, max(FEWEST_TRIALS, int((high - low) / step) + 2))


def unexplained(data: RegressionData, delay_s: float) -> float:
    """Return |y - X b|^2 / |y|^2 at the best b for this delay."""
    problem = regression(*data.at(delay_s), data.model, data.options.left)
    R = np.asarray(np.linalg.qr(np.column_stack([problem.X, problem.y]), mode="r"))
    return float(R[-1, -1] ** 2 / np.sum(R[:, -1] ** 2))


def delay_sensitivity(data: RegressionData, delay_s: float, theta: Array, left: Side) -> Array:
    """Return -d(y - X b)/d(delay), shape (m,), in units of the left side per second."""
    step = DIFFERENCE_SAMPLES * data.period_s
    residuals = []
    for delay in (delay_s - step, delay_s + step):
        problem = regression(*data.at(delay), data.model, left)
        residuals.append(problem.y - problem.X @ problem.coefficients(theta))
    return np.asarray((residuals[0] - residuals[1]) / (2.0 * step))
