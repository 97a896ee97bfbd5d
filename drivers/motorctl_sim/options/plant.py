"""Options of one axis of the gantry: motor, guideway, encoder, switches, and its effects."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from motorctl_sim.options import effects, undeclared
from motorctl_sim.options.settings import MergedSettings, NonNegative, Positive

MAX_INDEX_MARKS = 16


class Amplifier(MergedSettings):
    """D/A converter and amplifier."""

    max_voltage_v: Positive = 10.0
    """The D/A converter's range is plus and minus this."""
    resolution_bits: int | None = Field(default=16, ge=4, le=32)
    """None: no steps."""


class Encoder(MergedSettings):
    """The encoder's own side; resolution and width of the counter come from the axis."""

    absolute: bool = True
    """Knows its position at power-on; else the counter starts at 0 wherever the carriage is."""
    reversed: bool = False
    """Counts fall as the position rises."""
    noise_rms_m: NonNegative = 0.0
    """White, before the count is rounded."""
    index_marks_m: tuple[float, ...] = Field(default=(), max_length=MAX_INDEX_MARKS)
    """Where the index marks are; the count is latched by hardware as the carriage passes one."""


class HomeSwitch(MergedSettings):
    """A switch that is pressed over a stretch of travel."""

    from_m: float | None = None
    """None: pressed from the negative end on."""
    to_m: float | None = None
    """None: pressed up to the positive end."""

    @model_validator(mode="after")
    def _has_an_edge(self) -> Self:
        if self.from_m is None and self.to_m is None:
            raise ValueError("give from_m or to_m: a switch that is always pressed has no edge")
        if self.from_m is not None and self.to_m is not None and self.from_m >= self.to_m:
            raise ValueError(f"from_m ({self.from_m}) must lie below to_m ({self.to_m})")
        return self


class EndStop(MergedSettings):
    """Rubber at both ends of `travel_m`; it only pushes, it never holds."""

    stiffness_v_m: Positive
    """Its stiffness over A1 [V/m]."""
    damping_v_s_m: NonNegative
    """Its damping over A1 [V s/m]."""


class Plant(MergedSettings):
    """One axis. Every force is in volts: newtons over the force constant A1."""

    inertia_v_s2_m: Positive
    """theta1 = M/A1, the whole moving mass."""
    viscous_friction_v_s_m: NonNegative
    """theta2 = B/A1."""
    coulomb_friction_v: NonNegative
    """theta3 = Af/A1."""
    friction_slope_s_m: Positive = 900.0
    """Slope of Sf(v) = (2/pi) arctan(slope v), where there is no `presliding`."""
    offset_v: float = 0.0
    """theta4: a constant force."""
    force_constant_ratio: Positive = 1.0
    """The motor's force constant over A1: of two motors on one beam, one may be stronger."""
    em_quadratic_1_v: float = 0.0
    """theta5 = A2/A1 of the thrust i + theta5 i|i| + theta6 i^3."""
    em_cubic_1_v2: float = 0.0
    """theta6 = A3/A1."""
    force_noise_rms_v: NonNegative = 0.0
    """White force noise, drawn anew each period."""

    travel_m: tuple[float, float]
    """Between the end stops."""
    initial_position_m: float = 0.0
    """Where the carriage stands at the start [m]; within travel_m."""
    initial_velocity_m_s: float = 0.0
    """How fast it moves at the start [m/s]."""
    end_stop: EndStop
    """What the carriage meets at both ends."""
    limit_switches_m: tuple[float, float] | None = None
    """Pressed at and below the first, at and above the second."""
    home_switch: HomeSwitch | None = None
    """Where the home switch is pressed; null: none."""
    amplifier: Amplifier = Amplifier()
    """The D/A converter's range and steps."""
    encoder: Encoder = Encoder()
    """Noise, direction and index marks of the encoder."""

    cogging: effects.Cogging | None = None
    """Force between iron core and magnets; null: none."""
    force_ripple: effects.ForceRipple | None = None
    """Force constant that changes over a pitch; null: none."""
    stribeck: effects.Stribeck | None = None
    """More friction at low speed; null: none."""
    asymmetric_friction: effects.AsymmetricFriction | None = None
    """Friction that differs between the directions; null: none."""
    presliding: effects.Presliding | None = None
    """Friction that is a spring before it slides; null: none."""
    position_dependent_friction: effects.PositionDependentFriction | None = None
    """Friction that changes over the travel; null: none."""
    position_force: effects.PositionForce | None = None
    """A force that depends on the position; null: none."""
    quadratic_drag: effects.QuadraticDrag | None = None
    """Drag with the square of the speed; null: none."""
    input_lag: effects.InputLag | None = None
    """The current lags behind the command; null: none."""
    input_delay: effects.InputDelay | None = None
    """The command acts later; null: none."""
    dead_zone: effects.DeadZone | None = None
    """Small commands do nothing; null: none."""
    gain_drift: effects.GainDrift | None = None
    """The force constant falls as the motor warms up; null: none."""
    payload_change: effects.PayloadChange | None = None
    """A load is put down or taken off; null: none."""
    cross_axis: effects.CrossAxis | None = None
    """Another channel's motion pulls; null: none."""
    flexible_mode: effects.FlexibleMode | None = None
    """A part of the mass hangs on a spring; null: none."""
    encoder_error: effects.EncoderError | None = None
    """The encoder's interpolation error; null: none."""
    periodic_disturbance: effects.PeriodicDisturbance | None = None
    """A force that repeats with time; null: none."""

    backlash: undeclared.Backlash | None = None
    """A part of the mass sits in a clearance; null: none."""
    friction_patch: undeclared.FrictionPatch | None = None
    """A sticky place; null: none."""
    friction_bump: undeclared.FrictionBump | None = None
    """A speed with more friction; null: none."""
    thrust_hysteresis: undeclared.ThrustHysteresis | None = None
    """Thrust that remembers its command; null: none."""
    wandering_force: undeclared.WanderingForce | None = None
    """A force that wanders with time; null: none."""

    @property
    def carriage_inertia_v_s2_m(self) -> float:
        """Theta1 less the parts that hang on a spring or sit in a clearance."""
        loose = sum(part.fraction for part in (self.flexible_mode, self.backlash) if part)
        return self.inertia_v_s2_m * (1.0 - loose)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        low, high = self.travel_m
        if low >= high:
            raise ValueError(f"travel_m: the first ({low}) must lie below the second ({high})")
        if not low <= self.initial_position_m <= high:
            raise ValueError(
                f"initial_position_m {self.initial_position_m} is outside travel_m [{low}, {high}]"
            )
        if self.limit_switches_m and self.limit_switches_m[0] >= self.limit_switches_m[1]:
            raise ValueError("limit_switches_m: the first must lie below the second")
        if self.carriage_inertia_v_s2_m <= 0.05 * self.inertia_v_s2_m:
            raise ValueError(
                "flexible_mode.fraction and backlash.fraction leave less than 5 % of the inertia "
                "to the carriage itself"
            )
        if self.payload_change:
            after = self.carriage_inertia_v_s2_m + self.payload_change.inertia_v_s2_m
            if after <= 0.05 * self.inertia_v_s2_m:
                raise ValueError(
                    f"payload_change.inertia_v_s2_m {self.payload_change.inertia_v_s2_m} takes "
                    "away more than 95 % of the inertia"
                )
        if self.presliding and not self.coulomb_friction_v:
            raise ValueError("presliding needs coulomb_friction_v above 0: it is its spring")
        return self
