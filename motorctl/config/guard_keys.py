"""The keys of an axis' guards: what trips it beside its `limits`, and how far that may go."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from motorctl.config.keys import Keys, Positive

JUMP_SPEED_RATIO = 4.0
"""A step of the count beyond this many times the top speed is no motion: it trips as a jump."""
JUMP_COUNTS = 8
"""Counts that a step may have besides, so that slow axes with coarse encoders do not trip."""
FROZEN_S = 0.1
"""No tick for so long is a computer that stands still: ten times what an ordinary one pauses, and
what devices' watchdogs usually wait for."""
FROZEN_PERIODS = 3
"""And at least so many periods of the axis: of slow axes, one that is skipped is no standstill."""


class EncoderStuck(Keys):
    """Trip where the reference moves by distance_m and the count stands still, within one count."""

    distance_m: Positive | None = Field(
        default=None, description="null: limits.following_error.minimum_m"
    )


class EncoderNoise(Keys):
    """Trip where the count trembles at rest more than any motion could make it.

    Looked at is the second difference of the position from tick to tick: of motion it is at most
    the acceleration times the period squared.
    """

    rms_m: Positive = Field(description="most rms of the second difference while the axis holds")
    filter_time_s: Positive = Field(default=0.1, description="over which the rms is taken")


class Saturation(Keys):
    """Trip where the command stands at the voltage limit for time_s without a break."""

    time_s: Positive = Field(default=0.5, description="how long it may stand at max_voltage_v")


class Thermal(Keys):
    """Trip where the motor would become too warm: I2t, with the command in the current's place.

    The mean square of the command, over time_constant_s, may not exceed that of the continuous one.
    """

    continuous_voltage_v: Positive = Field(
        description="command that the motor stands for ever: its continuous force in newtons "
        "divided by its force per volt of command"
    )
    time_constant_s: Annotated[float, Field(ge=1e-3, le=1e5)] = Field(
        description="thermal time constant of the motor's winding"
    )


class HostFrozen(Keys):
    """Trip where the computer stood still: no tick came for time_s."""

    time_s: Annotated[float, Field(gt=0, le=10)] | None = Field(
        default=None, description="null: 0.1 s, or three periods of the axis if that is more"
    )


class Guards(Keys):
    """What trips an axis beside its limits; null switches a guard off."""

    encoder_stuck: EncoderStuck | None = Field(
        default_factory=EncoderStuck,
        description="the count stands still while the reference moves",
    )
    encoder_noise: EncoderNoise | None = Field(
        default=None, description="the count trembles at rest; null: not looked at"
    )
    saturation: Saturation | None = Field(
        default_factory=Saturation, description="the command stands at its limit for too long"
    )
    thermal: Thermal | None = Field(
        default=None, description="I2t model of the motor; null: none, its limit is not known"
    )
    host_frozen: HostFrozen = Field(
        default_factory=HostFrozen, description="the computer stood still for too long"
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

    def frozen_s(self, period_s: float) -> float:
        """Return for how long the computer may stand still [s].

        Parameters
        ----------
        period_s
            The axis' period [s].
        """
        return self.host_frozen.time_s or max(FROZEN_S, FROZEN_PERIODS * period_s)
