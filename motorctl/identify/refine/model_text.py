"""Write an axis' refined model into the text of a configuration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from motorctl.axis_units import PositionUnit
from motorctl.config.freeze import decode
from motorctl.config.machine import Estimate
from motorctl.identify.refine.yaml_text import Item, KeyPath, YamlText
from motorctl.log.units import unit_for
from motorctl.model import Effect, Parameter
from motorctl.model.option_units import option_unit


@dataclass(frozen=True)
class WantedEffect:
    """An effect as the configuration should have it."""

    effect: Effect
    estimates: tuple[Estimate, ...]
    """One for each of its parameters."""
    type: str | None = None
    """Where the class of an effect of one's own stands."""
    above: tuple[str, ...] = ()
    """Comment lines, where the effect is new."""
    option_errors: Mapping[str, float] | None = None
    position_unit: PositionUnit = "m"
    """Of the axis."""

    def data(self) -> dict[str, Any]:
        """Return what the configuration should mean: keys and values of the effect."""
        values = {} if self.type is None else {"type": self.type}
        values |= self.effect.options.model_dump(mode="json", exclude_none=True)
        named = {}
        for parameter, estimate in self._pairs():
            if parameter.name:
                named[parameter.name] = _numbers(estimate)
            else:
                values |= _numbers(estimate)
        return values | ({"parameters": named} if named else {})

    def item(self) -> Item:
        """Return the effect as keys to be written, with units in comments."""
        name, above = self.effect.name, self.above
        options = self._option_items()
        single = [(p, e) for p, e in self._pairs() if not p.name]
        named = [(p, e) for p, e in self._pairs() if p.name]
        if not options and len(single) == 1 and not named:
            parameter, estimate = single[0]
            return Item(name, _flow_of(_numbers(estimate)), self._own(parameter.unit), above)
        items = options
        for parameter, estimate in single:
            unit = self._own(parameter.unit)
            items += [Item(k, v, unit * (k != "covariance")) for k, v in _texts(estimate)]
        if named:
            parts = [Item(p.name, _flow_of(_numbers(e)), self._own(p.unit)) for p, e in named]
            items.append(Item("parameters", parts))
        return Item(name, items, self.effect.formula, above)

    def _own(self, unit: str) -> str:
        return unit_for(unit, self.position_unit, "V")

    def _pairs(self) -> list[tuple[Parameter, Estimate]]:
        return list(zip(self.effect.parameters, self.estimates, strict=True))

    def _option_items(self) -> list[Item]:
        items = [] if self.type is None else [Item("type", self.type)]
        for name, value in self.effect.options.model_dump(mode="json", exclude_none=True).items():
            unit = self._own(option_unit(name))
            error = (self.option_errors or {}).get(name, math.nan)
            told = f" +- {error:.2g}" if math.isfinite(error) else ""
            items.append(Item(name, text_of(value), f"{unit}{told}".strip()))
        return items


def write_model(
    text: YamlText, axis: str, wanted: Sequence[WantedEffect], current: Mapping[str, Any]
) -> None:
    """Note the changes that give the axis this model; what is right already stays as written.

    current is what the text means now, with every default filled in: the axis' part of
    `Machine.resolved`. Raises KeyError where the text is written so that it cannot be changed in
    place.
    """
    path = ("axes", axis, "model")
    if not text.mapping(path):
        item = Item("model", [effect.item() for effect in wanted])
        if text.has(path):
            text.replace_with_block(path, item)
        else:
            text.append(path[:-1], [item])
        return
    missing = []
    for effect in wanted:
        name = effect.effect.name
        if name in current:
            _write_values(text, (*path, name), effect.data(), decode(current[name]), effect.item())
        else:
            missing.append(effect.item())
    if missing:
        text.append(path, missing)


def text_of(value: Any) -> str:
    """Write a plain value as YAML on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "null"
    if isinstance(value, float):
        return ".inf" if value == math.inf else "-.inf" if value == -math.inf else f"{value:.10g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(text_of(part) for part in value)}]"
    if isinstance(value, Mapping):
        return _flow_of(value)
    if isinstance(value, str):
        plain = yaml.safe_dump(value, default_flow_style=True, width=10**6).strip()
        return plain.removesuffix("...").strip()
    return str(value)


def _write_values(
    text: YamlText,
    path: KeyPath,
    data: Mapping[str, Any],
    current: Mapping[str, Any],
    whole: Item,
) -> None:
    """Change the values of the mapping at `path` that are not right; add the keys that it lacks."""
    if data == current:
        return
    if not text.mapping(path):
        if text.has(path):
            text.replace_with_block(path, whole)
        else:
            text.append(path[:-1], [whole])
        return
    parts = () if isinstance(whole.value, str) else whole.value
    items = {part.key: part for part in parts}
    missing = []
    for key, value in data.items():
        where = (*path, key)
        if value == current.get(key):
            continue
        item = items.get(key, Item(key, text_of(value)))
        if isinstance(value, Mapping):
            _write_values(text, where, value, current.get(key, {}), item)
        elif text.has(where):
            text.replace(where, text_of(value))
        else:
            missing.append(item)
    if missing:
        text.append(path, missing)


def _numbers(estimate: Estimate) -> dict[str, Any]:
    return {
        "initial": estimate.initial,
        "bounds": [estimate.lower, estimate.upper],
        "covariance": estimate.covariance,
    }


def _texts(estimate: Estimate) -> list[tuple[str, str]]:
    return [(key, text_of(value)) for key, value in _numbers(estimate).items()]


def _flow_of(values: Mapping[str, Any]) -> str:
    return "{" + ", ".join(f"{key}: {text_of(value)}" for key, value in values.items()) + "}"
