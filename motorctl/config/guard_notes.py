"""What `check` notes of guards and ramps: allowed, but worth a second look."""

from __future__ import annotations

from collections.abc import Iterator

from motorctl.config.guard_keys import ORDINARY_PAUSE_S
from motorctl.config.machine import Axis, Machine


def notes_on_guards(machine: Machine) -> Iterator[str]:
    """Yield where a guard comes late or early, or a ramp is more than the motor has at theta(0)."""
    for name, axis in machine.axes.items():
        yield from _ramps(axis)
        yield from _following_error(axis)
        yield from _break_away(axis)
        if machine.loop.without_realtime == "degrade":
            yield from _short_pause(axis)
        late = machine.drivers[axis.driver].late
        yield from _blind_way(axis, late.hold_ticks, machine.period_of(name))


def _ramps(axis: Axis) -> Iterator[str]:
    limits, mass = axis.limits, axis.model.index_of("acceleration")
    assert mass is not None  # no configuration is valid without
    inertia = axis.estimates[mass].initial
    fullest = limits.max_voltage_v / inertia
    for key, asked, does in (
        ("max_acceleration_m_s2", limits.max_acceleration_m_s2, "it brakes hard with that"),
        ("stop.acceleration_m_s2", limits.stop.acceleration_m_s2, "it stops with that"),
    ):
        if asked > fullest:
            yield (
                f"axis {axis.name}: limits.{key} {asked:g} m/s^2 is more than the motor has: "
                f"{does}, and max_voltage_v {limits.max_voltage_v:g} V accelerate {inertia:g} "
                f"V*s^2/m, the inertia at theta(0), by {fullest:.3g} m/s^2"
            )


def _following_error(axis: Axis) -> Iterator[str]:
    limits, error = axis.limits, axis.limits.following_error
    fastest, travel = limits.max_velocity_m_s, limits.travel_m[1] - limits.travel_m[0]
    half = f"half of the travel of {travel:g} m or more"
    allowed = error.minimum_m + error.per_velocity_s * fastest
    unseen = error.filter_time_s * fastest
    if allowed >= 0.5 * travel:
        yield (
            f"axis {axis.name}: at {fastest:g} m/s limits.following_error allows {allowed:.3g} m, "
            f"{half}"
        )
    if unseen >= 0.5 * travel:
        yield (
            f"axis {axis.name}: within limits.following_error.filter_time_s "
            f"{error.filter_time_s:g} it can cross {unseen:.3g} m at {fastest:g} m/s, {half}"
        )


def _break_away(axis: Axis) -> Iterator[str]:
    """Note limits that friction alone takes the axis beyond where it begins to move slowly.

    In slow motion the model hardly compensates friction that depends on the direction, and until
    the fast adaptation has taken it up, ks k1 e has to be as much: it stands still meanwhile.
    """
    place = axis.model.index_of("direction")
    friction_v = axis.estimates[place].initial if place is not None else 0.0
    stiffness_v_m = axis.gains.ks_v_s_m * axis.gains.k1_1_s
    held_m = friction_v / stiffness_v_m
    stuck = axis.guards.encoder_stuck
    for key, limit_m in (
        ("limits.following_error.minimum_m", axis.limits.following_error.minimum_m),
        ("guards.encoder_stuck.distance_m", stuck.distance_m if stuck else None),
    ):
        if limit_m is not None and limit_m < held_m:
            yield (
                f"axis {axis.name}: {key} {limit_m:g} is less than friction holds the axis back by "
                f"where it begins to move slowly, {held_m:.3g} m: {friction_v:g} V at theta(0) by "
                f"ks k1 {stiffness_v_m:g} V/m; it may trip then"
            )


def _short_pause(axis: Axis) -> Iterator[str]:
    frozen_s = axis.guards.host_frozen.time_s
    if frozen_s is not None and frozen_s < ORDINARY_PAUSE_S:
        yield (
            f"axis {axis.name}: guards.host_frozen.time_s {frozen_s:g} trips on what is usual "
            f"without real time, where an ordinary computer pauses for up to {ORDINARY_PAUSE_S:g} "
            "s now and then, and loop.without_realtime degrade runs there, too"
        )


def _blind_way(axis: Axis, hold_ticks: int, period_s: float) -> Iterator[str]:
    limits = axis.limits
    fastest, travel = limits.max_velocity_m_s, limits.travel_m[1] - limits.travel_m[0]
    blind_s = hold_ticks * period_s
    if blind_s * fastest >= 0.5 * travel:
        yield (
            f"axis {axis.name}: drivers.{axis.driver}.late.hold_ticks {hold_ticks} leads it for "
            f"{blind_s:g} s without a sample, {blind_s * fastest:.3g} m at {fastest:g} m/s: half "
            f"of its travel of {travel:g} m or more before guards.no_new_sample trips"
        )
