"""The known effects at full strength: what is drawn for each, as the simulator's options.

Sizes lie in the middle to upper part of what is typical on real gantries whose continuous thrust
of 279 N takes about 3.5 V (80 N/V).
"""

from __future__ import annotations

from collections.abc import Callable

from motorctl_benchmarks.diagnosis.draw import Draw
from motorctl_benchmarks.diagnosis.plants import AxisPlant, Options

Drawer = Callable[[Draw, AxisPlant], Options]

MAGNET_HARMONICS = (1, 2, 3, 4, 6)


def _pitch(draw: Draw) -> float:
    return draw.uniform(0.020, 0.060)


def _profile(draw: Draw, axis: AxisPlant, peak: float, spacing_m: float) -> Options:
    knots = max(5, round(axis.travel_m / spacing_m) + 1)
    step = axis.travel_m / (knots - 1)
    return {
        "position_m": [axis.low_m + k * step for k in range(knots)],
        "force_v": draw.smooth_values(knots, peak),
    }


def _cogging(draw: Draw, axis: AxisPlant) -> Options:
    """Draw 1 to 4 harmonics of 0.12 to 0.25 V together; three in ten with an aperiodic part."""
    peak = draw.uniform(0.12, 0.25)
    orders = sorted(draw.some(MAGNET_HARMONICS, draw.whole(1, 4)))
    options: Options = {
        "pitch_m": _pitch(draw),
        "harmonics": [
            {"order": order, "amplitude_v": share * peak, "phase_rad": draw.phase()}
            for order, share in zip(orders, draw.shares(len(orders)), strict=True)
        ],
    }
    if draw.chance(0.3):
        share = draw.uniform(0.1, 0.3)
        options["aperiodic"] = _profile(draw, axis, share * peak, 0.05)
    return options


def _force_ripple(draw: Draw, _: AxisPlant) -> Options:
    """Draw 1 to 3 harmonics of 5 to 10 % of the thrust together."""
    peak = draw.uniform(0.05, 0.10)
    orders = sorted(draw.some(MAGNET_HARMONICS, draw.whole(1, 3)))
    return {
        "pitch_m": _pitch(draw),
        "harmonics": [
            {"order": order, "amplitude": share * peak, "phase_rad": draw.phase()}
            for order, share in zip(orders, draw.shares(len(orders)), strict=True)
        ],
    }


def _stribeck(draw: Draw, axis: AxisPlant) -> Options:
    """Draw 30 to 50 % of Coulomb friction below 4 to 20 mm/s; exponent 1, 2 or between."""
    return {
        "force_v": draw.uniform(0.3, 0.5) * axis.coulomb,
        "velocity_m_s": draw.log_uniform(0.004, 0.020),
        "exponent": draw.pick((1.0, 2.0, draw.uniform(0.7, 2.0))),
    }


def _asymmetric_friction(draw: Draw, axis: AxisPlant) -> Options:
    """Draw directions that differ by 25 to 40 %: in viscous friction, in Coulomb's, or in both."""
    half = [draw.sign() * draw.uniform(0.125, 0.20) for _ in range(2)]
    coulomb, viscous = draw.pick(((1, 1), (0, 1), (1, 0)), (5, 3, 2))
    return {
        "coulomb_v": coulomb * half[0] * axis.coulomb,
        "viscous_v_s_m": viscous * half[1] * axis.viscous,
    }


def _presliding(draw: Draw, axis: AxisPlant) -> Options:
    """Draw Dahl's or LuGre's state with 15 to 50 um; LuGre's bristles damped to 0.1 to 0.5."""
    displacement = draw.uniform(15e-6, 50e-6)
    if draw.chance(0.5):
        return {"kind": "dahl", "displacement_m": displacement}
    critical = 2.0 * (axis.coulomb / displacement * axis.inertia) ** 0.5
    return {
        "kind": "lugre",
        "displacement_m": displacement,
        "micro_damping_v_s_m": draw.uniform(0.1, 0.5) * critical,
    }


def _position_dependent_friction(draw: Draw, axis: AxisPlant) -> Options:
    """Draw 25 to 40 % of Coulomb's level over the travel: a slope, a bow, or any profile."""
    change = draw.sign() * draw.uniform(0.25, 0.40) * axis.coulomb
    form = draw.pick(("linear", "quadratic", "profile"))
    if form == "linear":
        return {"center_m": axis.middle_m, "linear_v_m": change / axis.travel_m}
    if form == "quadratic":
        return {"center_m": axis.middle_m, "quadratic_v_m2": 4.0 * change / axis.travel_m**2}
    return {"profile": _profile(draw, axis, 0.7 * change, 0.08)}


