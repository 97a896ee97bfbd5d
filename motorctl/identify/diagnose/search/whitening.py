"""The noise of the rows: quantisation of the position, and the force noise of the machine.

One-sided density of the acceleration's noise: (2 pi f)^4 rho + sigma^2, with rho that of the
position's noise and sigma^2 fitted to what a saturated model leaves in a quiet band. Fitting an
autoregression instead would notch a real disturbance away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from motorctl.identify.columns.signals import Response, Signals, low_pass_response
from motorctl.identify.diagnose.search.held_out_blocks import residual, solve, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.smooth_functions import SmoothFunctions

Array = NDArray[np.float64]

QUIET_PERCENT = 30.0
"""Percentile of the residual's spectrum that is taken for the force noise's density. Larger takes
effects for noise, smaller underrates the noise. Chosen by hand."""
LEAST_SHARE = 0.1
"""The force noise is taken for at least the quantisation's at this part of the band. Larger hides
weak effects, smaller trusts a spectrum that happens to be empty. Chosen by hand."""
SATURATING = ("position", "velocity", "time", "position_and_command", "history")


def saturated_residual(hypothesis: Hypothesis, rivals: SmoothFunctions) -> Array:
    """Return what the model and smooth functions of position, velocity, time leave, (m,).

    With the command on the left no functions of the command, which would leave nothing of it.
    """
    problem = hypothesis.problem
    mine = SATURATING if hypothesis.regressors.side == "acceleration" else SATURATING[:3]
    columns = [rivals.columns(name) for name in mine]
    problem = with_columns(problem, np.vstack(columns), soft=True)
    found = solve(problem)
    return residual(problem, found.b)[: hypothesis.regressors.signals.rows]


def spectrum(rows: Array, row_period_s: float) -> tuple[Array, Array]:
    """Return frequencies [Hz] and one-sided density of rows, the median over windows."""
    window = min(len(rows), max(64, int(1.0 / row_period_s)))
    frequency, density = signal.welch(
        rows, 1.0 / row_period_s, nperseg=window, average="median", detrend=False
    )
    return np.asarray(frequency), np.asarray(density)


def force_noise_density(signals: Signals, left_over: Array) -> float:
    """Estimate the flat part of the acceleration's noise density [unit^2/s^4/Hz].

    left_over (m,) comes from rows behind the plain low pass of `signals`.
    """
    frequency, density = spectrum(left_over, signals.row_period_s)
    quantisation = (2.0 * np.pi * frequency) ** 4 * signals.position_noise
    inside = (frequency > 2.0) & (frequency < 0.9 * signals.band_hz)
    excess = density[inside] - quantisation[inside]
    quiet = quantisation[inside] < density[inside]
    least = (2.0 * np.pi * LEAST_SHARE * signals.band_hz) ** 4 * signals.position_noise
    if quiet.sum() < 5:
        return float(max(least, 1e-300))
    return float(max(np.percentile(excess[quiet], QUIET_PERCENT), least, 1e-300))


def whitening_response(signals: Signals, force_noise: float) -> Response:
    """Return the low pass with a gain that falls where quantisation exceeds the force noise."""
    low_pass = low_pass_response(signals.band_hz)

    def response(frequency: Array) -> Array:
        ratio = (2.0 * np.pi * frequency) ** 4 * signals.position_noise / force_noise
        return np.asarray(low_pass(frequency) / np.sqrt(1.0 + ratio))

    return response
