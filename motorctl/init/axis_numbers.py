"""The numbers of an axis that nobody tells, from those that somebody does: arithmetic, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass

from motorctl.config.rules import COUNTS_AT_REST, stopping_distance_m
from motorctl.errors import UsageError
from motorctl.init.dual_drive import SkewNumbers, skew_numbers
from motorctl.init.first_gains import FirstGains, first_gains
from motorctl.init.known import AxisKnown
from motorctl.init.quantities import STANDARD_GRAVITY_M_S2
from motorctl.model import basic_effects
from motorctl.model.knowledge import Signal

Range = tuple[float, float]

ROLLING_FRICTION = 0.01
"""Friction of a guideway on rolling elements, with its seals, as a part of the moving weight.
Larger and smaller ones are learned: it is where the estimate begins. By hand, after catalogues."""
COMMAND_SHARE = 0.5
"""Of the full command, for accelerating: the other half is for friction, for errors of the mass and
for the feedback. Larger saturates with twice the mass, smaller is a slow machine. By hand."""
SPEED_UP_S, SPEED_UP_PERIODS = 0.02, 20
"""To reach the top speed takes so long at least, and so many periods: a stronger motor than that
needs no more of its force. By hand."""
SPEED_UP_SHARE = 0.5
"""And no longer than this part of the time in which the travel is crossed: to leave room."""
JERK_SHARE = 0.5
"""Of that time, for the acceleration to rise. Shorter shakes a machine, longer is a slow one."""
OFFSET_SHARE, FRICTION_SHARE, VISCOUS_SHARE = 0.3, 0.1, 0.2
"""Bounds of a constant force, of Coulomb friction and of viscous friction at the top speed, as
parts of the full command: more would leave too little for motion."""
LEARNED_SHARE = 0.1
"""Of the full command: what the fast adaptation may add, as on the published gantry."""
ERROR_SHARE = 0.2
"""Of the travel, which the following error may be at most while the axis holds."""
HELD_RATIO = 3.0
"""Following error at standstill over what friction holds a slow motion back by."""
COUNTS = 10 * COUNTS_AT_REST
"""Following error at standstill in counts at least: ten times of what is refused."""
FILTER_S, FILTER_PERIODS = 0.002, 5
"""For so long the following error may be beyond its limit: one bad sample is no fault."""
ROTARY_FRICTION = 0.01
"""Friction of what turns, as a part of the full command: nobody knows the load of its bearing.
Larger and smaller ones are learned. By hand."""
SHORTEST_FRICTION_S = 1e-4
"""In which friction near standstill may brake what turns to a part of e. Shorter than a sample
nothing tells of it, and simulation needs finer steps. Longer rounds the friction of small motors
off. By hand."""
PUBLISHED_ACCELERATION_M_S2, PUBLISHED_VELOCITY_M_S = 38.0, 1.5
"""Of the published gantry, whose covariances the effects have as defaults: an estimator's speed is
covariance times signal squared."""
HIGHEST_FILTER_RAD_S, FILTER_SHARE = 200.0, 0.1
"""Poles of the adaptation's filter: the default, and no more than this part of Nyquist's."""
LARGEST_COVARIANCE = 1e6
"""Beyond it the first samples alone decide. By hand."""


@dataclass(frozen=True)
class AxisNumbers:
    """What a configuration says of an axis in numbers."""

    known: AxisKnown
    delay_s: float
    """How late a command acts, beside the hold."""
    period_s: float
    inertia: float
    inertia_bounds: Range
    viscous: float
    viscous_bounds: Range
    friction: float
    friction_bounds: Range
    offset_bounds: Range
    covariances: tuple[float, float]
    """Of inertia and viscous friction."""
    acceleration_m_s2: float
    jerk_m_s3: float
    error_m: float
    error_per_velocity_s: float
    error_filter_s: float
    gains: FirstGains
    d_hat_max_v: float
    filter_rad_s: float
    gate_velocity_m_s: float
    gate_acceleration_m_s2: float
    skew: SkewNumbers | None
    """None: one motor."""


def axis_numbers(known: AxisKnown, period_s: float, delay_s: float) -> AxisNumbers:
    """Return the numbers of an axis.

    Parameters
    ----------
    known
        What is known of it.
    period_s
        Of its driver [s].
    delay_s
        How late a command acts by the driver's exchange [s].

    Raises
    ------
    UsageError
        Where what was told does not fit together; it names the option, and what would.
    """
    full, fastest = known.max_voltage_v, known.max_velocity_m_s
    low, high = known.travel_m
    inertia, friction, viscous = mechanics(known)
    inertia_bounds = _rounded(0.5 * inertia), _rounded(2.0 * inertia)
    speed_up_s = max(SPEED_UP_S, SPEED_UP_PERIODS * period_s)
    speed_up_s = min(speed_up_s, SPEED_UP_SHARE * (high - low) / fastest)
    acceleration = _acceleration(known, inertia, friction, speed_up_s)
    jerk = _rounded(acceleration / (JERK_SHARE * speed_up_s))
    _insist_on_room(known, acceleration, jerk)
    gains = first_gains(
        inertia, inertia_bounds, viscous, known.resolution_m, full, period_s, delay_s, known.name
    )
    return AxisNumbers(
        known=known,
        delay_s=delay_s,
        period_s=period_s,
        inertia=inertia,
        inertia_bounds=inertia_bounds,
        viscous=viscous,
        viscous_bounds=_from_zero("velocity", 5.0 * viscous, VISCOUS_SHARE * full / fastest),
        friction=friction,
        friction_bounds=_from_zero("direction", 3.0 * friction, FRICTION_SHARE * full),
        offset_bounds=(-_rounded(OFFSET_SHARE * full), _rounded(OFFSET_SHARE * full)),
        covariances=(
            _covariance("acceleration", PUBLISHED_ACCELERATION_M_S2 / acceleration),
            _covariance("velocity", PUBLISHED_VELOCITY_M_S / fastest),
        ),
        acceleration_m_s2=acceleration,
        jerk_m_s3=jerk,
        error_m=_error_m(known, gains, friction),
        error_per_velocity_s=_rounded(
            min(2.0 * (period_s + delay_s), ERROR_SHARE * (high - low) / fastest)
        ),
        error_filter_s=_rounded(
            min(max(FILTER_S, FILTER_PERIODS * period_s), ERROR_SHARE * (high - low) / fastest)
        ),
        gains=gains,
        d_hat_max_v=_rounded(min(max(LEARNED_SHARE * full, 3.0 * friction), full)),
        filter_rad_s=_rounded(min(HIGHEST_FILTER_RAD_S, FILTER_SHARE * math.pi / period_s)),
        gate_velocity_m_s=_gate(known, 0.02, fastest, PUBLISHED_VELOCITY_M_S),
        gate_acceleration_m_s2=_gate(known, 1.0, acceleration, PUBLISHED_ACCELERATION_M_S2),
        skew=skew_numbers(known, inertia, friction, period_s, delay_s),
    )


def _gate(known: AxisKnown, published: float, own_top: float, published_top: float) -> float:
    """Return above which speed or acceleration is learned: as published, or a share of the top."""
    if known.units.kind == "rotary":
        return _rounded(published * own_top / published_top)
    return _rounded(min(published, own_top / 20.0))


def mechanics(known: AxisKnown) -> tuple[float, float, float]:
    """Return inertia [V s^2/m], Coulomb friction [V] and viscous friction [V s/m] of an axis.

    Raises UsageError where they cannot be those of one.
    """
    inertia = _inertia(known)
    friction = _friction(known, inertia)
    (parameter,) = basic_effects()["velocity"]().parameters
    return inertia, friction, _rounded(min(friction / known.max_velocity_m_s, parameter.upper))


def friction_slope_s_m(known: AxisKnown) -> float | None:
    """Return how steeply friction turns over, s/rad; None: as it does by itself.

    The usual slope is that of a carriage. What turns crosses zero within a sample at it, and a
    model that is steeper than the samples are close tells nothing of friction there. Nor does one
    in which friction stops a small inertia sooner than within SHORTEST_FRICTION_S.
    """
    if known.units.kind == "linear":
        return None
    usual: float = basic_effects()["direction"]().options.slope_s_m  # type: ignore[attr-defined]
    inertia, friction, _ = mechanics(known)
    slope_s_m = usual * PUBLISHED_VELOCITY_M_S / known.max_velocity_m_s
    steepest_s_m = inertia / (friction * SHORTEST_FRICTION_S) if friction else math.inf
    return _rounded(min(slope_s_m, steepest_s_m))


def _inertia(known: AxisKnown) -> float:
    (parameter,) = basic_effects()["acceleration"]().parameters
    inertia = _rounded(known.inertia_v_s2_m)
    if not 2.0 * parameter.lower <= inertia <= 0.5 * parameter.upper:
        units, rotary = known.units, known.units.kind == "rotary"
        options = "--inertia and --torque-constant" if rotary else "--mass and --force-constant"
        raise UsageError(
            f"axis {known.name}: {known.mass_kg:g} {units.inertia} over "
            f"{known.force_constant_n_v:g} {units.force}/V is {inertia:g} "
            f"{units.words('V*s^2/m')}, should be {2.0 * parameter.lower:g} to "
            f"{0.5 * parameter.upper:g}: are the units of {options} right?"
        )
    return inertia


def _friction(known: AxisKnown, inertia: float) -> float:
    if known.friction_n is None:
        guess = ROLLING_FRICTION * STANDARD_GRAVITY_M_S2 * inertia
        if known.units.kind == "rotary":
            guess = ROTARY_FRICTION * known.max_voltage_v
        return _rounded(min(guess, 0.5 * FRICTION_SHARE * known.max_voltage_v))
    friction = _rounded(known.friction_n / known.force_constant_n_v)
    if 2.0 * friction >= known.max_voltage_v:
        most_n = 0.5 * known.max_voltage_v * known.force_constant_n_v
        raise UsageError(
            f"axis {known.name}: --friction {known.friction_n:g}{known.units.force} takes "
            f"{friction:g} V of {known.max_voltage_v:g} V, should be below "
            f"{most_n:g}{known.units.force}: half of the full command"
        )
    return friction


def _acceleration(known: AxisKnown, inertia: float, friction: float, speed_up_s: float) -> float:
    full = known.max_voltage_v
    told = known.max_acceleration_m_s2
    if told is None:
        strongest = COMMAND_SHARE * (full - 2.0 * friction) / inertia
        return _rounded_down(min(strongest, known.max_velocity_m_s / speed_up_s))
    most = (full - 2.0 * friction) / inertia
    if told > most:
        words = (
            f"axis {known.name}: --max-acceleration {told:g}m/s^2 needs "
            f"{told * inertia + 2.0 * friction:.3g} V with its friction, and the full command is "
            f"{full:g} V; should be at most {_rounded_down(most):g}m/s^2"
        )
        raise UsageError(known.units.words(words))
    return told


def _insist_on_room(known: AxisKnown, acceleration: float, jerk: float) -> None:
    """Refuse a top speed from which the travel is too short to stop in."""
    room = known.travel_m[1] - known.travel_m[0]
    needed = stopping_distance_m(known.max_velocity_m_s, acceleration, jerk)
    if needed <= room:
        return
    low, high = 0.0, known.max_velocity_m_s
    for _ in range(60):
        middle = 0.5 * (low + high)
        fits = stopping_distance_m(middle, acceleration, jerk) <= room
        low, high = (middle, high) if fits else (low, middle)
    words = (
        f"axis {known.name}: --max-velocity {known.max_velocity_m_s:g}m/s: to stop from it takes "
        f"{needed:.3g} m at {acceleration:g} m/s^2, {COMMAND_SHARE:.0%} of the full command, and "
        f"the travel is {room:g} m; should be at most {_rounded_down(low):g}m/s"
    )
    raise UsageError(known.units.words(words))


def _error_m(known: AxisKnown, gains: FirstGains, friction: float) -> float:
    """Return how far the axis may be from its reference at rest.

    As far as the full command pulls it against ks k1, and well beyond what friction holds a slow
    motion back by (`motorctl.config.slow_motion_rules`).
    """
    stiffness = gains.ks_v_s_m * gains.k1_1_s
    held = friction / (stiffness + gains.gamma_d + math.sqrt(2.0 * stiffness * gains.gamma_d))
    least = max(COUNTS * known.resolution_m, HELD_RATIO * held)
    most = ERROR_SHARE * (known.travel_m[1] - known.travel_m[0])
    if least > most:
        words = (
            f"axis {known.name}: a travel of {known.travel_m[1] - known.travel_m[0]:g} m is too "
            f"short for this loop: it may be {least:.3g} m behind, by a count of "
            f"{known.resolution_m:g} m, friction of {friction:g} V and k1 {gains.k1_1_s:g} 1/s; "
            "give a finer --encoder, or a higher --rate"
        )
        raise UsageError(known.units.words(words))
    return _rounded(min(max(least, known.max_voltage_v / stiffness), most))


def _from_zero(signal: Signal, *values: float) -> Range:
    """Return bounds from 0 to the largest of some values, as far as the parameter may go."""
    (parameter,) = basic_effects()[signal]().parameters
    return 0.0, _rounded(min(max(values), parameter.upper))


def _covariance(signal: Signal, ratio: float) -> float:
    (parameter,) = basic_effects()[signal]().parameters
    return _rounded(min(parameter.covariance * ratio**2, LARGEST_COVARIANCE))


def _rounded(value: float) -> float:
    """Return a number of three digits: nobody has told more."""
    return float(f"{value:.3g}")


def _rounded_down(value: float) -> float:
    """Return a number of two digits that is no larger."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / unit * (1.0 + 1e-12)) * unit:.2g}")
