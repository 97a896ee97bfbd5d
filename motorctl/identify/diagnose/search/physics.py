"""What physics forbids: negative inertia, friction that gives energy, forces out of all measure."""

from __future__ import annotations

import numpy as np

from motorctl.identify.diagnose.search.held_out_blocks import solve
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.parameters import (
    Compensation,
    robust_covariance,
    theta_of,
    values_of,
)
from motorctl.model import Effect

SURELY = 3.0
"""Standard errors by which a parameter that cannot be negative is so. Convention: three standard
deviations."""
BEYOND = 3.0
"""Force of an effect over the largest command, from which it is extrapolated from a corner of its
own shape and cannot be. Larger lets such pass, smaller refutes forces that cancel others. Chosen by
hand."""
WHOLE = 1.2
"""A part of the command or of a force, from which it is more than all of it. Larger lets forms
pass that are not what they are named for, smaller refutes true ones whose limit is rounded off.
Chosen by hand."""
SEEN = 0.05
"""Part of the command that inertia must ask for to be seen: below it, its sign says nothing.
Larger lets models pass that could not move, smaller refutes weights that are held. Chosen by
hand."""


def beyond_physics(hypothesis: Hypothesis) -> tuple[Effect, str] | None:
    """Find an added effect with a parameter of a sign that makes no physical sense."""
    if inertia_is_negative(hypothesis):
        effect = hypothesis.added[-1]
        return effect, f"{effect.name} is refuted: with it the inertia would be negative"
    values = values_of(hypothesis)
    largest = hypothesis.regressors.signals.largest_command
    for own in hypothesis.added:
        effect = next(e for e in values.model.effects if e.name == own.name)
        theta, error = theta_of(values, effect)
        for parameter, value, sigma in zip(effect.parameters, theta, error, strict=True):
            if parameter.lower >= 0.0 and value < -SURELY * sigma:
                name = effect.full_name(parameter)
                return own, (
                    f"{effect.name} is refuted: {name} would be {value:.3g} {parameter.unit}, and "
                    "less than 0 makes no physical sense"
                )
            if parameter.unit == "1" and value - SURELY * sigma > WHOLE:
                return own, (
                    f"{effect.name} is refuted: {effect.full_name(parameter)} would be "
                    f"{value:.3g}, and no more than all of it, 1, can be lost"
                )
            if parameter.unit == "V" and abs(value) > BEYOND * largest:
                return own, (
                    f"{effect.name} is refuted: its force would be {abs(value):.3g}, and the "
                    f"largest command of the recording is {largest:.3g}"
                )
    return None


def inertia_is_negative(hypothesis: Hypothesis) -> bool:
    """Return whether a model's inertia is negative.

    With the command on the left it may be too small to be seen, beside a weight that is held.
    """
    if hypothesis.regressors.side == "acceleration":
        return float(hypothesis.b[0]) <= 0.0
    found, problem = hypothesis.solution, hypothesis.problem
    sigma = float(np.sqrt(robust_covariance(problem, found)[0, 0]))
    rows = problem.joined(hypothesis.regressors.signals.rows)
    part = abs(float(found.b[0])) * np.std(rows[0]) / max(float(np.std(rows[-1])), 1e-300)
    return float(found.b[0]) < -SURELY * sigma and bool(part > SEEN)


def is_physical(hypothesis: Hypothesis, beside: Compensation) -> bool:
    """Return whether a model with a nameless function beside it has an inertia and fit forces."""
    if solve(beside[1]).b[0] <= 0.0:
        return False
    force, _ = theta_of(values_of(hypothesis, beside), beside[0])
    return bool(np.abs(force).max() <= BEYOND * hypothesis.regressors.signals.largest_command)
