"""The list of effects of one axis, and the start values of its parameters."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from motorctl.config.axis_keys import EffectKeys, ParameterKeys
from motorctl.config.machine import MOST_PARAMETERS, Estimate
from motorctl.config.rules import out_of_order
from motorctl.config.validation import Finding, read_keys, shown, suggest, validate_options
from motorctl.errors import Problem, UsageError
from motorctl.located_yaml import Document, KeyPath, find
from motorctl.model import (
    Effect,
    EffectList,
    Parameter,
    basic_effects,
    effect_class,
    known_effects,
)
from motorctl.model.catalog import check_form, failed_effects


@dataclass(frozen=True)
class AxisModel:
    """What the key `model` of an axis says."""

    declared: EffectList
    estimates: tuple[Estimate, ...]
    """One for each parameter of `declared`."""
    resolved: dict[str, Any]

    def estimates_of(self, model: EffectList) -> tuple[Estimate, ...]:
        """Return the estimates of a part of the declared list, in its order."""
        known = dict(zip(self.declared.parameter_names, self.estimates, strict=True))
        return tuple(known[name] for name in model.parameter_names)


def build_model(document: Document, path: KeyPath) -> tuple[AxisModel | None, list[Problem]]:
    """Build the list that stands at `path`.

    Returns
    -------
    tuple
        The list, None where it is wrong, and every problem but those of names and types of keys,
        which are told by whoever validates the whole document.
    """
    parts = document.at(path)
    if not isinstance(parts, dict) or not parts:
        return None, []
    problems: list[Problem] = []
    effects: list[Effect] = []
    estimates: list[Estimate] = []
    resolved: dict[str, Any] = {}
    for name, part in parts.items():
        where = (*path, name)
        keys = _readable(part)
        effect, refusals = _effect(document, where, name, keys)
        problems += refusals
        if effect is None:
            continue
        own: list[Estimate] = []
        for estimate, findings in _estimates(effect, keys, part):
            problems += [document.problem((*where, *key), message) for key, message in findings]
            if estimate is not None:
                own.append(estimate)
        effects.append(effect)
        estimates += own
        resolved[name] = _resolved(effect, keys, own)
    mass = basic_effects()["acceleration"].name
    if mass not in parts:
        message = f"has no {mass}; the law needs theta1 to accelerate a mass"
        problems.append(document.problem(path, message))
    if len(estimates) > MOST_PARAMETERS:
        message = (
            f"{len(estimates)} parameters; at most {MOST_PARAMETERS} are possible: leave out an "
            "effect, or give one fewer orders or segments"
        )
        problems.append(document.problem(path, message))
    if problems or len(effects) < len(parts):
        return None, problems
    return AxisModel(EffectList(effects), tuple(estimates), resolved), problems


def read_further_effects(
    document: Document,
) -> tuple[dict[str, type[Effect]], list[Problem]]:
    """Return the effects that diagnosis is to try, and why others cannot be."""
    found: dict[str, type[Effect]] = {}
    problems = []
    for name, where in document.part(("further_effects",)).items():
        if not isinstance(where, str):
            continue  # the keys' own check tells
        try:
            found[name] = effect_class(name, where)
        except UsageError as error:
            problems.append(document.problem(("further_effects", name), str(error)))
    return found, problems


def _readable(part: Any) -> EffectKeys:
    """Return what can be read of an effect, so that the rest is checked where a key is wrong."""
    keys = part if isinstance(part, dict) else {}
    good = {key: value for key, value in keys.items() if read_keys(EffectKeys, {key: value})}
    return EffectKeys.model_validate_json(json.dumps(good))


def _effect(
    document: Document, path: KeyPath, name: str, keys: EffectKeys
) -> tuple[Effect | None, list[Problem]]:
    def refused(message: str, *where: str) -> tuple[None, list[Problem]]:
        return None, [document.problem((*path, *where), message)]

    if keys.type is None and name not in {*known_effects(), *failed_effects()}:
        known = suggest(name, known_effects())
        return refused(
            f"unknown effect; {known} (an effect of one's own needs type: package.module:Class)"
        )
    try:
        cls = effect_class(name, keys.type)
    except UsageError as error:
        return refused(str(error), *(["type"] if keys.type else []))
    also = EffectKeys.model_fields
    options, problems = validate_options(document, path, cls.Options, keys.options, also)
    if options is None:
        return None, problems
    try:
        effect = cls(options)
    except Exception as error:  # an effect of a third party may fail in any way
        return refused(f"the effect refuses its options: {type(error).__name__}: {error}")
    try:
        check_form(effect)
    except UsageError as error:
        return refused(str(error))
    return effect, []


def _estimates(
    effect: Effect, keys: EffectKeys, part: Any
) -> Iterator[tuple[Estimate | None, list[Finding]]]:
    """Yield the estimate of every parameter with what is wrong with it; `part` is as written."""
    single = [p for p in effect.parameters if not p.name]
    named = {p.name: p for p in effect.parameters if p.name}
    own = ParameterKeys(**{key: getattr(keys, key) for key in ParameterKeys.model_fields})
    if not single:
        message = "this effect has no parameters that are estimated, only options"
        if named:
            message = "belongs to one of this effect's parameters; write it under"
            message += f" parameters: {', '.join(named)}"
        yield None, [((key,), message) for key, value in own if value is not None]
    for name in keys.parameters or {}:
        if name not in named:
            message = f"unknown parameter; {suggest(name, named)}"
            yield None, [(("parameters", name), message)]
    for parameter in effect.parameters:
        if parameter.name:
            where: KeyPath = ("parameters", parameter.name)
            given = (keys.parameters or {}).get(parameter.name, ParameterKeys())
        else:
            where, given = (), own
        estimate, findings = _estimate(parameter, given, find(part, (*where, "bounds")))
        yield estimate, [((*where, *key), message) for key, message in findings]


def _estimate(
    parameter: Parameter, given: ParameterKeys, bounds: Any
) -> tuple[Estimate, list[Finding]]:
    """Return an estimate, and what is wrong with it; `bounds` are as written."""
    lower, upper = given.bounds or (parameter.lower, parameter.upper)
    initial = parameter.initial if given.initial is None else given.initial
    covariance = parameter.covariance if given.covariance is None else given.covariance
    symbol, unit = parameter.symbol, parameter.unit
    found: list[Finding] = []
    if not lower < upper:
        if message := out_of_order(bounds):
            found.append((("bounds",), message))
    elif given.bounds and (lower < parameter.lower or upper > parameter.upper):
        message = f"found {shown([lower, upper])}, {symbol} can only lie within"
        limits = f"{parameter.lower:g} to {parameter.upper:g} {unit}"
        found.append((("bounds",), f"{message} {limits}"))
    elif not lower <= initial <= upper:
        told = f"found {initial:g}" if given.initial is not None else f"default {initial:g}"
        message = f"{told}, {symbol}(0) should lie within its bounds {lower:g} to {upper:g} {unit}"
        found.append((("initial",), message))
    return Estimate(initial, lower, upper, covariance), found


def _resolved(effect: Effect, keys: EffectKeys, estimates: list[Estimate]) -> dict[str, Any]:
    resolved: dict[str, Any] = {} if keys.type is None else {"type": keys.type}
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
