"""Records of the tick: an axis' settings and its state, with named fields."""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from motorctl.config.exchange import has_own_clock, is_one_exchange
from motorctl.config.machine import Axis, DriverSetup
from motorctl.config.motor_heat import heat_kept
from motorctl.control import fill_by_name
from motorctl.log.sample import FaultCause

AXIS_GIVEN = (
    ("offset_m", "f8"),
    ("max_velocity_m_s", "f8"),
    ("max_acceleration_m_s2", "f8"),
    ("max_jerk_m_s3", "f8"),
    ("max_voltage_v", "f8"),
    ("following_error_minimum_m", "f8"),
    ("following_error_per_velocity_s", "f8"),
    ("stop_acceleration_m_s2", "f8"),
    ("stop_jerk_m_s3", "f8"),
    ("search_velocity_m_s", "f8"),
    ("latch_velocity_m_s", "f8"),
    ("home_position_m", "f8"),
    ("hold_ticks", "i8"),  # ticks without a new sample before it trips
    ("predict", "i8"),  # the model moves the position on meanwhile
)
"""Settings that the tick takes as the configuration says them: by the names of its keys, those of
a part of `limits` with the part's name before them."""

AXIS_SETTINGS = np.dtype(
    [
        *AXIS_GIVEN,
        ("period_s", "f8"),
        ("metres_per_count", "f8"),  # signed by the direction
        ("counter_span", "i8"),  # 2^bits; 0: as wide as an int64, does not wrap
        ("travel_low_m", "f8"),
        ("travel_high_m", "f8"),
        ("error_ticks", "i8"),  # trip when exceeded for more than these
        ("absolute", "i8"),  # no homing: the encoder knows its position
        ("home_on_switch", "i8"),
        ("home_on_index", "i8"),
        ("homing_ticks", "i8"),  # timeout
        ("divisor", "i8"),  # ticks of the loop in one of the axis
        ("tick_s", "f8"),  # the loop's period; period_s is the axis' own
        ("asked", "i8"),  # a sample is taken when the loop asks, not by the device's clock
        ("max_excitation_v", "f8"),  # that an excitation may add to the command
        ("max_learned_v", "f8"),  # that what was learned may add; 0: the axis does not learn
        ("possible_acceleration_m_s2", "f8"),  # of the full voltage, or the limit if that is more
        ("exchange", "i8"),  # what a tick reads was sampled in the axis' tick before
        ("quick_stops", "i8"),  # causes for which the axis is ramped down: a bit each
        ("stuck_distance_m", "f8"),  # 0: not looked at, as with the next ones
        ("noise_rms_m", "f8"),
        ("noise_share", "f8"),  # of a tick in the mean square
        ("noise_most_m2", "f8"),  # that one tick counts for, where wild samples are left out
        ("saturation_ticks", "i8"),
        ("continuous_voltage_v", "f8"),
        ("heat_kept", "f8"),  # of the motor's heat, after a tick
        ("frozen_ticks", "i8"),  # ticks that may be skipped at once
        ("patience_ticks", "i8"),  # and after which the device is sure not to have given up
        ("frozen_by", "i8"),  # a StallLimit: which limit frozen_ticks are
        ("patience_by", "i8"),
        ("skew_limit_m", "f8"),  # of a dual drive
        ("group", "i8"),  # axes of one number stop together; 0: of none
        ("stops_with_program", "i8"),  # so do those that run one program
    ],
    align=True,
)

