"""Options of a beam that two channels drive together, one at each end."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from motorctl_sim.options.settings import NonNegative, Positive, Settings


class BeamLoad(Settings):
    """A load that stands on the beam, as a point."""

    inertia_v_s2_m: Positive
    """Its mass over the force constant."""
    position_m: float
    """From the beam's middle towards the first end."""


class Beam(Settings):
    """A stiff beam between the carriages of two channels; all forces over one motor's constant A1.

    Each carriage keeps its own plant: its mass, motor, friction, encoder and switches.
    """

    channels: tuple[int, int]
    """First and second end."""
    spacing_m: Positive
    """Between the two ends."""
    inertia_v_s2_m: NonNegative = 0.0
    """The beam's mass over A1, its centre in the middle."""
    rotary_inertia_v_s2_m: NonNegative = 0.0
    """Its rotary inertia about the centre [kg m^2] over A1 [N/V] and over the spacing squared."""
    stiffness_v_m: NonNegative = 0.0
    """Guideways and joints against skew: a force of this times x1 - x2 at either end."""
    damping_v_s_m: NonNegative = 0.0
    """The same of the rate of the skew."""
    load: BeamLoad | None = None
    """A load that stands on the beam; null: none."""

    @model_validator(mode="after")
    def _has_two_ends(self) -> Self:
        if self.channels[0] == self.channels[1] or min(self.channels) < 0:
            raise ValueError(f"channels: found {list(self.channels)}, should be two channels")
        if self.load and abs(self.load.position_m) > self.spacing_m:
            raise ValueError(
                f"load.position_m {self.load.position_m} lies more than spacing_m "
                f"{self.spacing_m} from the middle"
            )
        return self
