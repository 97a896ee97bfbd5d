"""The keys of an axis' guards: what trips it beside its `limits`, and how far that may go."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from motorctl.config.keys import Keys, Positive

JUMP_SPEED_RATIO = 4.0
"""A step of the count beyond this many times the top speed is no motion: it trips as a jump."""
JUMP_COUNTS = 8
"""Counts that a step may have besides, so that slow axes with coarse encoders do not trip."""
COUNTER_PARTS = 4
"""A step of the count of one of so many parts of the counter's range, or more, trips as a jump: it
could be motion either way. More ask for wider counters, with fewer a count that went backwards
would be taken for motion forwards. Chosen by hand: half of what two's complement can tell."""
LATE_READ_PERIODS = 2.0
"""A read that comes late brings the motion of up to so many periods [periods] in one tick. Larger
asks for counters that no axis needs; smaller lets a pause of the computer be told as a jump. By
definition: where it comes later still, a period is skipped, and known to be."""
OVERSPEED_RATIO = 1.2
"""Motion may exceed the top speed by this much, for some ticks, before it trips the axis."""
OVERSPEED_TICKS = 5
"""In so many samples in a row the axis has to be too fast. A late read sees the motion of up to two
periods in one; but lateness cannot grow by a fifth of a period in each of five ticks without a
whole period being skipped. Fewer trip on late reads, more let the axis go further. Arithmetic."""
OVERSPEED_COUNTS = 2
"""Counts a period that the speed may be above that, besides: one count more or less is no speed.
More let slow axes with coarse encoders be too fast, fewer trip them. Arithmetic."""
ORDINARY_PAUSE_S = 0.01
"""An ordinary computer without real time pauses for so long now and then [s]. Longer notes guards
that work, shorter does not note those that trip within minutes. Chosen by hand: pauses of 8 ms were
met."""
FROZEN_S = 10.0 * ORDINARY_PAUSE_S
"""No tick for so long is a computer that stands still: ten times what an ordinary one pauses, and
what devices' watchdogs usually wait for."""
FROZEN_PERIODS = 3
"""And at least so many periods of the axis: of slow axes, one that is skipped is no standstill."""

STALLED_S = 1.0
"""A loop that has not ticked for so long is dead: the supervisor ends it and disables its outputs
[s]. Longer leaves a machine for longer to its device's watchdog, shorter ends loops over pauses
that ordinary computers make. Chosen by hand."""


Reaction = Literal["quick_stop", "disable"]
"""quick_stop: the axis is ramped down and then disabled; disable: zero volts at once."""


class Disables(Keys):
    """A guard that lets its axis go at once, unless it is told to ramp it down."""

    reaction: Reaction = Field(default="disable", description="what happens when it trips")


class Stops(Keys):
    """A guard that ramps its axis down, unless it is told to let it go at once."""

    reaction: Reaction = Field(default="quick_stop", description="what happens when it trips")


class EncoderStuck(Disables):
    """Trip where the reference moves by distance_m and the count stands still, within one count."""

    distance_m: Positive | None = Field(
        default=None, description="null: limits.following_error.minimum_m"
    )


class EncoderNoise(Disables):
    """Trip where the count at standstill is noisier than any motion could make it.

    Looked at is the second difference of the position from tick to tick: of motion it is at most
    the acceleration times the period squared.
    """

    rms_m: Positive = Field(description="most rms of the second difference while the axis holds")
    filter_time_s: Positive = Field(default=0.1, description="over which the rms is taken")


class Saturation(Disables):
    """Trip where the command stands at the voltage limit for time_s longer than below it."""

    time_s: Positive = Field(
        default=0.5, description="how long it may stand at max_voltage_v; time below is taken off"
    )


class Thermal(Stops):
    """Trip where the motor would become too warm: I2t, with the command in the current's place.

    The mean square of the command, over time_constant_s, may not exceed that of the continuous one.
    """

    continuous_voltage_v: Positive = Field(
        description="command that the motor can carry continuously: its continuous force in "
        "newtons divided by its force per volt of command"
    )
    time_constant_s: Annotated[float, Field(ge=1e-3, le=1e5)] = Field(
        description="thermal time constant of the motor's winding"
    )


class Skew(Disables):
    """Trip where the two ends of a dual drive are too far apart.

    From how the skew loop holds them: square, once the axis is homed and the beam led there.
    """

    limit_m: Positive = Field(description="most that one end may be ahead of the other")


