"""Limits that slow motion always trips: of an axis that friction holds, a beam that is squared."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from motorctl.config.axis_keys import Gains, Limits
from motorctl.config.axis_parts import AxisParts
from motorctl.config.dual_drive_rules import COUNTS_AT_REST, check_skew_loop
from motorctl.config.guard_keys import Guards
from motorctl.config.heat_rules import PLACES
from motorctl.config.skew_motion import squaring_lag_m
from motorctl.config.validation import Finding
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.motion import RequiredVoltage

SURE_FRICTION = 0.5
"""Part of the friction at theta(0) that holds a beam back for certain while it is squared. Larger
refuses limits of beams that slide more easily than they were told to; smaller leaves to a note what
trips at each start. Chosen by hand."""


def check_slow_motion(document: Document, parts: AxisParts, rate_hz: float | None) -> list[Problem]:
    """Check the limits that the slow motion of an axis, or of its skew, is always beyond.

    Parameters
    ----------
    document
        The configuration.
    parts
        What could be read of the axis.
    rate_hz
        The axis' own, None where it cannot be read [Hz].

    Returns
    -------
    list of Problem
        Of limits that would always trip.
    """
    limits, guards, (friction_v, least_v) = parts.limits, parts.guards, _friction_v(parts)
    if limits is None or guards is None:
        return []
    found: list[Finding] = []
    least_m = COUNTS_AT_REST * parts.encoder.resolution_m if parts.encoder else 0.0
    need = parts.required_voltage()
    if least_v >= limits.max_voltage_v:
        words = (
            f"found {limits.max_voltage_v:g}, the axis could follow nothing: friction alone needs "
            f"{least_v:g} V, at the lower bound of the model's; should be above that"
        )
        found.append((("limits", "max_voltage_v"), words))
    elif parts.gains and need and friction_v > 0.0:
        found += _held_back(limits, guards, parts.gains, need, friction_v, least_m)
    if parts.dual and rate_hz:
        found += _squared(parts, guards, friction_v, rate_hz, least_m)
    return parts.problems(document, found)


def _friction_v(parts: AxisParts) -> tuple[float, float]:
    """Return the friction of the direction alone, at theta(0) and at its lower bound; 0 without."""
    place = parts.model.index_of("direction") if parts.model else None
    if place is None:
        return 0.0, 0.0
    return parts.estimates[place].initial, parts.estimates[place].lower


def _held_back(
    limits: Limits,
    guards: Guards,
    gains: Gains,
    need: RequiredVoltage,
    friction_v: float,
    least_m: float,
) -> Iterator[Finding]:
    """Look at the slow motion in which friction holds an axis back the furthest.

    From rest, with the reference at v, e = v t: the command ks (v + k1 e) + gamma_d (e + k1 e^2 /
    2v) has to reach the friction. Of all v, e is largest at v = e sqrt(gamma_d k1 / 2ks), where
    e = friction / (ks k1 + gamma_d + sqrt(2 ks k1 gamma_d)). What the model compensates at that
    speed does not hold it back. Limits up to least_m are refused already: they trip at rest.
    """
    ks, k1, gamma = gains.ks_v_s_m, gains.k1_1_s, gains.gamma_d
    stiffness_v_m = ks * k1 + gamma + math.sqrt(2.0 * ks * k1 * gamma)
    speed = friction_v / stiffness_v_m * math.sqrt(gamma * k1 / (2.0 * ks))
    held_m = (friction_v - _compensated_v(limits, need, speed)) / stiffness_v_m
    error, stuck = limits.following_error, guards.encoder_stuck
    own = stuck is not None and stuck.distance_m is not None
    distance_m = guards.stuck_distance_m(error.minimum_m)
    allowed_m = error.minimum_m + error.per_velocity_s * speed
    behind = held_m - allowed_m > error.filter_time_s * speed
    always = ["following_error"] if behind else []
    told = (
        f"would always trip in slow motion: at {speed:.2g} m/s friction of {friction_v:g} V, at "
        f"theta(0), holds the axis back by {held_m:.3g} m until ks {ks:g}, k1 {k1:g} and gamma_d "
        f"{gamma:g} overcome it; should be above that"
    )
    if stuck and least_m < distance_m < held_m:
        if own:
            place = ("guards", "encoder_stuck", "distance_m")
            yield place, f"found {distance_m:g}, {told}"
        else:
            always.append("encoder_stuck (whose distance_m is not written)")
    if always and error.minimum_m > least_m:
        names = " and ".join(f"guards.{name}" for name in always)
        place = ("limits", "following_error", "minimum_m")
        yield place, f"found {error.minimum_m:g}, {names} {told}"


def _compensated_v(limits: Limits, need: RequiredVoltage, speed: float) -> float:
    """Return what the model adds for the direction and the speed, on the mean over the travel."""
    places, still = np.linspace(*limits.travel_m, PLACES), np.zeros(PLACES)
    there, back = (need(places, np.full(PLACES, v), still) for v in (speed, -speed))
    return 0.5 * float(np.mean(there - back))


def _squared(
    parts: AxisParts, guards: Guards, friction_v: float, rate_hz: float, least_m: float
) -> Iterator[Finding]:
    """Look at a beam that is led to square from as far askew as it may stand, by little friction.

    All of its friction may hold it back further, which is noted.
    """
    dual, guard = parts.dual, guards.skew
    if dual is None or guard is None or parts.model is None or parts.adaptation is None:
        return
    skew, delay_s = dual.skew, parts.adaptation.input_delay_s
    if any(check_skew_loop(skew, parts.model, delay_s, rate_hz)):
        return  # which is told already
    lag_m = squaring_lag_m(dual, guard.limit_m, 0.0, 1.0 / rate_hz)
    why = f"by inertia {skew.inertia_v_s2_m:g} V*s^2/m and ks {skew.ks_v_s_m:g} alone"
    if guard.limit_m > lag_m and friction_v > 0.0:
        sure_v = SURE_FRICTION * friction_v
        lag_m = squaring_lag_m(dual, guard.limit_m, sure_v, 1.0 / rate_hz)
        why = (
            f"with {sure_v:g} V of friction already, {SURE_FRICTION:g} of that at theta(0), around "
            f"ks {skew.ks_v_s_m:g} and k1 {skew.k1_1_s:g}"
        )
    if least_m < guard.limit_m <= lag_m:
        yield (
            ("guards", "skew", "limit_m"),
            f"found {guard.limit_m:g}, would always trip while a beam that stands askew is squared "
            f"at squaring_velocity_m_s {skew.squaring_velocity_m_s:g} m/s: the skew loop stays "
            f"{lag_m:.3g} m behind, {why}; should be above that, or the squaring slower",
        )
