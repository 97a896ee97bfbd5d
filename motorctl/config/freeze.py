"""Checked parts become the frozen machine, and the same again as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from motorctl.config.axis_keys import AxisKeys, AxisSettings, ConfigurationKeys
from motorctl.config.axis_model import AxisModel
from motorctl.config.keys import DriverKeys
from motorctl.config.machine import Axis, DriverSetup, Machine
from motorctl.model import Effect
from motorctl.motion import Program

INFINITIES = {math.inf: ".inf", -math.inf: "-.inf"}


def freeze(
    keys: ConfigurationKeys,
    source: Path,
    drivers: Mapping[str, DriverSetup],
    models: Mapping[str, AxisModel],
    programs: Mapping[str, Program],
    divisors: Mapping[str, int],
    further_effects: Mapping[str, type[Effect]],
) -> Machine:
    """Put a machine together from parts that have been checked."""
    return Machine(
        name=keys.name,
        source=source,
        rate_hz=keys.rate_hz,
        drivers=dict(drivers),
        axes={
            name: _axis(name, axis, models[name], divisors[axis.driver])
            for name, axis in keys.axes.items()
        },
        programs=dict(programs),
        further_effects=dict(further_effects),
        loop=keys.loop,
        recording=keys.recording,
        resolved=_resolved(keys, drivers, models, programs),
        stop_together=_groups(keys),
    )


def _groups(keys: ConfigurationKeys) -> tuple[tuple[str, ...], ...] | None:
    return None if keys.stop_together is None else tuple(map(tuple, keys.stop_together))


def _axis(name: str, keys: AxisKeys, model: AxisModel, divisor: int) -> Axis:
    runs = model.declared if keys.controller == "C2" else model.declared.without_electromagnetic()
    return Axis(
        **{key: getattr(keys, key) for key in AxisSettings.model_fields},
        name=name,
        declared=model.declared,
        model=runs,
        estimates=model.estimates_of(runs),
        divisor=divisor,
    )


def _resolved(
    keys: ConfigurationKeys,
    drivers: Mapping[str, DriverSetup],
    models: Mapping[str, AxisModel],
    programs: Mapping[str, Program],
) -> dict[str, Any]:
    """Return the configuration with every default, in the file's own shape, fit for JSON."""
    plain: dict[str, Any] = keys.model_dump(mode="json")
    for name, driver in drivers.items():
        common = {key: plain["drivers"][name][key] for key in DriverKeys.model_fields}
        plain["drivers"][name] = common | driver.options.model_dump(mode="json")
    for name, model in models.items():
        plain["axes"][name]["model"] = model.resolved
    for name, program in programs.items():
        if isinstance(program, BaseModel):
            plain["programs"][name] = program.model_dump(mode="json", exclude={"name"})
    encoded: dict[str, Any] = _encode(plain)
    return encoded


def decode(value: Any) -> Any:
    """Read plain data back: JSON has no infinity, so it stands as YAML's word for it."""
    if isinstance(value, Mapping):
        return {key: decode(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [decode(item) for item in value]
    for number, word in INFINITIES.items():
        if value == word:
            return number
    return value


def _encode(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _encode(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_encode(item) for item in value]
    return INFINITIES.get(value, value) if isinstance(value, float) else value
