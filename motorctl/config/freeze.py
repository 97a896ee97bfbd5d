"""Checked parts become the frozen machine, and the same again as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from motorctl.config.axis_model import AxisModel
from motorctl.config.machine import (
    Adaptation,
    Axis,
    DriverSetup,
    Encoder,
    FollowingErrorLimit,
    Gains,
    Homing,
    Limits,
    LoopSettings,
    Machine,
)
from motorctl.config.shape import AxisShape, ConfigShape, DriverShape
from motorctl.motion import Program

INFINITIES = {math.inf: ".inf", -math.inf: "-.inf"}


def freeze(
    shape: ConfigShape,
    source: Path,
    drivers: Mapping[str, DriverSetup],
    models: Mapping[str, AxisModel],
    programs: Mapping[str, Program],
    divisors: Mapping[str, int],
) -> Machine:
    """Put a machine together from parts that have been checked."""
    return Machine(
        name=shape.name,
        source=source,
        rate_hz=shape.rate_hz,
        drivers=dict(drivers),
        axes={
            name: _axis(name, axis, models[name], divisors[axis.driver])
            for name, axis in shape.axes.items()
        },
        programs=dict(programs),
        loop=LoopSettings(**shape.loop.model_dump()),
        log_directory=shape.recording.directory,
        resolved=_resolved(shape, drivers, models, programs),
    )


def _axis(name: str, shape: AxisShape, model: AxisModel, divisor: int) -> Axis:
    limits, homing, adaptation = shape.limits, shape.homing, shape.adaptation.model_dump()
    runs = model.declared if shape.controller == "C2" else model.declared.without_electromagnetic()
    if adaptation["rate_limit_1_s"] is None:
        adaptation["rate_limit_1_s"] = math.inf
    return Axis(
        name=name,
        driver=shape.driver,
        channel=shape.channel,
        controller=shape.controller,
        encoder=Encoder(**shape.encoder.model_dump()),
        limits=Limits(
            travel_m=limits.travel_m,
            max_velocity_m_s=limits.max_velocity_m_s,
            max_acceleration_m_s2=limits.max_acceleration_m_s2,
            max_jerk_m_s3=limits.max_jerk_m_s3,
            max_voltage_v=limits.max_voltage_v,
            following_error=FollowingErrorLimit(**limits.following_error.model_dump()),
            stop_acceleration_m_s2=limits.stop.acceleration_m_s2,
            stop_jerk_m_s3=limits.stop.jerk_m_s3,
        ),
        gains=Gains(**shape.gains.model_dump()),
        declared=model.declared,
        model=runs,
        estimates=model.estimates_of(runs),
        adaptation=Adaptation(**adaptation),
        homing=Homing(
            method=homing.method,
            search_velocity_m_s=homing.search_velocity_m_s or 0.0,
            latch_velocity_m_s=homing.latch_velocity_m_s or 0.0,
            home_position_m=homing.home_position_m or 0.0,
            timeout_s=homing.timeout_s or 0.0,
        ),
        program=shape.program,
        divisor=divisor,
    )


def _resolved(
    shape: ConfigShape,
    drivers: Mapping[str, DriverSetup],
    models: Mapping[str, AxisModel],
    programs: Mapping[str, Program],
) -> dict[str, Any]:
    """Give the configuration with every default, in the file's own shape, fit for JSON."""
    plain: dict[str, Any] = shape.model_dump(mode="json")
    for name, driver in drivers.items():
        common = {key: plain["drivers"][name][key] for key in DriverShape.model_fields}
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