AXIS_STATE = np.dtype(
    [
        ("state", "i8"),  # motorctl.loop.states.State
        ("fault", "i8"),  # FaultCause
        ("fault_value", "f8"),
        ("fault_limit", "f8"),
        ("fault_time_s", "f8"),
        ("fault_status", "i8"),  # the driver's status word then
        ("fresh", "i8"),  # just enabled: the law starts in this tick
        ("homed", "i8"),
        ("have_counts", "i8"),
        ("raw_counts", "i8"),  # as last read
        ("blind_ticks", "i8"),  # since when the count cannot be trusted, or no new one came
        ("paused_ticks", "i8"),  # of these: the loop was stalled, or a sample older than that
        ("held_ticks", "i8"),  # since when no new one came
        ("doubted_ticks", "i8"),  # of these: a sample came, and was not believed
        ("doubted_raw_counts", "i8"),  # that sample
        ("doubted_blind_ticks", "i8"),  # blind_ticks when it had come
        ("doubted_miss_m", "f8"),  # how far it was from the prediction
        ("trust_ticks", "i8"),  # nothing is doubted in these
        ("doubt_level", "i8"),  # how much was doubted lately
        ("missed_ticks", "i8"),  # all without a new sample, since the loop began
        ("longest_missed_ticks", "i8"),
        ("held_status", "i8"),  # what the driver said meanwhile
        ("stalled_ticks", "i8"),  # skipped in a pause that the device may not have stood; 0: none
        ("gap_ticks", "i8"),  # periods that the law has not seen
        ("drift_m_s", "f8"),  # velocity beyond the desired one, smoothed: predictions start there
        ("counts", "i8"),  # unwrapped
        ("shift_m", "f8"),  # found by homing
        ("position_m", "f8"),
        ("velocity_m_s", "f8"),
        ("reference_m", "f8"),
        ("reference_velocity_m_s", "f8"),
        ("reference_acceleration_m_s2", "f8"),
        ("soft_low_m", "f8"),  # in force since the axis was enabled
        ("soft_high_m", "f8"),
        ("error_count", "i8"),  # ticks beyond the following error's limit
        ("fast_count", "i8"),  # ticks beyond the top speed
        ("step_counts", "i8"),  # of the last tick
        ("steps_follow", "i8"),  # and of the one before; no tick between them
        ("step_ticks", "i8"),  # that the last step took
        ("bend_counts", "i8"),  # by how much the two differ
        ("bend_m2", "f8"),  # mean square of that at rest
        ("stuck_counts", "i8"),  # where the count was when it last moved
        ("stuck_reference_m", "f8"),  # and the reference, without what it went while not led
        ("command_v", "f8"),  # that left in the last tick
        ("saturated_ticks", "i8"),  # since when it is at its limit
        ("excitation_ticks", "i8"),  # in a period of the excitation that is added; 0: none
        ("excitation_fade", "i8"),  # in which it comes, and goes
        ("excitation_total", "i8"),  # that it lasts
        ("excitation_passed", "i8"),  # since it began
        ("learned_on", "i8"),  # it is in cycles for which something was learned
        ("learned_rest_v", "f8"),  # what of its begin or end still fades
        ("learned_v", "f8"),  # that was added of what was learned, and of that rest
        ("heat_v2", "f8"),  # mean square of the command over the motor's time constant
        ("slot", "i8"),  # program slot followed, or -1
        ("program", "i8"),  # a number that the axes of one running program share; 0: none
        ("passed_on", "i8"),  # the partners of this axis have been stopped for its fault
        ("start_tick", "i8"),
        ("brake", "i8"),  # how the axis stops, once that is decided
        ("ramp_velocity_m_s", "f8"),  # where the last ramp leads, and its limits
        ("ramp_acceleration_m_s2", "f8"),
        ("ramp_jerk_m_s3", "f8"),
        ("segment", "i8"),
        ("segment_time_s", "f8"),
        ("phase", "i8"),  # of homing
        ("phase_ticks", "i8"),
        ("seen", "i8"),  # the home switch was pressed in this phase
        ("blurred", "i8"),  # an end's edge passed in a pause, in this phase
        ("latched_m", "f8"),
        ("status", "i8"),  # the driver's status word
    ],
    align=True,
)

