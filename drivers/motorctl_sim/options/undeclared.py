"""Options of effects that no list of known effects has: for honesty tests of the diagnosis."""

from __future__ import annotations

from pydantic import Field

from motorctl_sim.options.settings import Fraction, NonNegative, Positive, Settings


class Backlash(Settings):
    """A part of the moving mass that sits in a clearance and meets springy stops at its ends.

    Without clearance it is one more part on a spring, beside that of `flexible_mode`.
    """

    gap_m: NonNegative
    """Whole clearance."""
    fraction: Fraction
    """Share of theta1 behind the clearance; the encoder is before it."""
    contact_frequency_hz: Positive = Field(default=300.0, le=1000)
    """Frequency of the loose part on the stops' stiffness."""
    damping_ratio: NonNegative = Field(default=0.2, le=1)


class FrictionPatch(Settings):
    """A sticky place: Coulomb level + F exp(-((x - x0)/w)^2) exp(-(v/v_w)^2)."""

    force_v: float
    position_m: float
    width_m: Positive
    velocity_m_s: Positive
    """v_w: the patch is felt below about this speed."""


class FrictionBump(Settings):
    """A speed with more friction, such as a seal that rattles: + F exp(-((|v| - v0)/w)^2)."""

    force_v: float
    velocity_m_s: NonNegative
    width_m_s: Positive


class ThrustHysteresis(Settings):
    """Thrust that remembers its command: - F h, dh = (di - |di| h)/i_s."""

    force_v: float
    voltage_v: Positive
    """i_s: the change of command over which the hysteresis turns."""


class WanderingForce(Settings):
    """A force that wanders with time: exponentially correlated noise (Ornstein-Uhlenbeck)."""

    rms_v: NonNegative
    time_constant_s: Positive
