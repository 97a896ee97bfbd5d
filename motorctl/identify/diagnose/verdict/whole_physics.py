"""What physics says of the model with all that was found, for people and scripts."""

from __future__ import annotations

import math
from collections.abc import Sequence

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.result import FoundEffect, WholeModel
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.parameters import FittedModel, theta_of, values_of
from motorctl.identify.diagnose.search.refutation import beside_driving_friction
from motorctl.identify.diagnose.search.search import Found, declared_alone
from motorctl.identify.diagnose.search.whole_model import (
    OF_INERTIA,
    beside_what_hides_it,
    friction_power,
    inertia_of,
    seen_inertia,
)
from motorctl.model.knowledge import Signal

SURELY = 5.0
"""Standard errors below zero from which an inertia or a damping is called negative. Larger tells
few engineers to look, smaller sends some to look for nothing. Convention: five sigma."""


def whole_model(found: Found, final: Hypothesis) -> WholeModel:
    """Return what physics says of the final model, with the parameters that are told of it."""
    seen = seen_inertia(beside_what_hides_it(found.base, found.final))
    data = final.regressors.signals.data
    return WholeModel(
        inertia=inertia_of(final),
        unit=data.unit(OF_INERTIA),
        seen_inertia=None if seen is None else (seen.low, seen.high),
        declared_inertia=data.inertia,
        friction_gives=friction_power(final).given,
    )


def without_impossible(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without any name where the whole model cannot be, and why."""
    found, drives = beside_driving_friction(found)
    found, pushes = beside_negative_inertia(found)
    return found, (*drives, *pushes)


def beside_negative_inertia(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without any name where the inertia is surely negative, and why.

    No machine has such an inertia. What was found beside it may be there, with the other sign or
    behind a command that is late.
    """
    final = found.final
    inertia = _value_of(values_of(final), "acceleration")
    if not final.added or inertia is None or not _is_negative(*inertia):
        return found, ()
    value, error = inertia
    data = final.regressors.signals.data
    unit = data.unit(OF_INERTIA)
    names = " and ".join(effect.name for effect in final.added)
    return declared_alone(found), (
        f"{names}: not named, for the inertia beside comes to {value:.3g} ± {error:.2g} {unit}, "
        "and no machine has a negative one: the sign of the command or of the position may be "
        "reversed in the recording, the command may be recorded late, or something else drives the "
        "axis",
    )


def wrong_sign_told(alone: FittedModel, data: Measured) -> tuple[str, ...]:
    """Return what a declared model says of a sign that no machine has, for an engineer to check.

    Beside a sure inertia a negative damping says nothing of signs: any delay has one.

    Parameters
    ----------
    alone
        The declared model, fitted without anything that was found.
    data
        The recording, which has the units.
    """
    signals: tuple[Signal, ...] = ("acceleration", "velocity")
    for of in signals:
        found = _value_of(alone, of)
        if found is None:
            continue
        value, error = found
        if _is_negative(value, error):
            return (
                f"{_in_words(alone, of, data)} in the declared model, and no machine has a "
                f"negative one: {_why_negative(alone, of)}",
            )
        if of == "acceleration" and value > SURELY * error:
            break
    return ()


def _why_negative(alone: FittedModel, of: Signal) -> str:
    """Return what to look at: a sign that is reversed turns friction over with the inertia."""
    force = "a force that the model lacks drives the axis"
    reversed_sign = "the sign of the command or of the position may be reversed in the recording"
    found = [_value_of(alone, signal) for signal in ("velocity", "direction")]
    friction = [value for value in found if value is not None]
    if of == "acceleration" and friction:
        if all(_is_negative(*value) for value in friction):
            return (
                f"friction is negative as well, so {reversed_sign} (give its column a scale of "
                f"-1), or {force}"
            )
        if all(value > SURELY * error for value, error in friction):
            return (
                "friction brakes, so no sign is reversed; the command may be recorded earlier or "
                f"later than it acted, or {force}"
            )
    return f"{reversed_sign}, or {force}"


def negative_damping(alone: FittedModel, data: Measured) -> str | None:
    """Return in words a damping that is surely negative, None where there is none.

    Parameters
    ----------
    alone
        A model without anything that was found.
    data
        The recording, which has the units.
    """
    damping = _value_of(alone, "velocity")
    if damping is None or not _is_negative(*damping):
        return None
    return _in_words(alone, "velocity", data)


def _value_of(fitted: FittedModel, signal: Signal) -> tuple[float, float] | None:
    """Return the parameter of a signal's basic effect and its standard error; None without one."""
    place = fitted.model.index_of(signal)
    if place is None:
        return None
    return float(fitted.theta[place]), float(fitted.std_error[place])


def _is_negative(value: float, error: float) -> bool:
    """Return whether a parameter is surely below zero."""
    return value < -SURELY * error < 0.0


def _in_words(fitted: FittedModel, signal: Signal, data: Measured) -> str:
    effect = next(e for e in fitted.model.effects if e.proportional_to == signal)
    theta, std_error = theta_of(fitted, effect)
    unit = data.unit(effect.parameters[0].unit)
    return f"{effect.name} comes to {theta[0]:.3g} ± {std_error[0]:.2g} {unit}"


def whole_told(whole: WholeModel, effects: Sequence[FoundEffect]) -> tuple[str, ...]:
    """Return that in words, where something was named."""
    if not effects:
        return ()
    friction = "gives no energy that is sure at any speed"
    if whole.friction_gives > 0.0:
        friction = (
            f"gives {100.0 * whole.friction_gives:.3g} % of the energy that passes between "
            "command and motion"
        )
    if not 0.0 < whole.inertia < math.inf:
        return (f"the whole model: its friction {friction}; its inertia is too small to be seen",)
    between = ""
    if whole.seen_inertia is not None:
        low, high = whole.seen_inertia
        between = (
            f", and {low:.3g} to {high:.3g} are seen beside any function of place and of speed"
        )
    inertia = f"is {whole.inertia:.3g} {whole.unit}"
    return (f"the whole model: its friction {friction}; its inertia {inertia}{between}",)
