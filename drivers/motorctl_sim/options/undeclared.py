"""Options of effects that no list of known effects has: for honesty tests of the diagnosis."""

from __future__ import annotations

from pydantic import Field

from motorctl_sim.options.settings import Fraction, MergedSettings, NonNegative, Positive


class Backlash(MergedSettings):
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
    """Of the loose part on the stops' stiffness."""


class FrictionPatch(MergedSettings):
    """A sticky place: Coulomb level + F exp(-((x - x0)/w)^2) exp(-(v/v_w)^2)."""

    force_v: float
    """F: how much more friction there is [V]."""
    position_m: float
    """x0: middle of the place [m]."""
    width_m: Positive
    """w: half of its width [m]."""
    velocity_m_s: Positive
    """v_w: the patch is felt below about this speed."""


class FrictionBump(MergedSettings):
    """A speed with more friction, such as a seal that rattles: + F exp(-((|v| - v0)/w)^2)."""

    force_v: float
    """F: how much more friction there is [V]."""
    velocity_m_s: NonNegative
    """v0: the speed [m/s]."""
    width_m_s: Positive
    """w: half of its width [m/s]."""


class ThrustHysteresis(MergedSettings):
    """Thrust that remembers its command: - F h, dh = (di - |di| h)/i_s."""

    force_v: float
    """F: half of the hysteresis' width [V]."""
    voltage_v: Positive
    """i_s: the change of command over which the hysteresis turns."""


class WanderingForce(MergedSettings):
    """A force that wanders with time: exponentially correlated noise (Ornstein-Uhlenbeck)."""

    rms_v: NonNegative
    """Its standard deviation [V]."""
    time_constant_s: Positive
    """Over which it forgets where it was [s]."""