def _position_force(draw: Draw, axis: AxisPlant) -> Options:
    """Draw 0.06 to 0.15 V at the ends of travel: spring, cubic, end effect, or any profile.

    A spring is that of a cable chain, and half of these turn with hysteresis, a fifth of the force.
    """
    peak = draw.uniform(0.06, 0.15)
    half = axis.travel_m / 2
    form = draw.pick(("spring", "cubic", "end_effect", "profile"), (4, 2, 2, 2))
    if form == "end_effect":
        length = draw.uniform(0.02, 0.06)
        return {"end_effect": {"force_v": draw.sign() * 2.0 * peak, "length_m": length}}
    if form == "profile":
        return {"profile": _profile(draw, axis, peak, 0.1)}
    options: Options = {"center_m": axis.middle_m}
    if form == "cubic":
        return options | {"cubic_v_m3": draw.sign() * peak / half**3}
    options["spring_v_m"] = draw.sign() * peak / half
    if draw.chance(0.5):
        length = draw.uniform(0.005, 0.02)
        options["cable"] = {"force_v": 0.2 * peak, "length_m": length}
    return options


def _quadratic_drag(draw: Draw, axis: AxisPlant) -> Options:
    """Draw a drag of 0.08 to 0.2 V at full speed."""
    return {"drag_v_s2_m2": draw.uniform(0.08, 0.20) / axis.max_velocity_m_s**2}


def _input_lag(draw: Draw, _: AxisPlant) -> Options:
    """Draw 0.5 to 0.9 ms; more would leave the loop hardly stable."""
    return {"time_s": draw.uniform(0.5e-3, 0.9e-3)}


def _input_delay(draw: Draw, _: AxisPlant) -> Options:
    """Draw 0.4 to 0.8 ms; more would leave the loop hardly stable."""
    return {"time_s": draw.uniform(0.4e-3, 0.8e-3)}


def _dead_zone(draw: Draw, _: AxisPlant) -> Options:
    """Draw 0.08 to 0.2 V either way."""
    return {"half_width_v": draw.uniform(0.08, 0.20)}


def _gain_drift(draw: Draw, _: AxisPlant) -> Options:
    """Draw a loss of 8 to 15 % with a time constant of 5 to 25 s."""
    return {"fraction": draw.uniform(0.08, 0.15), "time_constant_s": draw.log_uniform(5.0, 25.0)}


def _payload_change(draw: Draw, axis: AxisPlant) -> Options:
    """Draw 15 to 40 % of the mass put down between 5 and 18 s, or 15 to 30 % taken off."""
    added = draw.uniform(0.15, 0.40) if draw.chance(0.7) else -draw.uniform(0.15, 0.30)
    return {"time_s": draw.uniform(5.0, 18.0), "inertia_v_s2_m": added * axis.inertia}


def _cross_axis(draw: Draw, axis: AxisPlant) -> Options:
    """Draw 3 to 7 % of the moving mass, of either sign; half with a viscous part too."""
    viscous = draw.sign() * draw.uniform(0.02, 0.05) if draw.chance(0.5) else 0.0
    return {
        "acceleration_v_s2_m": draw.sign() * draw.uniform(0.03, 0.07) * axis.inertia,
        "velocity_v_s_m": viscous,
    }


def _flexible_mode(draw: Draw, _: AxisPlant) -> Options:
    """Draw 10 to 25 % of the mass on a spring of 50 to 150 Hz, damped by 0.5 to 3 %."""
    return {
        "frequency_hz": draw.log_uniform(50.0, 150.0),
        "damping_ratio": draw.uniform(0.005, 0.03),
        "fraction": draw.uniform(0.10, 0.25),
    }


def _encoder_error(draw: Draw, _: AxisPlant) -> Options:
    """Draw 0.2 to 0.4 um every 20 or 40 um."""
    return {
        "amplitude_m": draw.uniform(0.2e-6, 0.4e-6),
        "period_m": draw.pick((20e-6, 40e-6)),
        "phase_rad": draw.phase(),
    }


def _periodic_disturbance(draw: Draw, _: AxisPlant) -> Options:
    """Draw 0.05 to 0.15 V between 5 and 110 Hz; a fifth at 50 or 100 Hz, the mains'."""
    mains = draw.chance(0.2)
    return {
        "amplitude_v": draw.uniform(0.05, 0.15),
        "frequency_hz": draw.pick((50.0, 100.0)) if mains else draw.log_uniform(5.0, 110.0),
        "phase_rad": draw.phase(),
    }


KNOWN: dict[str, Drawer] = {
    "cogging": _cogging,
    "force_ripple": _force_ripple,
    "stribeck": _stribeck,
    "asymmetric_friction": _asymmetric_friction,
    "presliding": _presliding,
    "position_dependent_friction": _position_dependent_friction,
    "position_force": _position_force,
    "quadratic_drag": _quadratic_drag,
    "input_lag": _input_lag,
    "input_delay": _input_delay,
    "dead_zone": _dead_zone,
    "gain_drift": _gain_drift,
    "payload_change": _payload_change,
    "cross_axis": _cross_axis,
    "flexible_mode": _flexible_mode,
    "encoder_error": _encoder_error,
    "periodic_disturbance": _periodic_disturbance,
}
"""By the names that a diagnosis gives them, which are the simulator's too."""

NOT_TOGETHER = (frozenset({"input_lag", "input_delay"}),)
"""Nearly collinear: a log with both has no one right answer."""
