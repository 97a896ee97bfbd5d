"""What `check` notes of guards and ramps: allowed, but worth a second look."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from motorctl.config.count_limits import too_fast_m_s
from motorctl.config.dual_drive_rules import most_skew_m
from motorctl.config.guard_keys import ORDINARY_PAUSE_S
from motorctl.config.keys import LoopSettings
from motorctl.config.machine import Axis, Machine

FAR_OUT = 0.1
"""A part of the travel: soft limits so far outside it are noted. Larger lets them lie behind the
end stops unsaid; smaller notes axes whose following error is that of their travel. By hand."""
LONG_HEAT_S = 3600.0
"""A motor whose model the full command trips only after so long is noted [s]: nobody waits for it,
and other guards trip on such a command within seconds. Longer says less of large motors, shorter
notes those whose housings take minutes. Chosen by hand."""
COARSE = 2.0
"""Times the top speed: overspeed that trips only there is noted. Larger says less of coarse
encoders, smaller, down to 1.2, notes every one. By hand."""


def notes_on_guards(machine: Machine, watchdogs_s: Mapping[str, float | None]) -> Iterator[str]:
    """Yield where a guard comes late or early, or a ramp is more than the motor has at theta(0).

    Parameters
    ----------
    machine
        A checked machine.
    watchdogs_s
        How long each driver's device goes on without a command [s]; None where nobody knows.

    Yields
    ------
    str
        A sentence with the axis, the key and the numbers.
    """
    yield from _late_ticks(machine.loop)
    for name, axis in machine.axes.items():
        period_s, watchdog_s = machine.period_of(name), watchdogs_s[axis.driver]
        yield from _ramps(axis)
        yield from _following_error(axis)
        yield from _soft_limits(axis)
        yield from _overspeed(axis, period_s)
        yield from _break_away(axis)
        yield from _square_offset(axis)
        yield from _slow_heat(axis)
        late = machine.drivers[axis.driver].late
        if machine.loop.without_realtime == "degrade":
            yield from _short_pause(axis, watchdog_s)
            if late.hold_ticks == 0 and not machine.drivers[axis.driver].cls.simulated:
                yield (
                    f"axis {name}: drivers.{axis.driver}.late.hold_ticks 0 trips "
                    "guards.no_new_sample at the first sample that comes a tick late, which is "
                    "usual without real time, and loop.without_realtime degrade runs there, too"
                )
        yield from _blind_way(axis, late.hold_ticks, period_s)
        if watchdog_s is not None and not machine.drivers[axis.driver].cls.simulated:
            yield from _left_alone(axis, watchdog_s)


def _late_ticks(loop: LoopSettings) -> Iterator[str]:
    if loop.without_realtime != "degrade":
        return
    at_once = loop.overrun_policy == "stop"
    if at_once or (loop.overrun_policy == "leaky_bucket" and loop.bucket_size == 1):
        key = "overrun_policy: stop" if at_once else "bucket_size 1"
        yield (
            f"loop.{key} stops the machine at the first late tick, which is usual without real "
            "time, and loop.without_realtime degrade runs there, too"
        )


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
    if max(allowed, unseen) < 0.5 * travel < allowed + unseen:
        yield (
            f"axis {axis.name}: at {fastest:g} m/s guards.following_error trips once the reference "
            f"is {allowed + unseen:.3g} m ahead of an axis that stands, {half}: "
            f"limits.following_error leaves it {allowed:.3g} m, and {unseen:.3g} m pass in "
            "its filter time"
        )
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


def _soft_limits(axis: Axis) -> Iterator[str]:
    beyond_m = axis.limits.following_error.minimum_m
    travel = axis.limits.travel_m[1] - axis.limits.travel_m[0]
    if beyond_m >= FAR_OUT * travel:
        yield (
            f"axis {axis.name}: guards.soft_limit trips limits.following_error.minimum_m "
            f"{beyond_m:g} m outside limits.travel_m, {FAR_OUT:.0%} of it or more: is there so "
            "much room before the end stops?"
        )


def _overspeed(axis: Axis, period_s: float) -> Iterator[str]:
    fastest, count_m = axis.limits.max_velocity_m_s, axis.encoder.resolution_m
    trips_m_s = too_fast_m_s(fastest, count_m, period_s)
    if trips_m_s >= COARSE * fastest:
        yield (
            f"axis {axis.name}: guards.overspeed trips only at {trips_m_s:.3g} m/s, for a top "
            f"speed of {fastest:g} m/s: a count of {count_m:g} m in a period of {period_s:g} s is "
            f"{count_m / period_s:.3g} m/s already"
        )


def _left_alone(axis: Axis, watchdog_s: float) -> Iterator[str]:
    limits = axis.limits
    fastest, travel = limits.max_velocity_m_s, limits.travel_m[1] - limits.travel_m[0]
    if 0.5 * travel <= watchdog_s * fastest < math.inf:
        yield (
            f"axis {axis.name}: where the computer dies, its device goes on with the last command "
            f"for the {watchdog_s:g} s of its watchdog, {watchdog_s * fastest:.3g} m at "
            f"{fastest:g} m/s: half of its travel of {travel:g} m or more"
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


def _square_offset(axis: Axis) -> Iterator[str]:
    """Note switches that are further apart than any beam is askew; where they are nobody says."""
    dual, homing = axis.dual_drive, axis.homing
    if dual is None or homing.method == "absolute":
        return
    offset_m, most_m = abs(dual.square_offset_m), most_skew_m(dual.skew, axis.limits)
    apart_m = dual.max_out_of_square_m or 0.0
    if offset_m > most_m + apart_m:
        yield (
            f"axis {axis.name}: dual_drive.square_offset_m {dual.square_offset_m:g} is more than "
            f"the beam can be askew, {most_m:.3g} m (max_voltage_v "
            f"{axis.limits.max_voltage_v:g} V by {dual.skew.stiffness_v_m:g} V/m), and "
            f"max_out_of_square_m {apart_m:g} m: unless the ends' switches or marks are mounted so "
            "far apart, each homing ends in the fault not_square"
        )


def _slow_heat(axis: Axis) -> Iterator[str]:
    thermal, full = axis.guards.thermal, axis.limits.max_voltage_v
    if thermal is None:
        return
    warm_s = -thermal.time_constant_s * math.log1p(-((thermal.continuous_voltage_v / full) ** 2))
    if warm_s >= LONG_HEAT_S:
        yield (
            f"axis {axis.name}: guards.thermal (continuous_voltage_v "
            f"{thermal.continuous_voltage_v:g}, time_constant_s {thermal.time_constant_s:g}) trips "
            f"a cold motor at max_voltage_v {full:g} V after {warm_s / 3600.0:.3g} h only: is "
            "that the time constant of its winding?"
        )


def _short_pause(axis: Axis, watchdog_s: float | None) -> Iterator[str]:
    frozen_s = axis.guards.host_frozen.time_s
    if watchdog_s is not None and watchdog_s < min(frozen_s or math.inf, ORDINARY_PAUSE_S):
        yield (
            f"axis {axis.name}: guards.host_frozen trips after {watchdog_s:g} s, its device's "
            f"watchdog, and without real time an ordinary computer pauses for up to "
            f"{ORDINARY_PAUSE_S:g} s now and then; loop.without_realtime degrade runs there, too"
        )
        return
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
