"""Whether an identification can be believed: errors that stop it, and notes that go with it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured, check_usable
from motorctl.identify.fit.least_squares import LeastSquares
from motorctl.identify.fit.regression import Regression, Solution, regression, solve
from motorctl.identify.fit.regression_data import prepare
from motorctl.identify.fit.result import AxisFit, FitError
from motorctl.identify.fit.settings import FitOptions
from motorctl.identify.fit.standard_errors import sandwich
from motorctl.model import EffectList, basic_effects, known_effects

SIGNIFICANT = 3.0
"""Standard errors from which inertia has a sign. Larger refuses gentle motion, smaller believes a
sign that noise made. Convention: three standard deviations."""
INDISTINCT = 2.0
"""Standard errors below which a note says that a parameter may as well be zero. Larger doubts true
terms, smaller keeps silent about chance ones. Convention: two standard deviations."""
ILL_CONDITIONED = 1e3
"""Condition number of the normalised columns from which a note warns. Larger keeps silent about
poor motions, smaller warns of good ones. Chosen by hand."""
POORLY_DETERMINED = 0.02
"""Part of the command's rms that a term moves within its standard error, from which a note says so.
Larger keeps silent about motions that show too little, smaller warns of errors that no controller
feels. Chosen by hand."""
BAD_ERROR = 0.5
"""Relative error of the command beyond which the model does not describe the recording. Larger lets
wrong data pass, smaller warns of rough machines. Chosen by hand."""
GOOD_ERROR = 0.3
"""Relative error below which another reading of the columns explains the recording. Larger suspects
mistakes too often, smaller misses them. Chosen by hand."""
PLACES = 12
"""Splines over the travel that stand for any smooth force of position. More takes time and freedom,
fewer misses a weight that changes within a tenth of the travel. Chosen by hand."""
TAKES_PART = 0.2
"""Weight in a weak direction from which a parameter is named. Larger leaves some out, smaller names
all. Chosen by hand."""
CORRELATED_PARTS = 50
"""Part of the rows, as one over this, whose residuals count as correlated where only the sign of
inertia is asked. Larger trusts signs that slow forces make, smaller leaves too few independent rows
to tell any. Chosen by hand."""
MAP_POINTS = 201
"""Commands from the largest down to its negative at which the input map's slope is looked at. More
takes time, fewer may step over a kink. Chosen by hand: steps of a hundredth of the largest."""


class NothingExplainedError(DataError):
    """The command seems to have nothing to do with the motion."""


class ReversedSignError(DataError):
    """The command seems to drive the position backwards."""


class ForceOfPlaceError(DataError):
    """A force of the place that the model lacks outweighs inertia."""


class EntangledInputError(DataError):
    """Inertia cannot be told from the electromagnetic effects."""


def check_direction(
    data: Measured,
    model: EffectList,
    problem: Regression,
    solution: Solution,
    bandwidth_rows: int,
) -> None:
    """Raise DataError where the command does not drive the acceleration, or drives it backwards."""
    if problem.inertia is None:
        return
    b = solution.b[problem.inertia]
    scores = problem.X * solution.residual[:, None]
    variance = sandwich(solution.bread, scores, bandwidth_rows)[problem.inertia, problem.inertia]
    error = math.sqrt(max(variance, 0.0))
    if b > SIGNIFICANT * error:
        return
    check_exchanged(data, None, FitOptions())
    if _drives_beside_place(data, model):
        raise ForceOfPlaceError(
            f"{data.place}: a force of the place, such as a weight, that the model does not "
            "declare outweighs inertia: with any smooth force of position beside it the inertia is "
            "positive; motorctl diagnose names it, and the model can declare it then"
        )
    if b < -SIGNIFICANT * error:
        raise ReversedSignError(
            f"{data.place}: a positive command accelerates towards negative positions: the sign "
            "of one of the two is reversed; reverse it in the recording"
        )
    entangled = [effect.name for effect in model.effects if effect.electromagnetic]
    if entangled and _drives(data, model.without_electromagnetic()):
        raise EntangledInputError(
            f"{data.place}: it cannot tell inertia from {' and '.join(entangled)}: without them "
            "the command does accelerate the axis; give a recording that accelerates at several "
            "levels, or fit a model without them"
        )
    raise NothingExplainedError(
        f"{data.place}: the command explains none of the acceleration; are these the position "
        "and the command of the same axis, in time with each other?"
    )


def _drives_beside_place(data: Measured, model: EffectList) -> bool:
    """Return whether inertia is positive once any smooth force of position is in the model."""
    x = data.position[data.usable]
    knots = (float(x.min()), float(x.max()), PLACES)
    present = {effect.name for effect in model.effects}
    beside = [
        effect
        for name, cls in known_effects().items()
        if name not in present and (effect := cls.over_place(knots)) is not None
    ]
    return bool(beside) and _drives(data, EffectList([*model.effects, *beside]))


def _drives(data: Measured, model: EffectList) -> bool:
    """Return whether inertia is positive in a model, whatever slow forces are besides."""
    try:
        columns = prepare(data, model, FitOptions())
    except DataError:
        return False
    psi, command = columns.at(0.0)
    found = regression(psi, command, columns.model, "acceleration")
    if found.inertia is None:
        return False
    solution = solve(found)
    scores = found.X * solution.residual[:, None]
    variance = sandwich(solution.bread, scores, len(scores) // CORRELATED_PARTS)[
        found.inertia, found.inertia
    ]
    return bool(solution.b[found.inertia] > SIGNIFICANT * math.sqrt(max(variance, 0.0)))


def check_exchanged(data: Measured, error: FitError | None, options: FitOptions) -> None:
    """Raise DataError where position and command make sense only the other way round."""
    if error is not None and error.relative < BAD_ERROR:
        return
    other = replace(
        data, position=data.command, command=data.position, reference=None,
        reference_velocity=None, saturated=None, resolution=None,
    )  # fmt: skip
    basic = basic_effects()
    model = EffectList([basic["acceleration"](), basic["velocity"](), basic["one"]()])
    choices = options.with_changes(
        fit_segments=None, held_out_segments=None, left="acceleration", estimate_delay=False
    )
    try:
        check_usable(other)
        columns = prepare(other, model, choices)
    except DataError:
        return
    psi, command = columns.at(0.0)
    problem = regression(psi, command, model, "acceleration")
    b = solve(problem).b
    unexplained = np.linalg.norm(command - psi @ problem.theta(b)) / np.linalg.norm(command)
    if b[0] > 0.0 and unexplained < GOOD_ERROR:
        raise DataError(
            f"{data.place}: position and command seem to be exchanged: the other way round the "
            f"model leaves only {100 * unexplained:.0f} % of the command; exchange the two columns"
        )


def judge(fit: AxisFit, found: LeastSquares) -> AxisFit:
    """Add the notes that a reader of the numbers needs."""
    notes = [
        *fit.notes,
        *_bound_notes(fit),
        *_excitation_notes(fit, found.solution),
        *_instrument_notes(fit),
        *_map_notes(fit),
    ]
    if fit.model.index_of("acceleration") is None and fit.options.left == "acceleration":
        notes.append("the model has no inertia, so the regression has the command on its left side")
    if found.delay_at_end and fit.estimator == "least_squares":
        notes.append(
            f"the input delay is at the end of the range searched ({1e3 * fit.delay_s:.3g} ms): "
            "widen delay_range_s"
        )
    if fit.error.relative > BAD_ERROR:
        notes.append(
            f"the model leaves {100 * fit.error.relative:.0f} % of the command unexplained, more "
            f"than {100 * BAD_ERROR:.0f} %: motorctl diagnose looks for what it lacks"
        )
    return replace(fit, notes=tuple(notes))


def _bound_notes(fit: AxisFit) -> list[str]:
    return [
        f"{name} would leave its physical bounds and is held at the {bound} one"
        for name, bound in fit.estimate.at_bound.items()
    ]


def _excitation_notes(fit: AxisFit, solution: Solution) -> list[str]:
    names = np.array(fit.model.parameter_names)
    notes = [
        f"this motion cannot tell apart: {', '.join(names[np.abs(direction) > TAKES_PART])}"
        for direction in solution.open_directions
    ]
    if not notes and solution.condition > ILL_CONDITIONED:
        notes.append(
            f"poor excitation: the regressor's condition number is {solution.condition:.0f}, above "
            f"{ILL_CONDITIONED:.0f}: record a motion with more speeds and accelerations"
        )
    psi, command = fit.columns.at(fit.delay_s)
    effects = [effect for effect in fit.model.effects for _ in effect.parameters]
    sizes = fit.std_error * np.sqrt(np.mean(psi**2, axis=0)) / np.sqrt(np.mean(command**2))
    for name, effect, size in zip(names, effects, sizes, strict=True):
        if size > POORLY_DETERMINED:
            notes.append(
                f"{name} is poorly determined: its standard error is {100 * size:.1f} % of the "
                f"command, above {100 * POORLY_DETERMINED:.0f} %; it becomes visible in "
                f"{effect.visible_in}"
            )
    vague = [
        name
        for name, value, error in zip(names, fit.theta, fit.std_error, strict=True)
        if name not in fit.estimate.at_bound and abs(value) < INDISTINCT * error
    ]
    if vague:
        notes.append(f"less than {INDISTINCT:g} standard errors from zero: {', '.join(vague)}")
    return notes


def _instrument_notes(fit: AxisFit) -> list[str]:
    differs = fit.disagreement()
    if not differs.any():
        return []
    names = ", ".join(np.array(fit.model.parameter_names)[differs])
    taken = fit.estimator.replace("_", " ")
    return [
        f"least squares and instruments built from the reference disagree on {names}: noise or an "
        f"undeclared effect returns through the feedback; the values are those of {taken}"
    ]


def _map_notes(fit: AxisFit) -> list[str]:
    """Check Assumption 2 over the commands that were used."""
    if not len(fit.columns.input_index):
        return []
    largest = float(np.max(np.abs(fit.data.command[fit.data.usable])))
    u = np.linspace(-largest, largest, MAP_POINTS)
    if np.all(np.diff(fit.model.input_over(u, fit.theta)[0]) > 0.0):
        return []
    return [
        f"the input map v(u) is not strictly monotonic up to {largest:.3g} {fit.data.command_unit}:"
        " a controller cannot invert it"
    ]