# A prediction starts from the last velocities, each with this weight: one sample that came late
# reads as up to twice the speed.
DRIFT_WEIGHT = 0.1
# Where the model can stand in, a sample is doubted that no motion explains: one that is off by more
# than half a period's motion, by this many times what the full voltage accelerates since the last
# tick, and by what a prediction may have missed of it since the last sample. If the next one is off
# as well, and on the same side, it is motion, and nothing is doubted until so many ticks have
# brought what was expected: a knock must not be answered with predictions.
DOUBT_PERIODS = 0.5
DOUBT_ACCELERATION_RATIO = 4.0
MISSED_ACCELERATION_RATIO = 0.25
TRUSTED_TICKS = 40
# After more skipped periods than these no sample is doubted.
MOST_DOUBTED_TICKS = 4
# An edge of a home switch that passed within more ticks than these is met again: its place is known
# no better than the way of so many. Fewer let homing begin again on computers that skip periods now
# and then, more let a pause be part of the zero. Chosen by hand.
SHARP_TICKS = 3
# An encoder whose samples are doubted again and again is broken, and shall trip the axis: a doubt
# counts for so many ticks, and beyond so much nothing is doubted.
DOUBT_TICKS = 10
MOST_DOUBT = 20
# One wild sample that is left out bends three steps. Each counts for this part of what would trip
# the noise guard, at most: so one alone never trips as noise, and two that come soon do.
MOST_OF_ONE_BEND = 0.25
# But at least for so many squares of the limit: a mean over a few ticks could else never trip.
LEAST_OF_ONE_BEND = 4.0
# From one command to the next a pause lasts up to so many periods more than it skips: the one that
# would have passed anyhow, and one by which the last command was early or the next is late. Fewer
# tell a watchdog that fired in a pause as a fault of the device, more blame harmless pauses.
COMMAND_PERIODS = 2
# Below this share of the top speed an axis counts as standing.
STANDSTILL_RATIO = 0.01
# A motor that tripped on its heat has cooled down at this share of its continuous voltage: a fifth
# less heat. Nearer to 1 it would trip again at once, lower down it would have to wait for long.
COOLED_RATIO = 0.9
# Where the number of a `StallLimit` stands in `fault_status`: above a driver's 32 bits.
STALL_LIMIT_SHIFT = 32
DEVICE_WORD_MASK = (1 << STALL_LIMIT_SHIFT) - 1  # those
STALL_LIMIT_MASK = 0x7


class StallLimit(IntEnum):
    """Which limit a stall of the loop was beyond that tripped an axis."""

    HOST_FROZEN = 1
    WATCHDOG = 2
    COMMANDS_APART = 3
    """The watchdog, less what lies between two commands besides: COMMAND_PERIODS."""
    HOLD_TICKS = 4
    COUNTER = 5
    """How long the encoder's counter needs for a quarter of its range."""


def fill_axis_settings(
    record: np.void,
    axis: Axis,
    setup: DriverSetup,
    tick_s: float,
    exchange_delay: float,
    watchdog_s: float | None,
) -> None:
    """Write an axis' settings into a record.

    Parameters
    ----------
    record
        Of AXIS_SETTINGS.
    axis, setup
        The axis and its driver's configuration.
    tick_s
        The loop's period [s].
    exchange_delay
        How much older than the tick the driver's sample is [periods of the axis].
    watchdog_s
        How long the device goes on without a command [s]; None where nobody knows.
    """
    limits, homing, encoder = axis.limits, axis.homing, axis.encoder
    asked = {key: 0.0 if value is None else value for key, value in homing}  # None: not searched
    given = limits.flat() | encoder.flat() | setup.late.flat() | asked
    fill_by_name(record, (name for name, _ in AXIS_GIVEN), given)
    period_s = tick_s * axis.divisor
    record["period_s"] = period_s
    record["divisor"], record["tick_s"] = axis.divisor, tick_s
    record["exchange"] = is_one_exchange(exchange_delay)
    record["asked"] = not has_own_clock(exchange_delay)
    record["max_excitation_v"] = limits.max_excitation_v
    record["max_learned_v"] = axis.max_learned_v
    mass = axis.model.index_of("acceleration")
    assert mass is not None  # no configuration is valid without
    fullest_m_s2 = limits.max_voltage_v / axis.estimates[mass].initial
    record["possible_acceleration_m_s2"] = max(fullest_m_s2, limits.max_acceleration_m_s2)
    record["metres_per_count"] = encoder.direction * encoder.resolution_m
    record["counter_span"] = 1 << encoder.counter_bits if encoder.counter_bits < 63 else 0
    record["travel_low_m"], record["travel_high_m"] = limits.travel_m
    record["error_ticks"] = round(limits.following_error.filter_time_s / period_s)
    record["absolute"] = homing.method == "absolute"
    record["home_on_switch"] = homing.method in ("switch", "switch_index")
    record["home_on_index"] = homing.method in ("index", "switch_index")
    fill_guards(record, axis, period_s, watchdog_s)
    record["homing_ticks"] = round(asked["timeout_s"] / period_s)


