"""Identification by instrumental variables built from the reference.

In closed loop neither side of the equation is free of noise: measurement noise comes back into
the command through the feedback, and an undeclared force (cogging, say) makes the controller
answer in the command. Least squares is biased by one or the other. Columns formed from the
reference, and from the command that the model asks for there, are correlated with neither
(P. C. Young, "Recursive Estimation and Time-Series Analysis", 2011, ch. 6; A. Janot,
P.-O. Vandanjon, M. Gautier, "A Generic Instrumental Variable Approach for Industrial Robot
Identification", IEEE TCST 22(1), 2014). With those columns as instruments Z, and Q an orthonormal
basis of them, the two-stage estimate minimises |Q'(u - psi theta)| over theta and the delay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from motorctl.identify.columns.filters import acceleration_of, velocity_of
from motorctl.identify.columns.stretches import Stretch, command_for
from motorctl.identify.fit.delay import TOLERANCE_SAMPLES, delay_sensitivity, delay_trials
from motorctl.identify.fit.regression_data import RegressionData, delay_range_s, prepare
from motorctl.identify.fit.result import FitEstimate
from motorctl.identify.fit.standard_errors import sandwich

Array = NDArray[np.float64]

ROUNDS = 4
"""Times that the instruments are formed anew from the last estimate, at most. More takes time where
it hardly changes any more, fewer leaves the instruments those of the biased first estimate. Chosen
by hand."""
SETTLED = 0.1
"""Change of every parameter, in standard errors, below which no further round is made. Larger stops
early, smaller takes rounds that nobody sees in the figures. Chosen by hand."""
SMALLEST_SINGULAR_VALUE = 1e-7
"""Singular value of the normalised instruments, relative to the largest, below which they repeat
each other. Larger drops instruments that tell parameters apart, smaller inverts rounding. Chosen by
hand: its square, which stands in the normal equations, is 1e-14, still above a double's 2e-16."""
SHIFTS_PER_PERIOD = 8
"""Part of the period of the band's end, as one over this, by which the command's instruments stand
earlier and later too, to tell the delay. More makes them nearly alike, fewer takes them beyond what
is straight over the delay. Chosen by hand: an eighth of a period."""


def by_instruments(
    columns: RegressionData, start: FitEstimate, bandwidth_rows: int
) -> FitEstimate | None:
    """Identify with instruments; None where the reference is unknown or does not excite.

    `start` is what least squares found on the same rows.
    """
    data = columns.data
    if data.reference is None or not np.all(np.isfinite(data.reference[data.usable])):
        return None
    found = start
    for _ in range(ROUNDS):
        ideal = _noise_free(columns, found.theta)
        if ideal is None:
            return None
        before = found
        improved = _two_stage(columns, _basis(ideal, found.delay_s), before, bandwidth_rows)
        if improved is None:
            return None
        found = improved
        if np.all(np.abs(found.theta - before.theta) <= SETTLED * found.std_error):
            break
    return found


def _two_stage(
    columns: RegressionData, Q: Array, start: FitEstimate, bandwidth_rows: int
) -> FitEstimate | None:
    n = len(start.theta)
    estimated = columns.options.estimate_delay
    if Q.shape[1] < n + estimated:
        return None

    def solved(delay_s: float) -> tuple[Array, float]:
        psi, command = columns.at(delay_s)
        A, y = Q.T @ psi, Q.T @ command
        scale = _lengths(A)
        theta = np.linalg.lstsq(A / scale, y, rcond=None)[0] / scale
        return theta, float(np.sum((y - A @ theta) ** 2))

    delay_s = start.delay_s
    if estimated:
        trials = delay_trials(columns)
        best = int(np.argmin([solved(float(trial))[1] for trial in trials]))
        around = (trials[max(best - 1, 0)], trials[min(best + 1, len(trials) - 1)])
        tolerance = TOLERANCE_SAMPLES * columns.period_s
        delay_s = float(
            minimize_scalar(
                lambda delay: solved(float(delay))[1],
                bounds=around,
                method="bounded",
                options={"xatol": tolerance},
            ).x
        )
    theta, _ = solved(delay_s)
    psi, command = columns.at(delay_s)
    J = psi
    if estimated:
        J = np.column_stack([psi, delay_sensitivity(columns, delay_s, theta, "command")])
    projected = Q.T @ J
    scale = _lengths(projected)
    curvature = (projected / scale).T @ (projected / scale)
    if np.linalg.cond(curvature) > 1.0 / SMALLEST_SINGULAR_VALUE**2:
        return None
    bread = np.linalg.inv(curvature) / np.outer(scale, scale)
    scores = (Q @ projected) * (command - psi @ theta)[:, None]
    covariance = np.zeros((n + 1, n + 1))
    size = J.shape[1]
    covariance[:size, :size] = sandwich(bread, scores, bandwidth_rows)
    return FitEstimate(theta, delay_s, covariance)


def _basis(ideal: RegressionData, delay_s: float) -> Array:
    """Return an orthonormal basis (m, k) of the instruments."""
    assert ideal.options.filter_hz is not None
    low, high = delay_range_s(ideal.options, 1.0 / ideal.period_s)
    shift = 1.0 / (SHIFTS_PER_PERIOD * ideal.options.filter_hz)
    psi, command = ideal.at(delay_s)
    parts = [psi, command[:, None]]
    if ideal.options.estimate_delay:
        for shifted in (delay_s - shift, delay_s + shift):
            psi, command = ideal.at(min(max(shifted, low), high))
            parts += [command[:, None], psi[:, ideal.input_index]]
    Z = np.column_stack(parts)
    U, s, _ = np.linalg.svd(Z / _lengths(Z), full_matrices=False)
    return np.asarray(U[:, s > SMALLEST_SINGULAR_VALUE * s[0]])


def _noise_free(columns: RegressionData, theta: Array) -> RegressionData | None:
    """Form the same rows from the reference and the command that the model asks for there."""
    data = columns.data
    assert data.reference is not None
    options = columns.options.with_changes(friction_velocity="measured", rest_velocity=0.0)
    formed = prepare(replace(data, position=data.reference), columns.model, options)
    limit = float(np.max(np.abs(data.command[data.usable])))
    stretches = tuple(_ideal(s, columns, theta, limit) for s in formed.stretches)
    formed = formed.with_stretches(stretches).rows(np.isin(formed.time_s, columns.time_s))
    return formed if len(formed.time_s) == len(columns.time_s) else None


def _ideal(s: Stretch, columns: RegressionData, theta: Array, limit: float) -> Stretch:
    """Return a stretch of the reference with the command that the model asks for there."""
    v = velocity_of(s.position, columns.period_s)  # unsmoothed, as the command is
    a = acceleration_of(s.position, v, columns.period_s, columns.options.derivative)
    motion = replace(s, x=s.position, v=v, quiet=v)
    return replace(s, command=command_for(motion, columns.model, theta, a, limit))


def _lengths(columns: Array) -> Array:
    lengths = np.linalg.norm(columns, axis=0)
    return np.where(lengths > 0.0, lengths, 1.0)
