"""What an effect tells of itself to those who look for it, draw it or write it down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Group = Literal[
    "friction",
    "friction_of_position",
    "force_of_position",
    "wave_over_position",
    "wave_over_time",
    "line_over_time",
    "resonance",
    "command_timing",
    "coupling",
    "wave_of_measurement",
]
"""What code that must treat kinds of effects apart may ask for; effects of one group look alike.

- friction: opposes the motion; pictures and sums of friction contain it
- friction_of_position: friction whose level position decides; asked away from where the axis turned
- force_of_position: position alone decides it, and it is a force on the carriage
- wave_over_position: repeats over the travel; its options are `PitchOptions`
- wave_of_measurement: repeats over the travel, but in the measured position alone
- wave_over_time: repeats over time; sought at the lines of a spectrum
- line_over_time: shows as a line in a spectrum over time, at `Effect.lines`
- resonance: rings at `Effect.lines`; its columns are formed on the rigid machine's acceleration
- command_timing: the command acts later than it was given
- coupling: the motion of other axes acts on this one
"""
WAVE_OF_FORCE: frozenset[Group] = frozenset({"force_of_position", "wave_over_position"})
"""Groups of a force that repeats over the travel, as magnets and teeth make it."""
Family = Literal[
    "friction",
    "force_of_position",
    "resonance",
    "command_timing",
    "disturbance_over_time",
    "coupling",
    "thrust",
    "moving_mass",
    "measurement",
]
"""Kinds of physics: a family may be sure where its member is not."""
FAMILY_OF_GROUP: Mapping[Group, Family] = {
    "friction": "friction",
    "force_of_position": "force_of_position",
    "resonance": "resonance",
    "command_timing": "command_timing",
    "wave_over_time": "disturbance_over_time",
    "coupling": "coupling",
}
"""The first that fits."""
Signal = Literal["acceleration", "velocity", "direction", "one"]
"""What the one column of a basic effect is; direction is the sign function of the velocity."""
Motion = Literal[
    "two_speeds", "two_accelerations", "slow_reversals", "fast_reversals", "longer_run"
]
"""Motions that tell effects apart; the report writes them as programs."""
PictureKind = Literal[
    "over_time",
    "folded_over_pitch",
    "thrust_over_position",
    "force_over_position",
    "friction_over_position",
    "error_over_period",
    "friction_over_velocity",
    "friction_after_reversal",
    "command_response",
    "force_response",
    "acting_command",
    "limit_over_speed",
    "gain_over_time",
    "mass_over_time",
    "folded_over_time",
    "other_axis",
]
"""How an effect may be drawn: one drawer each in the report."""


@dataclass(frozen=True)
class Picture:
    """How an engineer would draw an effect."""

    kind: PictureKind
    caption: str
    scale: float = 0.0
    """The effect's own size along the picture's horizontal axis, in its unit: a pitch [m], a speed
    [m/s], a half width [V], a frequency [Hz]; 0 where it has none."""
    damping_ratio: float = 0.0
    """Of a resonance."""


@dataclass(frozen=True)
class CarriedOver:
    """What of a found effect belongs into a configuration that starts anew at every start.

    A recording has a beginning and an end; a configuration has not. What happened at a time of the
    recording is kept as what it left behind.
    """

    kept: bool = True
    """Whether the effect itself stands in the refined configuration."""
    adds: Mapping[Signal, float] = field(default_factory=dict)
    """What is added to the parameters of the basic effects, in their units."""
    scale: float = 1.0
    """Factor by which every parameter of the model is multiplied."""
    note: str = ""
    """What the reader of the refined configuration has to know, as a sentence."""


def wave_end(parameter_name: str) -> str | None:
    """Return what follows sin or cos in a parameter's name.

    Two parameters with the same end, such as sin_3 and cos_3, are the parts of one wave: reports
    tell them as amplitude and phase, and a configuration lets both move as far as the larger.

    Parameters
    ----------
    parameter_name
        That of one parameter of an effect.

    Returns
    -------
    str or None
        Such as ``"_3"``, or the empty string; None where the name begins with neither.
    """
    for wave in ("sin", "cos"):
        if parameter_name.startswith(wave):
            return parameter_name.removeprefix(wave)
    return None


SEEN_PERIODS = 0.5
"""Periods of the highest frequency that something at a reversal takes at least to be told from any
other turning over. Larger doubts true presliding and Stribeck friction, smaller takes the corner of
any friction for them. Chosen by hand."""


@dataclass(frozen=True)
class Spans:
    """What a recording spans: from it an effect tells which of its forms are worth trying."""

    position_m: tuple[float, float]
    """Lowest and highest position."""
    speed_m_s: float
    """Top speed."""
    acceleration_m_s2: float
    """Top acceleration."""
    command_v: float
    """Largest command."""
    time_s: tuple[float, float]
    """First and last time."""
    period_s: float
    """Between two samples."""
    band_hz: float
    """Highest frequency that is looked at."""
    resolution_m: float
    """One count of the encoder, or what is as noisy; 0 where it is not known."""
    other_axes: tuple[str, ...] = ()
    """Axes whose motion was recorded too."""
    rotary: bool = False
    """Whether the position is an angle [rad]."""
    reversal_m_s2: float = 0.0
    """Acceleration with which the slower reversals are left; 0 where none is known."""
    one_way: bool = False
    """Whether the axis never turns round."""

    @property
    def travel_m(self) -> float:
        """Length of the travel that was used."""
        return self.position_m[1] - self.position_m[0]

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return self.time_s[1] - self.time_s[0]

    @property
    def unseen_way_m(self) -> float:
        """Way that every reversal makes before the band shows it."""
        return 0.5 * self.reversal_m_s2 * (SEEN_PERIODS / self.band_hz) ** 2

    @property
    def unseen_speed_m_s(self) -> float:
        """Speed that every reversal reaches before the band shows it."""
        return self.reversal_m_s2 * SEEN_PERIODS / self.band_hz
