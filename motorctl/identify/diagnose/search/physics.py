"""What physics forbids: negative inertia, friction that gives energy, forces out of all measure."""

from __future__ import annotations

import numpy as np

from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.parameters import theta_of, values_of
from motorctl.model import Effect

SURELY = 3.0
"""Standard errors by which a parameter that cannot be negative is so. Convention: three standard
deviations."""
BEYOND = 3.0
"""Force of an effect over the largest command, from which it is extrapolated from a corner of its
own shape and cannot be. Larger lets such pass, smaller refutes forces that cancel others. Chosen by
hand."""


def beyond_physics(hypothesis: Hypothesis) -> tuple[Effect, str] | None:
    """Find an added effect with a parameter of a sign that makes no physical sense."""
    if float(hypothesis.b[0]) <= 0.0:
        effect = hypothesis.added[-1]
        return effect, f"{effect.name} is refuted: with it the inertia would be negative"
    values = values_of(hypothesis)
    stretches = hypothesis.regressors.signals.stretches
    largest = max(float(np.abs(s.command).max()) for s in stretches)
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
            if parameter.unit == "V" and abs(value) > BEYOND * largest:
                return own, (
                    f"{effect.name} is refuted: its force would be {abs(value):.3g}, and the "
                    f"largest command of the recording is {largest:.3g}"
                )
    return None
