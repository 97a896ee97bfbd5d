"""What physics forbids: negative inertia, friction that gives energy, forces out of all measure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.held_out_blocks import solve
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.parameters import (
    Compensation,
    robust_covariance,
    theta_of,
    values_of,
)
from motorctl.identify.diagnose.search.whole_model import GIVES, friction_power, seen_inertia
from motorctl.model import Effect

Array = NDArray[np.float64]

SURELY = 3.0
"""Standard errors by which a parameter that cannot be negative is so. Larger keeps effects of
impossible sign, smaller refutes true ones by chance. Convention: three standard deviations."""
BEYOND = 3.0
"""Force of an effect over the largest command, from which it is extrapolated from a corner of its
own shape and cannot be. Larger lets such pass, smaller refutes forces that cancel others. Chosen by
hand."""
MATTERS_LITTLE = 0.95
"""Part of what an effect takes that it must take without its negative parameters, to stand without
them. Larger refutes effects for a parameter that is little to them, smaller keeps effects that live
on what cannot be. Chosen by hand: a dry friction of another author's loses 0.003."""
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
        return effect, (
            f"{effect.name} is refuted: with it the inertia would be negative"
            f"{_friction_drives_too(hypothesis)}"
        )
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
            part = parameter.unit == "1" and parameter.upper <= 1.0
            if part and value - SURELY * sigma > WHOLE:
                return own, (
                    f"{effect.name} is refuted: {effect.full_name(parameter)} would be "
                    f"{value:.3g}, and no more than all of it, 1, can be lost"
                )
        force = _largest_force(hypothesis, effect, theta)
        if force > BEYOND * largest and force > BEYOND * (resisting := _resisting(hypothesis)):
            return own, (
                f"{effect.name} is refuted: its force would be {force:.3g}; the largest command of "
                f"the recording is {largest:.3g}, and inertia resists with {resisting:.3g} at most"
            )
    return None


def _friction_drives_too(hypothesis: Hypothesis) -> str:
    """Return what to check where friction drives as well: gravity alone has either sign."""
    if friction_power(hypothesis).given <= GIVES:
        return ""
    return (
        ", and its friction would drive the axis: where both are so beside a force that explains "
        "much, the sign of the command or of the position may be reversed in the recording"
    )


def holding_negatives(hypothesis: Hypothesis, name: str) -> Hypothesis | None:
    """Return a model without the negative ones of an effect's parameters, where they do not matter.

    A friction's damping may come out a little below zero where its form is not quite the machine's.
    None where none is negative, all are, or the model is much worse without them.
    """
    effect = next(e for e in hypothesis.added if e.name == name)
    values = values_of(hypothesis)
    theta, error = theta_of(values, next(e for e in values.model.effects if e.name == name))
    negative = [
        parameter.name
        for parameter, value, sigma in zip(effect.parameters, theta, error, strict=True)
        if parameter.lower >= 0.0 and value < -SURELY * sigma
    ]
    if not negative or len(negative) + len(effect.held) == len(effect.parameters):
        return None
    held = hypothesis.exchanged(effect.holding(negative))
    without = hypothesis.without(name).held_out
    taken = without - hypothesis.held_out
    return held if without - held.held_out > MATTERS_LITTLE * taken else None


def physical(hypothesis: Hypothesis, name: str) -> Hypothesis | None:
    """Return a model with an effect of a form that physics allows, or None."""
    if beyond_physics(hypothesis) is None:
        return hypothesis
    held = holding_negatives(hypothesis, name)
    return held if held is not None and beyond_physics(held) is None else None


def _largest_force(hypothesis: Hypothesis, effect: Effect, theta: Array) -> float:
    """Return the largest force of an effect of which a parameter is one.

    Of a force of position only its changes over the places that were visited count: what a spline
    would be elsewhere, or holds against the offset, is no force of this recording.
    """
    if "force_of_position" in effect.groups and effect.kind == "state":
        signals = hypothesis.regressors.signals
        step = signals.decimation
        parts = [
            theta @ s.columns(effect, step=step)[:, kept]
            for s, kept in zip(signals.stretches, signals.kept, strict=True)
        ]
        force = np.concatenate(parts)
        return float(np.abs(force - force.mean()).max())
    forces = [abs(v) for v, p in zip(theta, effect.parameters, strict=True) if p.unit == "V"]
    return float(max(forces, default=0.0))


def _resisting(hypothesis: Hypothesis) -> float:
    """Return the largest force with which the inertia resists along the motion; 0 where unseen.

    What swings freely passes places where its weight is many times its motor's command. Its inertia
    is the least that is seen beside any function of place and of speed, whatever the effects.
    """
    base = Hypothesis(hypothesis.regressors)
    seen = seen_inertia(base)
    if seen is None:
        return 0.0
    rows = base.problem.joined(hypothesis.regressors.signals.rows)
    acceleration = rows[0] if hypothesis.regressors.side == "command" else rows[-1]
    return seen.low * float(np.max(np.abs(acceleration)))


def inertia_is_negative(hypothesis: Hypothesis) -> bool:
    """Return whether a model's inertia is negative.

    With the command on the left it may be too small to be seen, beside a weight that is held. Not
    so where the command comes late: inertia is a lag of the velocity, and less than none makes room
    for one that is not there.
    """
    if hypothesis.regressors.side == "acceleration":
        return float(hypothesis.b[0]) <= 0.0
    found, problem = hypothesis.solution, hypothesis.problem
    sigma = float(np.sqrt(robust_covariance(problem, found)[0, 0]))
    surely = float(found.b[0]) < -SURELY * sigma
    if any(effect.kind == "command" for effect in hypothesis.added):
        return surely
    return surely and inertia_is_seen(hypothesis)


def inertia_is_seen(hypothesis: Hypothesis) -> bool:
    """Return whether inertia asks for a part of the command that tells its sign."""
    rows = hypothesis.problem.joined(hypothesis.regressors.signals.rows)
    first, last = float(np.std(rows[0])), float(np.std(rows[-1]))
    gain = abs(float(hypothesis.solution.b[0]))
    if hypothesis.regressors.side == "command":  # the acceleration is the first, the command last
        return gain * first > SEEN * last
    return last > SEEN * gain * first


def is_physical(hypothesis: Hypothesis, beside: Compensation) -> bool:
    """Return whether a model with a nameless function beside it has an inertia and fit forces."""
    if solve(beside[1]).b[0] <= 0.0:
        return False
    theta, _ = theta_of(values_of(hypothesis, beside), beside[0])
    force = _largest_force(hypothesis, beside[0], theta)
    largest = hypothesis.regressors.signals.largest_command
    return force <= BEYOND * largest or force <= BEYOND * _resisting(hypothesis)