_CAUSES = {cause.guard: cause for cause in FaultCause}
"""By the key of the guard: its number is its bit of `quick_stops`."""


def fill_guards(record: np.void, axis: Axis, period_s: float, watchdog_s: float | None) -> None:
    """Write the limits of an axis' guards into a record of AXIS_SETTINGS.

    period_s is the axis'. Of a device whose watchdog nobody knows, it is that no sample may be
    missing for longer than `hold_ticks`, which the record has already.
    """
    guards, limits = axis.guards, axis.limits
    record["skew_limit_m"] = guards.skew.limit_m if guards.skew else 0.0
    record["quick_stops"] = sum(
        1 << _CAUSES[name]
        for name, guard in guards
        if guard is not None and guard.reaction == "quick_stop"
    )
    record["stuck_distance_m"] = guards.stuck_distance_m(limits.following_error.minimum_m)
    if guards.encoder_noise:
        record["noise_rms_m"] = guards.encoder_noise.rms_m
        share = -math.expm1(-period_s / guards.encoder_noise.filter_time_s)
        most = max(MOST_OF_ONE_BEND / share, LEAST_OF_ONE_BEND)
        record["noise_share"] = share
        record["noise_most_m2"] = most * guards.encoder_noise.rms_m**2
    if guards.saturation:
        record["saturation_ticks"] = max(1, round(guards.saturation.time_s / period_s))
    if guards.thermal:
        record["continuous_voltage_v"] = guards.thermal.continuous_voltage_v
        record["heat_kept"] = heat_kept(guards.thermal.time_constant_s, period_s)
    held_ticks = record["hold_ticks"] if record["exchange"] else math.inf
    frozen_s = guards.frozen_s(period_s, watchdog_s, held_ticks * period_s)
    frozen_ticks = max(1 if held_ticks else 0, round(frozen_s / period_s))
    frozen_by = patience_by = StallLimit.HOLD_TICKS
    if frozen_s == guards.frozen_s(period_s, None, math.inf):
        frozen_by = StallLimit.HOST_FROZEN
    elif frozen_s == watchdog_s:
        frozen_by = StallLimit.WATCHDOG
    if watchdog_s is None:
        patience_ticks = int(record["hold_ticks"])
    elif math.isfinite(watchdog_s):
        patience_ticks = max(0, math.floor(watchdog_s / period_s) - COMMAND_PERIODS)
        patience_by = StallLimit.COMMANDS_APART
    else:
        patience_ticks = frozen_ticks
    if patience_ticks >= frozen_ticks:
        patience_ticks, patience_by = frozen_ticks, frozen_by
    record["frozen_ticks"], record["frozen_by"] = frozen_ticks, frozen_by
    record["patience_ticks"], record["patience_by"] = patience_ticks, patience_by
