"""Parameters of a diagnosed axis with their units, as documents, tables and reports give them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from motorctl.identify.columns.measured import Array, Measured
from motorctl.identify.diagnose.result import AxisDiagnosis, FoundEffect, UnknownStructure
from motorctl.json_values import finite
from motorctl.log.units import unit_for
from motorctl.model import Effect, EffectList, Parameter, wave_end
from motorctl.model.option_units import option_unit

_PREFIXES = {
    "m": ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm")),
    "rad": ((1.0, "rad"), (1e-3, "mrad"), (1e-6, "µrad")),
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")),
    "m/s": ((1.0, "m/s"), (1e-3, "mm/s")),
    "rad/s": ((1.0, "rad/s"), (1e-3, "mrad/s")),
}
_POWERS = str.maketrans({"*": " "})
MOST_DECIMALS = 7
"""Decimals up to which a value is written without an exponent. More makes rows of zeros, fewer
turns ordinary values into powers of ten. Chosen by hand."""


DAY_S = 86400.0
"""Time [s] beyond which it is one of a clock, of which the seconds are read. Larger leaves them out
of long logs, smaller tells long time constants to more digits than they have. Convention."""


@dataclass(frozen=True)
class Value:
    """A number with its standard error; NaN where there is none."""

    value: float
    std_error: float
    unit: str

    def document(self) -> dict[str, float | str | None]:
        """Return the value as JSON documents have it."""
        return {
            "value": finite(self.value),
            "std_error": finite(self.std_error),
            "unit": self.unit,
        }

    def told(self) -> str:
        """Return the value in words: with a fitting prefix, to two digits of its standard error."""
        if not math.isfinite(self.value):
            return "–"
        scale, unit = prefixed(self.value, self.unit)
        value, error = self.value / scale, self.std_error / scale
        # an error far below the value's digits, or above it, says nothing through its digits
        if not math.isfinite(error) or error <= 1e-9 * abs(value) or error > 100 * abs(value):
            since_1970 = unit == "s" and abs(value) >= DAY_S
            told = f"{value:.2f}" if since_1970 else f"{value:.5g}"
        elif (decimals := max(0, 1 - math.floor(math.log10(error)))) <= MOST_DECIMALS:
            told = f"{value:.{decimals}f} ± {error:.{decimals}f}"
        else:
            digits = 2 + max(0, math.floor(math.log10(abs(value) / error)) if value else 0)
            told = f"{value:.{digits}g} ± {error:.2g}"
        return f"{told} {pretty(unit)}".rstrip()


def percent(share: float) -> str:
    """Return a share of one in percent; what is not all does not read as all."""
    if not math.isfinite(share):
        return "–"
    if 0.99 < share < 1.0:
        return f"{min(100.0 * share, 99.9):.1f} %"
    return f"{100.0 * share:.0f} %"


def pretty(unit: str) -> str:
    """Write a unit for people."""
    return unit.replace("^2", "²").replace("^3", "³").translate(_POWERS)


def prefixed(value: float, unit: str) -> tuple[float, str]:
    """Return the scale and the unit in which a value is neither tiny nor huge."""
    choices = _PREFIXES.get(unit, ((1.0, unit),))
    fitting = [choice for choice in choices if abs(value) >= choice[0]]
    return (fitting or choices[-1:] if value else choices)[0]


def parameter_values(
    data: Measured, model: EffectList, theta: Array, std_error: Array
) -> dict[str, Value]:
    """Return every parameter by its full name; NaN where theta is empty: nothing was fitted."""
    found = {}
    for i, (name, parameter) in enumerate(
        zip(model.parameter_names, model.parameters, strict=True)
    ):
        found[name] = Value(_at(theta, i), _at(std_error, i), own_unit(data, parameter.unit))
    return found


def whole_model_values(axis: AxisDiagnosis) -> dict[str, Value]:
    """Return the parameters of the whole model, fitted together."""
    return parameter_values(axis.data, axis.model, axis.theta, axis.std_error)


def declared_alone_values(axis: AxisDiagnosis) -> dict[str, Value]:
    """Return the parameters of the declared model, fitted without what was found."""
    return parameter_values(axis.data, axis.declared, axis.declared_theta, axis.declared_std_error)


def force_values(axis: AxisDiagnosis) -> dict[str, Value]:
    """Return those parameters of the whole model that are forces, on the load's side.

    Empty where the force constant is not known.
    """
    gain = axis.data.force_per_command
    if gain is None:
        return {}
    found = {}
    values = whole_model_values(axis)
    for effect in axis.model.effects:
        for parameter in effect.parameters:
            name = effect.full_name(parameter)
            unit = _force_unit(axis.data, effect, parameter)
            if unit is not None:
                value, scale = values[name], effect.load_sign * gain
                found[name] = Value(scale * value.value, abs(scale) * value.std_error, unit)
    return found


def found_values(data: Measured, found: FoundEffect) -> dict[str, Value]:
    """Return the options and parameters of a found effect.

    Of the options those that are numbers and that the data gave. A pair of a sine's and a
    cosine's coefficient is given as amplitude and phase too: A sin(.. + phase).
    """
    return _effect_values(data, found.effect, found.theta, found.std_error, found.option_errors)


def compensation_values(data: Measured, unknown: UnknownStructure) -> dict[str, Value]:
    """Return options and parameters of the compensation of unknown structure; else nothing."""
    if unknown.compensation is None:
        return {}
    return _effect_values(data, unknown.compensation, unknown.theta, unknown.std_error, {})


def as_force(data: Measured, effect: Effect, value: Value) -> Value | None:
    """Return a value in units of the command as a force; None where it is none, or not known."""
    gain, unit = data.force_per_command, data.command_unit
    apart = effect.kind not in ("state", "input") or not value.unit.startswith(unit)
    if gain is None or apart:
        return None
    force = data.force_unit + value.unit[len(unit) :]
    return Value(gain * value.value, abs(gain) * value.std_error, force)


def option_document(effect: Effect) -> dict[str, Any]:
    """Return all options of an effect, as a configuration has them."""
    return effect.options.model_dump(mode="json")


def own_unit(data: Measured, unit: str) -> str:
    """Translate a unit of the model to the axis' own; a pure number has none."""
    return "" if unit in ("-", "1") else data.unit(unit)


