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
    MergedSettings,
    NonNegative,
    Positive,
    Profile,
    RelativeHarmonic,
)


class Cogging(MergedSettings):
    """Force between iron core and magnets: + sum A_k sin(2 pi k x/P + phi_k) + profile(x)."""

    pitch_m: Positive
    """P: from magnet pair to magnet pair [m]."""
    harmonics: tuple[Harmonic, ...] = Field(default=(), max_length=MAX_HARMONICS)
    """The part that repeats."""
    aperiodic: Profile | None = None
    """The part that does not repeat from magnet to magnet."""


class ForceRipple(MergedSettings):
    """Force constant over position: thrust (1 + sum A_k sin(2 pi k x/P + phi_k))."""

    pitch_m: Positive
    """P: from magnet pair to magnet pair [m]."""
    harmonics: tuple[RelativeHarmonic, ...] = Field(min_length=1, max_length=MAX_HARMONICS)
    """How the force constant changes over a pitch."""


class Stribeck(MergedSettings):
    """More friction at low speed: Coulomb level + F_s exp(-(|v|/v_s)^exponent)."""

    force_v: float
    """F_s: what friction at rest has more than while sliding [V]."""
    velocity_m_s: Positive
    """v_s: the speed below which it is felt [m/s]."""
    exponent: Positive = 2.0
    """How sharply it falls with the speed."""


class AsymmetricFriction(MergedSettings):
    """Friction that differs between directions: - coulomb |s| - viscous |v|."""

    coulomb_v: float = 0.0
    """Positive: the positive direction has more."""
    viscous_v_s_m: float = 0.0
    """The same of viscous friction [V s/m]."""


class Presliding(MergedSettings):
    """Friction as a hysteretic spring before it slides (Dahl; LuGre adds damping of the bristles).

    dz/dt = v - |v| z / x_s (Dahl) or v - |v| theta3 z / (x_s g(v)) (LuGre).
    """

    kind: Literal["dahl", "lugre"] = "dahl"
    """Dahl's model or LuGre's."""
    displacement_m: Positive
    """x_s: the Coulomb level over the stiffness of the presliding spring."""
    micro_damping_v_s_m: NonNegative = 0.0
    """LuGre's sigma_1."""

    @model_validator(mode="after")
    def _damping_needs_lugre(self) -> Self:
        if self.kind == "dahl" and self.micro_damping_v_s_m:
            raise ValueError("micro_damping_v_s_m needs kind: lugre; Dahl's model has none")
        return self


class PositionDependentFriction(MergedSettings):
    """Coulomb level over travel: + linear (x - c) + quadratic (x - c)^2 + profile(x)."""

    center_m: float = 0.0
    """c: where the change is 0 [m]."""
    linear_v_m: float = 0.0
    """Change with the distance from c [V/m]."""
    quadratic_v_m2: float = 0.0
    """Change with its square [V/m^2]."""
    profile: Profile | None = None
    """Any other change over the travel; null: none."""


class EndEffect(MergedSettings):
    """Pull at the ends of the magnet way: F exp(-(x - x_lower)/L) - F exp(-(x_upper - x)/L)."""

    force_v: float
    """Positive: pushes back to the middle."""
    length_m: Positive
    """L: how far it reaches in [m]."""


class Cable(MergedSettings):
    """Hysteresis of a cable chain: - F h, dh/dt = (v - |v| h)/length."""

    force_v: float
    """F: half of the hysteresis' width [V]."""
    length_m: Positive
    """Travel over which it turns [m]."""


class PositionForce(MergedSettings):
    """Force of position that does not repeat: - k (x - c) - k3 (x - c)^3 + profile(x) + ..."""

    center_m: float = 0.0
    """c: where the spring is at rest [m]."""
    spring_v_m: float = 0.0
    """k [V/m]."""
    cubic_v_m3: float = 0.0
    """k3 [V/m^3]."""
    profile: Profile | None = None
    """Any other force over the travel; null: none."""
    end_effect: EndEffect | None = None
    """Pull at the ends of the magnet way; null: none."""
    cable: Cable | None = None
    """A cable chain; null: none."""


class QuadraticDrag(MergedSettings):
    """Drag - c v|v|."""

    drag_v_s2_m2: float
    """c [V s^2/m^2]."""


class InputLag(MergedSettings):
    """First-order lag of the amplifier's current behind its command."""

    time_s: Positive = Field(le=1.0)
    """Time constant [s]."""


class InputDelay(MergedSettings):
    """Pure delay between the end of a write and the amplifier's output; any part of a period."""

    time_s: Positive = Field(le=0.01)
    """How much later the command acts [s]."""


class DeadZone(MergedSettings):
    """Amplifier that does not answer small commands: u - clip(u, -w, w)."""

    half_width_v: Positive = Field(le=5)
    """w: commands up to this do nothing [V]."""


class GainDrift(MergedSettings):
    """Force constant that falls as the motor warms up: 1 - A (1 - exp(-t/tau))."""

    fraction: float = Field(gt=-0.9, lt=0.9)
    """A: share of the force constant that is lost once warm."""
    time_constant_s: Positive
    """tau of the warming [s]."""


class PayloadChange(MergedSettings):
    """A load put down on (or taken off) the carriage at a time."""

    time_s: NonNegative
    """When, after the driver was opened [s]."""
    inertia_v_s2_m: float
    """Added to theta1."""


class CrossAxis(MergedSettings):
    """Coupling from another channel's motion: - m a_other - b v_other."""

    channel: int = Field(ge=0)
    """A channel that no axis uses stands still."""
    acceleration_v_s2_m: float = 0.0
    """m: with the other's acceleration [V s^2/m]."""
    velocity_v_s_m: float = 0.0
    """b: with the other's velocity [V s/m]."""


class FlexibleMode(MergedSettings):
    """A part of the moving mass that hangs on a spring; the encoder is on the other part.

    theta1 a = ... + fraction theta1 s^2/(s^2 + 2 zeta omega s + omega^2) a, where the part has no
    friction of its own.
    """

    frequency_hz: Positive = Field(le=1000)
    """omega/2 pi: the antiresonance, the load's frequency with the carriage clamped."""
    damping_ratio: NonNegative = Field(le=1)
    """zeta: of the part that hangs on the spring."""
    fraction: Fraction
    """Share of theta1 that hangs on the spring."""
    friction_v: NonNegative = 0.0
    """Dry friction of the part on a guide of its own [V]."""


class EncoderError(MergedSettings):
    """Interpolation error of the encoder, in the measurement: y = x + A sin(2 pi x/p + phi)."""

    amplitude_m: float
    """A [m]."""
    period_m: Positive
    """p: period of the scale or of its interpolation [m]."""
    phase_rad: float = 0.0
    """phi [rad]."""


class PeriodicDisturbance(MergedSettings):
    """Fan, mains or pump: + A sin(2 pi f t + phi)."""

    amplitude_v: float
    """A [V]."""
    frequency_hz: Positive
    """f [Hz]."""
    phase_rad: float = 0.0
    """phi at the start [rad]."""