class HostFrozen(Disables):
    """Trip where the computer stood still: no tick came for time_s."""

    time_s: Annotated[float, Field(gt=0, le=10)] | None = Field(
        default=None,
        description="null: 0.1 s, or three periods of the axis if that is more; at most the "
        "watchdog of the device, which has switched off by then, and, where samples come in one "
        "exchange a period, late.hold_ticks: the first one after a pause is older than it",
    )


_NO_PLACE = "without a position that can be trusted no ramp can be followed"
_NO_FORCE = "without the amplifier nothing brakes"
_NO_DEVICE = "without the device neither a position nor a command gets through"
NO_QUICK_STOP = {
    "encoder_lost": _NO_PLACE,
    "encoder_jump": _NO_PLACE,
    "encoder_stuck": _NO_PLACE,
    "encoder_noise": _NO_PLACE,
    "not_a_number": "the law has no command to brake with",
    "amplifier": _NO_FORCE,
    "estop": "an emergency stop takes the power away",
    "communication": _NO_DEVICE,
    "no_new_sample": _NO_DEVICE,
}
"""Guards that can only let their axis go, and why."""


class Guards(Keys):
    """What trips an axis, how far some of it may go, and how each reacts.

    The other limits stand where they belong: under `limits`, in the driver's `late`, in `loop`.
    """

    following_error: Disables = Field(
        default_factory=Disables,
        description="too far from the reference: limits.following_error",
    )
    soft_limit: Disables = Field(
        default_factory=Disables, description="a homed axis leaves its travel: limits.travel_m"
    )
    limit_switch: Disables = Field(
        default_factory=Disables,
        description="a limit switch is pressed on the way",
    )
    overspeed: Disables = Field(
        default_factory=Disables,
        description="faster than 1.2 times limits.max_velocity_m_s and two counts a period",
    )
    encoder_lost: Disables = Field(default_factory=Disables, description="the driver reports it")
    encoder_jump: Disables = Field(
        default_factory=Disables, description="the count went where no motion leads"
    )
    encoder_stuck: EncoderStuck | None = Field(
        default_factory=EncoderStuck,
        description="the count stands still while the reference moves",
    )
    encoder_noise: EncoderNoise | None = Field(
        default=None, description="noise of the count at standstill; null: not looked at"
    )
    saturation: Saturation | None = Field(
        default_factory=Saturation, description="the command stands at its limit for too long"
    )
    thermal: Thermal | None = Field(
        default=None, description="I2t model of the motor; null: none, its limit is not known"
    )
    skew: Skew | None = Field(
        default=None, description="the ends of a dual drive are too far apart; needed there"
    )
    host_frozen: HostFrozen = Field(
        default_factory=HostFrozen, description="the computer stood still for too long"
    )
    not_a_number: Disables = Field(
        default_factory=Disables, description="the law computes a command that is not finite"
    )
    amplifier: Disables = Field(
        default_factory=Disables, description="the driver reports a fault of the amplifier"
    )
    estop: Disables = Field(
        default_factory=Disables, description="the driver reports an emergency stop"
    )
    communication: Disables = Field(
        default_factory=Disables, description="the driver reports that it has lost the device"
    )
    no_new_sample: Disables = Field(
        default_factory=Disables,
        description="no sample for more than late.hold_ticks",
    )
    late_ticks: Stops = Field(default_factory=Stops, description="overruns: loop.overrun_policy")
    supervisor_lost: Stops = Field(
        default_factory=Stops, description="the supervisor process gives no sign of life"
    )
    partner: Stops = Field(
        default_factory=Stops, description="an axis tripped that this one stops together with"
    )

    def stuck_distance_m(self, following_error_minimum_m: float) -> float:
        """Return how far the reference may move while the count stands still; 0: as far as it will.

        Parameters
        ----------
        following_error_minimum_m
            The axis' following error at rest, which stands in where nothing is written [m].
        """
        if self.encoder_stuck is None:
            return 0.0
        return self.encoder_stuck.distance_m or following_error_minimum_m

    def frozen_s(self, period_s: float, watchdog_s: float | None, held_s: float) -> float:
        """Return for how long the computer may stand still [s].

        Parameters
        ----------
        period_s
            The axis' period [s].
        watchdog_s
            How long its device goes on without a command [s]; None where nobody knows. Beyond that
            its amplifier is off, also where the device has no way to tell.
        held_s
            How long the axis may be led without a sample of after the pause [s]; infinite where the
            first tick after it brings one.
        """
        time_s = self.host_frozen.time_s or max(FROZEN_S, FROZEN_PERIODS * period_s)
        return min(time_s, math.inf if watchdog_s is None else watchdog_s, held_s)
