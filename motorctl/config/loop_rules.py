"""Rules that need the model: the closed loop is stable, the input map can be inverted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from motorctl.config.analysis import (
    LoopGains,
    corner_slopes,
    loop_margins,
    lowest_slope,
    smallest_slope,
)
from motorctl.config.axis_keys import Gains
from motorctl.config.filter_words import filter_words
from motorctl.config.machine import Estimate
from motorctl.config.validation import Finding
from motorctl.control import CommandFilter, command_filter, monotonicity_half_planes
from motorctl.errors import UsageError
from motorctl.model import EffectList
from motorctl.model.knowledge import Signal


def parameter_range(
    model: EffectList, estimates: tuple[Estimate, ...], signal: Signal
) -> tuple[float, float, float]:
    """Return (initial, lower, upper) of what multiplies a signal, zeros where nothing does."""
    place = model.index_of(signal)
    if place is None:
        return 0.0, 0.0, 0.0
    return estimates[place].initial, estimates[place].lower, estimates[place].upper


def filter_of(gains: Gains, period_s: float) -> CommandFilter | None:
    """Return the filter of the feedback's part of the command, as an axis of this period has it."""
    keys = gains.command_filter
    if keys is None:
        return None
    return command_filter(keys.kind, keys.frequency_hz, keys.damping, keys.depth, period_s)


def loop_gains(gains: Gains, period_s: float) -> LoopGains:
    """Return the gains of the feedback and its filter, as the sampled loop takes them."""
    own = filter_of(gains, period_s)
    return LoopGains(gains.k1_1_s, gains.ks_v_s_m, gains.gamma_d, own)


def check_stability(
    model: EffectList,
    estimates: tuple[Estimate, ...],
    gains: Gains,
    period_s: float,
    input_delay_s: float,
) -> Iterator[Finding]:
    """Check that the sampled loop around theta_hat(0) is stable.

    The delay is that of the adaptation's alignment and of the list together; the lag is the
    list's.
    """
    theta1 = parameter_range(model, estimates, "acceleration")[0]
    theta2 = parameter_range(model, estimates, "velocity")[0]
    margins = loop_margins(
        theta1,
        theta2,
        **vars(loop_gains(gains, period_s)),
        period_s=period_s,
        delay_s=input_delay_s + model.delay_s,
        lag_s=model.lag_s,
    )
    if not margins.stable:
        yield (
            ("gains",),
            f"the sampled closed loop is unstable: ks {gains.ks_v_s_m:g}, k1 {gains.k1_1_s:g}, "
            f"gamma_d {gains.gamma_d:g}{_filter_words(gains)} around theta1(0) {theta1:g} "
            f"V*s^2/m, theta2(0) {theta2:g} V*s/m at {1.0 / period_s:g} Hz with "
            f"{margins.delay_s:g} s of delay"
            + (f" and {margins.lag_s:g} s of lag" if margins.lag_s else ""),
        )


def _filter_words(gains: Gains) -> str:
    own = gains.command_filter
    if own is None:
        return ""
    return f" and a {filter_words(**own.model_dump())}"


def check_monotonicity(
    model: EffectList,
    estimates: tuple[Estimate, ...],
    u_max: float,
    margin: float,
    travel_m: tuple[float, float],
) -> Iterator[Finding]:
    """Check Assumption 2 at theta_hat(0), and that the law can keep it within the bounds."""
    inputs = [effect.name for effect in model.effects if effect.kind == "input"]
    if not inputs:
        return
    theta = np.array([estimate.initial for estimate in estimates])
    slope, at_u = smallest_slope(model, theta, u_max, travel_m)
    if not slope >= margin:
        yield (
            ("model", inputs[0]),
            f"Assumption 2 fails at theta(0): the input map's slope dv/du is {slope:.4g} at "
            f"u = {at_u:.4g} V, should be at least monotonicity_margin {margin:g} over "
            f"|u| <= {u_max:g} V; bring {' and '.join(inputs)} nearer to 0 or lower max_voltage_v",
        )
        return
    lower = np.array([estimate.lower for estimate in estimates])
    upper = np.array([estimate.upper for estimate in estimates])
    if corner_slopes(model, list(lower), list(upper), u_max, travel_m)[0].slope >= margin:
        return  # holds all over the box, so the law needs no half-plane
    if varying := [e.name for e in model.effects if e.kind == "input" and not e.stands_still]:
        # Beside the others' theta(0) the law must have room for all that these may become.
        wide = [not e.stands_still for e in model.effects for _ in e.parameters]
        least, at_u = lowest_slope(
            model, np.where(wide, lower, theta), np.where(wide, upper, theta), u_max, travel_m
        )
        if not least >= margin:
            yield (
                ("model", varying[0]),
                f"Assumption 2 may fail within the bounds of {' and '.join(varying)}: somewhere on "
                f"the travel, or after some past, dv/du can fall to {least:.4g} at u = "
                f"{at_u:.4g} V, should be at least monotonicity_margin {margin:g}; give it "
                "narrower bounds",
            )
            return
    try:
        monotonicity_half_planes(model, lower, upper, u_max, margin, travel_m)
    except UsageError as error:
        yield ("model", inputs[0]), str(error)