def _effect_values(
    data: Measured,
    effect: Effect,
    theta: Array,
    std_error: Array,
    option_errors: Mapping[str, float],
) -> dict[str, Value]:
    values = {}
    fields = type(effect.options).model_fields
    for name, option in effect.options.model_dump().items():
        if isinstance(option, bool) or not isinstance(option, int | float):
            continue
        if name in option_errors or option != fields[name].default:
            error = option_errors.get(name, math.nan)
            values[name] = Value(float(option), float(error), own_unit(data, option_unit(name)))
    for i, parameter in enumerate(effect.parameters):
        unit = own_unit(data, parameter.unit)
        values[parameter.name or effect.name] = Value(_at(theta, i), _at(std_error, i), unit)
    return values | _amplitudes(values)


def _amplitudes(values: Mapping[str, Value]) -> dict[str, Value]:
    """Turn pairs such as sin_3 and cos_3 into amplitude_3 and phase_3_rad."""
    found = {}
    for name, sine in values.items():
        end = wave_end(name)
        cosine = values.get(f"cos{end}")
        if end is None or not name.startswith("sin") or cosine is None:
            continue
        size = math.hypot(sine.value, cosine.value)
        # error propagation: along the phasor for the amplitude, across it for the phase
        along = math.hypot(sine.value * sine.std_error, cosine.value * cosine.std_error)
        across = math.hypot(cosine.value * sine.std_error, sine.value * cosine.std_error)
        found[f"amplitude{end}"] = Value(size, along / size if size else math.nan, sine.unit)
        order = end.removesuffix("_m")  # an amplitude in metres has a phase in radians all the same
        found[f"phase{order}_rad"] = Value(
            math.atan2(cosine.value, sine.value), across / size**2 if size else math.nan, "rad"
        )
    return found


def _force_unit(data: Measured, effect: Effect, parameter: Parameter) -> str | None:
    force, command = data.force_unit, data.command_unit
    if effect.kind == "state" and parameter.unit.startswith("V"):
        return force + unit_for(parameter.unit[1:], data.position_unit, command)
    if effect.kind == "input" and parameter.unit.startswith("1/V"):
        # 1/V becomes N/V^2, 1/V^2 becomes N/V^3
        power = parameter.unit.partition("^")[2]
        return f"{force}/{command}^{int(power or 1) + 1}"
    return None


def _at(values: Sequence[float] | Array, i: int) -> float:
    return float(values[i]) if i < len(values) else math.nan
