"""Options of one axis of the gantry: motor, guideway, encoder, switches, and its effects."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from motorctl_sim.options import effects, undeclared
from motorctl_sim.options.settings import NonNegative, Positive, Settings

MAX_INDEX_MARKS = 16


class Amplifier(Settings):
    """D/A converter and amplifier."""

    max_voltage_v: Positive = 10.0
    """The D/A converter's range is plus and minus this."""
    resolution_bits: int | None = Field(default=16, ge=4, le=32)
    """None: no steps."""


class Encoder(Settings):
    """The encoder's own side; resolution and width of the counter come from the axis."""

    absolute: bool = True
    """Knows its position at power-on; else the counter starts at 0 wherever the carriage is."""
    reversed: bool = False
    """Counts fall as the position rises."""
    noise_rms_m: NonNegative = 0.0
    """White, before the count is rounded."""
    index_marks_m: tuple[float, ...] = Field(default=(), max_length=MAX_INDEX_MARKS)
    """Where the index marks are; the count is latched by hardware as the carriage passes one."""


class HomeSwitch(Settings):
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


class EndStop(Settings):
    """Rubber at both ends of `travel_m`; it only pushes, it never holds."""

    stiffness_v_m: Positive
    damping_v_s_m: NonNegative


class Plant(Settings):
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
    initial_velocity_m_s: float = 0.0
    end_stop: EndStop
    limit_switches_m: tuple[float, float] | None = None
    """Pressed at and below the first, at and above the second."""
    home_switch: HomeSwitch | None = None
    amplifier: Amplifier = Amplifier()
    encoder: Encoder = Encoder()

    cogging: effects.Cogging | None = None
    force_ripple: effects.ForceRipple | None = None
    stribeck: effects.Stribeck | None = None
    asymmetric_friction: effects.AsymmetricFriction | None = None
    presliding: effects.Presliding | None = None
    position_dependent_friction: effects.PositionDependentFriction | None = None
    position_force: effects.PositionForce | None = None
    quadratic_drag: effects.QuadraticDrag | None = None
    input_lag: effects.InputLag | None = None
    input_delay: effects.InputDelay | None = None
    dead_zone: effects.DeadZone | None = None
    gain_drift: effects.GainDrift | None = None
    payload_change: effects.PayloadChange | None = None
    cross_axis: effects.CrossAxis | None = None
    flexible_mode: effects.FlexibleMode | None = None
    encoder_error: effects.EncoderError | None = None
    periodic_disturbance: effects.PeriodicDisturbance | None = None

    backlash: undeclared.Backlash | None = None
    friction_patch: undeclared.FrictionPatch | None = None
    friction_bump: undeclared.FrictionBump | None = None
    thrust_hysteresis: undeclared.ThrustHysteresis | None = None
    wandering_force: undeclared.WanderingForce | None = None

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
