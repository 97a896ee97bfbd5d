"""Start values, bounds and covariances of refined parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import Estimate
from motorctl.identify.columns.signals import Signals
from motorctl.model import Effect, EffectList, Parameter, wave_end

Array = NDArray[np.float64]

ERRORS = 5.0
"""Distance of the bounds from the estimate, in standard errors, at least. Larger lets the
adaptation wander, smaller may shut the true value out. Chosen by hand."""
SHARE = 0.3
"""The same distance as a part of the effect's amplitude. Larger lets the adaptation wander, smaller
leaves it no room for a machine that wears or warms up. Chosen by hand."""
COMMAND_SHARE = 0.01
"""The same distance as what changes the command, where the term changes it most, by this part of
its rms. Larger lets small terms wander, smaller binds them closer than anybody can feel. Chosen by
hand."""
PEAK_SHARE = 0.999
"""Quantile of a column that stands for its peak. Larger lets an outlier among a thousand samples
stand for it, smaller takes the usual for the peak, so bounds get wide. Chosen by hand."""
MOVING = 0.02
"""Part of the top speed above which the axis moves. Larger leaves slow motion out of the columns'
sizes, smaller lets long rests make them small, and Gamma(0) large. Chosen by hand."""
LEARNING_S = 5.0
"""Time in which the adaptation may take up what the recording got wrong [s]. Longer leaves the
errors there for as long, shorter makes the estimate follow noise. Chosen by hand."""
DIGITS = 6
"""Digits of a start value. More are lost in its standard error, fewer change what was fitted.
Chosen by hand: a millionth is below any standard error here."""
BOUND_DIGITS = 4
"""Digits of a bound. Only looks depend on it. Chosen by hand."""
COVARIANCE_DIGITS = 3
"""Digits of an initial covariance. Only looks depend on it. Chosen by hand."""
OPTION_DIGITS = 7
"""Digits of an option. More are lost in its standard error, fewer shift the last of many waves: a
pitch adds its error up over the travel. Chosen by hand."""


@dataclass(frozen=True)
class Sizes:
    """How much the columns psi and the command move where the axis does."""

    rms: Array
    """(n,)"""
    peak: Array
    """(n,) but for a thousandth of the time."""
    command_rms: float


def estimates_of(model: EffectList, theta: Array, std_error: Array, sizes: Sizes) -> list[Estimate]:
    """Return an estimate for each of the n parameters; theta, std_error (n,).

    What makes no difference to the command needs no narrow bounds. Gamma(0) is the inverse of
    psi^2 times the learning time (Chen, Yao, Wang 2013, eq. 27, without forgetting), no more than
    the effect's default: a Gamma that is large for a column makes the estimate follow noise.
    """
    found = []
    amplitude = amplitudes(model, theta)
    effects = [effect for effect in model.effects for _ in effect.parameters]
    for k, (effect, parameter) in enumerate(zip(effects, model.parameters, strict=True)):
        initial = rounded_within(parameter, float(theta[k]))
        spread = ERRORS * float(std_error[k]) if math.isfinite(std_error[k]) else 0.0
        if effect.is_spline:
            # Where there was little motion its heights are hardly known, and must not wander.
            spread = min(spread, float(amplitude[k]))
        reach = COMMAND_SHARE * sizes.command_rms / sizes.peak[k] if sizes.peak[k] > 0.0 else 0.0
        width = max(spread, SHARE * float(amplitude[k]), float(reach))
        lower, upper = bounds_within(parameter, initial, width)
        power = LEARNING_S * float(sizes.rms[k]) ** 2
        learned = min(1.0 / power if power > 0.0 else math.inf, parameter.covariance)
        found.append(Estimate(initial, lower, upper, rounded(learned, COVARIANCE_DIGITS)))
    return found


def amplitudes(model: EffectList, theta: Array) -> Array:
    """Return how large the effect of each parameter is, in the parameter's unit, (n,).

    Sine and cosine of one order share the length of their vector, and the coefficients of a
    spline the largest of them, for a small one of them is not known any better.
    """
    found = []
    first = 0
    for effect in model.effects:
        parameters = effect.parameters
        own = np.abs(theta[first : first + len(parameters)])
        first += len(parameters)
        for k, parameter in enumerate(parameters):
            order = wave_end(parameter.name)
            alike = [
                i
                for i, other in enumerate(parameters)
                if other.unit == parameter.unit and wave_end(other.name) == order
            ]
            waves = order is not None and len(alike) == 2
            if waves or effect.is_spline:
                found.append(float(np.linalg.norm(own[alike]) if waves else own[alike].max()))
            else:
                found.append(float(own[k]))
    return np.array(found)


def sizes_of(model: EffectList, signals: Signals) -> Sizes:
    """Measure the columns of a model over a recording."""
    top = max(float(np.max(np.abs(stretch.v))) for stretch in signals.stretches)
    moving = [np.abs(stretch.v) > MOVING * top for stretch in signals.stretches]
    rms, peak = [], []
    for effect in model.effects:
        if effect.parameters:
            parts = [
                stretch.columns(effect, np.gradient(stretch.v, signals.period_s))[:, rows]
                for stretch, rows in zip(signals.stretches, moving, strict=True)
            ]
            columns = np.concatenate(parts, axis=1)
            rms.append(_rms(columns))
            peak.append(np.quantile(np.abs(columns), PEAK_SHARE, axis=1))
    command = [s.command[rows] for s, rows in zip(signals.stretches, moving, strict=True)]
    return Sizes(np.concatenate(rms), np.concatenate(peak), float(_rms(np.concatenate(command))))


def bounds_within(parameter: Parameter, initial: float, width: float) -> tuple[float, float]:
    """Return bounds around a start value that the effect allows, the lower one first."""
    width = width or SHARE * (abs(parameter.initial) or 1e-3)
    lower = rounded_within(parameter, rounded(initial - width, BOUND_DIGITS))
    upper = rounded_within(parameter, rounded(initial + width, BOUND_DIGITS))
    # Rounding must not cut off the start value.
    return min(lower, initial), max(upper, initial)


def moved(estimate: Estimate, parameter: Parameter, change: float) -> Estimate:
    """Return an estimate whose start value is another, and whose bounds went along."""
    initial = rounded_within(parameter, estimate.initial + change)
    width = max(estimate.initial - estimate.lower, estimate.upper - estimate.initial)
    lower, upper = bounds_within(parameter, initial, width)
    return replace(estimate, initial=initial, lower=lower, upper=upper)


def with_rounded_options(effect: Effect) -> Effect:
    """Return an effect whose options have no more digits than are worth writing."""
    options = effect.options.model_dump()
    return effect.with_options(**{name: _option(value) for name, value in options.items()})


def rounded_within(parameter: Parameter, value: float) -> float:
    """Round to a value that the effect allows."""
    within = rounded(min(max(value, parameter.lower), parameter.upper))
    if within > parameter.upper:
        return rounded(parameter.upper - abs(parameter.upper) * 10.0 ** (1 - DIGITS))
    if within < parameter.lower:
        return rounded(parameter.lower + abs(parameter.lower) * 10.0 ** (1 - DIGITS))
    return within


def rounded(value: float, digits: int = DIGITS) -> float:
    """Round to the digits that are worth writing."""
    return float(f"{value:.{digits}g}")


def _option(value: object) -> object:
    if isinstance(value, float) and math.isfinite(value):
        return rounded(value, OPTION_DIGITS)
    return tuple(map(_option, value)) if isinstance(value, tuple) else value


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)))
