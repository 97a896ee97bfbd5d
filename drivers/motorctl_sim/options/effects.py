"""Options of the known effects, one table each; the effect is on where its table stands.

Forces are in volts (newtons over the force constant A1), on the right-hand side of the equation
in `motorctl_sim.physics.advance`.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from motorctl_sim.options.settings import (
    MAX_HARMONICS,
    Fraction,
    Harmonic,
    NonNegative,
    Positive,
    Profile,
    RelativeHarmonic,
    Settings,
)


class Cogging(Settings):
    """Force between iron core and magnets: + sum A_k sin(2 pi k x/P + phi_k) + profile(x)."""

    pitch_m: Positive
    harmonics: tuple[Harmonic, ...] = Field(default=(), max_length=MAX_HARMONICS)
    aperiodic: Profile | None = None
    """The part that does not repeat from magnet to magnet."""


class ForceRipple(Settings):
    """Force constant over position: thrust (1 + sum A_k sin(2 pi k x/P + phi_k))."""

    pitch_m: Positive
    harmonics: tuple[RelativeHarmonic, ...] = Field(min_length=1, max_length=MAX_HARMONICS)


class Stribeck(Settings):
    """More friction at low speed: Coulomb level + F_s exp(-(|v|/v_s)^exponent)."""

    force_v: float
    velocity_m_s: Positive
    exponent: Positive = 2.0


class AsymmetricFriction(Settings):
    """Friction that differs between directions: - coulomb |s| - viscous |v|."""

    coulomb_v: float = 0.0
    """Positive: the positive direction has more."""
    viscous_v_s_m: float = 0.0


class Presliding(Settings):
    """Friction as a hysteretic spring before it slides (Dahl; LuGre adds damping of the bristles).

    dz/dt = v - |v| z / x_s (Dahl) or v - |v| theta3 z / (x_s g(v)) (LuGre).
    """

    kind: Literal["dahl", "lugre"] = "dahl"
    displacement_m: Positive
    """x_s: the Coulomb level over the stiffness of the presliding spring."""
    micro_damping_v_s_m: NonNegative = 0.0
    """LuGre's sigma_1."""

    @model_validator(mode="after")
    def _damping_needs_lugre(self) -> Self:
        if self.kind == "dahl" and self.micro_damping_v_s_m:
            raise ValueError("micro_damping_v_s_m needs kind: lugre; Dahl's model has none")
        return self


class PositionDependentFriction(Settings):
    """Coulomb level over travel: + linear (x - c) + quadratic (x - c)^2 + profile(x)."""

    center_m: float = 0.0
    linear_v_m: float = 0.0
    quadratic_v_m2: float = 0.0
    profile: Profile | None = None


class EndEffect(Settings):
    """Pull at the ends of the magnet way: F exp(-(x - x_lower)/L) - F exp(-(x_upper - x)/L)."""

    force_v: float
    """Positive: pushes back to the middle."""
    length_m: Positive


class Cable(Settings):
    """Hysteresis of a cable chain: - F h, dh/dt = (v - |v| h)/length."""

    force_v: float
    length_m: Positive


class PositionForce(Settings):
    """Force of position that does not repeat: - k (x - c) - k3 (x - c)^3 + profile(x) + ..."""

    center_m: float = 0.0
    spring_v_m: float = 0.0
    cubic_v_m3: float = 0.0
    profile: Profile | None = None
    end_effect: EndEffect | None = None
    cable: Cable | None = None


class QuadraticDrag(Settings):
    """Drag - c v|v|."""

    drag_v_s2_m2: float


class InputLag(Settings):
    """First-order lag of the amplifier's current behind its command."""

    time_s: Positive = Field(le=1.0)


class InputDelay(Settings):
    """Pure delay between the end of a write and the amplifier's output; any part of a period."""

    time_s: Positive = Field(le=0.01)


class DeadZone(Settings):
    """Amplifier that does not answer small commands: u - clip(u, -w, w)."""

    half_width_v: Positive = Field(le=5)


class GainDrift(Settings):
    """Force constant that falls as the motor warms up: 1 - A (1 - exp(-t/tau))."""

    fraction: float = Field(gt=-0.9, lt=0.9)
    time_constant_s: Positive


class PayloadChange(Settings):
    """A load put down on (or taken off) the carriage at a time."""

    time_s: NonNegative
    inertia_v_s2_m: float
    """Added to theta1."""


class CrossAxis(Settings):
    """Coupling from another channel's motion: - m a_other - b v_other."""

    channel: int = Field(ge=0)
    """A channel that no axis uses stands still."""
    acceleration_v_s2_m: float = 0.0
    velocity_v_s_m: float = 0.0


class FlexibleMode(Settings):
    """A part of the moving mass that hangs on a spring; the encoder is on the other part.

    theta1 a = ... + fraction theta1 s^2/(s^2 + 2 zeta omega s + omega^2) a.
    """

    frequency_hz: Positive = Field(le=1000)
    """omega/2 pi: the antiresonance, the load's frequency with the carriage clamped."""
    damping_ratio: NonNegative = Field(le=1)
    fraction: Fraction
    """Share of theta1 that hangs on the spring."""


class EncoderError(Settings):
    """Interpolation error of the encoder, in the measurement: y = x + A sin(2 pi x/p + phi)."""

    amplitude_m: float
    period_m: Positive
    phase_rad: float = 0.0


class PeriodicDisturbance(Settings):
    """Fan, mains or pump: + A sin(2 pi f t + phi)."""

    amplitude_v: float
    frequency_hz: Positive
    phase_rad: float = 0.0
