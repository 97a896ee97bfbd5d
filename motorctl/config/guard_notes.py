"""What `check` notes of guards and ramps: allowed, but worth a second look."""

from __future__ import annotations

from collections.abc import Iterator

from motorctl.config.machine import Axis, Machine


def notes_on_guards(machine: Machine) -> Iterator[str]:
    """Yield where a guard comes late, or a ramp is more than the motor has at theta(0)."""
    for name, axis in machine.axes.items():
        yield from _ramps(axis)
        yield from _following_error(axis)
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
