"""The list of effects of one axis, and the start values of its parameters."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from motorctl.config.document import Document, KeyPath
from motorctl.config.machine import Estimate
from motorctl.config.rules import check_range
from motorctl.config.shape import EffectShape, ParameterShape, options_of
from motorctl.config.validation import shown, suggest, validate, validate_options
from motorctl.errors import UsageError
from motorctl.model import Effect, EffectList, Parameter, effect_class, known_effects

MOST_PARAMETERS = 64


@dataclass(frozen=True)
class AxisModel:
    """What the key `model` of an axis says."""

    declared: EffectList
    estimates: tuple[Estimate, ...]
    """One for each parameter of `declared`."""
    resolved: dict[str, Any]

    def estimates_of(self, model: EffectList) -> tuple[Estimate, ...]:
        """Give the estimates of a part of the declared list, in its order."""
        known = dict(zip(self.declared.parameter_names, self.estimates, strict=True))
        return tuple(known[name] for name in model.parameter_names)


def build_model(document: Document, path: KeyPath) -> AxisModel | None:
    """Build the list that stands at `path`; None, with its problems noted, where it is wrong.

    Problems of shape are noted by whoever validates the whole document.
    """
    parts = document.at(path)
    if not isinstance(parts, dict) or not parts:
        return None
    before = len(document.problems)
    effects: list[Effect] = []
    estimates: list[Estimate] = []
    resolved: dict[str, Any] = {}
    for name, part in parts.items():
        where = (*path, name)
        shape = _readable(document, where, part)
        effect = _effect(document, where, name, shape)
        if effect is None:
            continue
        own = list(_estimates(document, where, effect, shape))
        effects.append(effect)
        estimates += own
        resolved[name] = _resolved(effect, shape, own)
    if "inertia" not in parts:
        document.add(path, "has no inertia; the law needs theta1 to accelerate a mass")
    if len(estimates) > MOST_PARAMETERS:
        document.add(path, f"{len(estimates)} parameters; at most {MOST_PARAMETERS} are possible")
    if len(document.problems) > before or len(effects) < len(parts):
        return None
    return AxisModel(EffectList(effects), tuple(estimates), resolved)


def _readable(document: Document, path: KeyPath, part: Any) -> EffectShape:
    """Give what can be read of an effect, so that the rest is checked where one key is wrong."""
    keys = part if isinstance(part, dict) else {}
    good = {
        key: value
        for key, value in keys.items()
        if validate(document, path, EffectShape, {key: value}, quiet=True)
    }
    return EffectShape.model_validate_json(json.dumps(good))


def _effect(document: Document, path: KeyPath, name: str, shape: EffectShape) -> Effect | None:
    if shape.type is None and name not in known_effects():
        message = f"unknown effect; {suggest(name, known_effects())}"
        document.add(path, f"{message} (an effect of one's own needs type: package.module:Class)")
        return None
    try:
        cls = effect_class(name, shape.type)
    except UsageError as error:
        document.add((*path, "type"), str(error))
        return None
    given = options_of(shape)
    options = validate_options(document, path, cls.Options, given, EffectShape.model_fields)
    if options is None:
        return None
    try:
        effect = cls(options)
        names = [parameter.name for parameter in effect.parameters]
        constants = [float(constant) for constant in effect.constants]
        times_s = (float(effect.lag_s), float(effect.delay_s))
        fits = effect.memory_size >= 0 and all(isinstance(o, str) for o in effect.other_axes)
    except Exception as error:  # an effect of a third party may fail in any way
        document.add(path, f"the effect refuses its options: {type(error).__name__}: {error}")
        return None
    if len(set(names)) < len(names) or not constants:
        document.add(path, "the effect names a parameter twice, or gives no constants")
        return None
    if not fits or not all(0.0 <= time_s < math.inf for time_s in times_s):
        document.add(path, "the effect's memory, other axes, lag or delay are no such thing")
        return None
    return effect


def _estimates(
    document: Document, path: KeyPath, effect: Effect, shape: EffectShape
) -> Iterator[Estimate]:
    """Give the estimate of every parameter, noting what is wrong with it."""
    single = [p for p in effect.parameters if not p.name]
    named = {p.name: p for p in effect.parameters if p.name}
    own = ParameterShape(initial=shape.initial, bounds=shape.bounds, covariance=shape.covariance)
    if not single:
        for key in ParameterShape.model_fields:
            if getattr(own, key) is not None:
                message = "this effect has no parameters that are estimated, only options"
                if named:
                    message = "belongs to one of this effect's parameters; write it under"
                    message += f" parameters: {', '.join(named)}"
                document.add((*path, key), message)
    for name in shape.parameters or {}:
        if name not in named:
            document.add((*path, "parameters", name), f"unknown parameter; {suggest(name, named)}")
    for parameter in effect.parameters:
        if parameter.name:
            where: KeyPath = (*path, "parameters", parameter.name)
            given = (shape.parameters or {}).get(parameter.name, ParameterShape())
        else:
            where, given = path, own
        yield _estimate(document, where, parameter, given)


def _estimate(
    document: Document, path: KeyPath, parameter: Parameter, given: ParameterShape
) -> Estimate:
    lower, upper = given.bounds or (parameter.lower, parameter.upper)
    initial = parameter.initial if given.initial is None else given.initial
    covariance = parameter.covariance if given.covariance is None else given.covariance
    symbol, unit = parameter.symbol, parameter.unit
    if not lower < upper:
        check_range(document, (*path, "bounds"))
    elif given.bounds and (lower < parameter.lower or upper > parameter.upper):
        message = f"found {shown([lower, upper])}, {symbol} can only lie within"
        limits = f"{parameter.lower:g} to {parameter.upper:g} {unit}"
        document.add((*path, "bounds"), f"{message} {limits}")
    elif not lower <= initial <= upper:
        found = f"found {initial:g}" if given.initial is not None else f"default {initial:g}"
        message = f"{found}, {symbol}(0) should lie within its bounds {lower:g} to {upper:g} {unit}"
        document.add((*path, "initial"), message)
    return Estimate(initial, lower, upper, covariance)


def _resolved(effect: Effect, shape: EffectShape, estimates: list[Estimate]) -> dict[str, Any]:
    resolved: dict[str, Any] = {} if shape.type is None else {"type": shape.type}
    named: dict[str, Any] = {}
    for parameter, estimate in zip(effect.parameters, estimates, strict=True):
        values = {
            "initial": estimate.initial,
            "bounds": [estimate.lower, estimate.upper],
            "covariance": estimate.covariance,
        }
        if parameter.name:
            named[parameter.name] = values
        else:
            resolved |= values
    if named:
        resolved["parameters"] = named
    return resolved | effect.options.model_dump(mode="json")
