"""What is known of a machine before its first configuration is written."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.config.axis_keys import HomingMethod


@dataclass(frozen=True)
class SecondEnd:
    """What is known of the second motor of an axis whose beam is driven at both ends."""

    channel: int
    skew_limit_m: float
    """How far the ends may be apart."""
    square_offset_m: float | None = None
    """How far ahead the first end's switch or mark lies where the beam is square; None: unknown."""


@dataclass(frozen=True)
class AxisKnown:
    """One axis, as a person knows it, in the units of the loop.

    A rotary one has radians, kg*m^2 and N*m where this says metres, kilograms and newtons.
    """

    name: str
    driver: str
    """Type of the driver that serves it."""
    channel: int
    resolution_m: float
    mass_kg: float
    """All that moves, with what turns on the screw."""
    force_constant_n_v: float
    """Newtons of thrust a volt of command, of both motors where there are two."""
    travel_m: tuple[float, float]
    max_velocity_m_s: float
    max_acceleration_m_s2: float | None = None
    """None: what half of the full command gives."""
    max_voltage_v: float = 10.0
    counter_bits: int = 32
    friction_n: float | None = None
    """None: nobody has measured it."""
    homing: HomingMethod = "absolute"
    home_position_m: float | None = None
    inertia_said: str | None = None
    """Where the mass over the force constant comes from; None: from the two."""
    said: tuple[str, ...] = ()
    """Arithmetic that led to the numbers, in words: of a screw, of an amplifier."""
    units: AxisUnits = LINEAR
    second: SecondEnd | None = None
    """None: it has one motor."""

    @property
    def inertia_v_s2_m(self) -> float:
        """Mass over the force constant."""
        return self.mass_kg / self.force_constant_n_v


@dataclass(frozen=True)
class MachineKnown:
    """A machine, as a person knows it."""

    name: str
    axes: tuple[AxisKnown, ...]
    rate_hz: float | None = None
    """None: the highest usual one that every driver carries."""
    driver_options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """What was told of drivers, by their type."""
    found_options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """What devices told of themselves, by the type of their drivers."""

    @property
    def drivers(self) -> tuple[str, ...]:
        """Types of the drivers, in the order of their first axes."""
        return tuple(dict.fromkeys(axis.driver for axis in self.axes))

    def axes_of(self, driver: str) -> tuple[AxisKnown, ...]:
        """Return the axes of a driver."""
        return tuple(axis for axis in self.axes if axis.driver == driver)


def driver_key(driver: str) -> str:
    """Return the name of a driver in the configuration: its type, or its class in plain letters.

    An own one, ``package.module:MotionBox``, is called ``motion_box``.
    """
    _, colon, own = driver.partition(":")
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", own).lower().strip("_") if colon else driver


def force_of_torque(torque: float, screw_pitch_m: float) -> float:
    """Return the force of a torque on a screw without friction [N for N*m]."""
    return torque * 2.0 * math.pi / screw_pitch_m


def mass_of_rotor(inertia_kg_m2: float, screw_pitch_m: float) -> float:
    """Return the mass that resists as much as what turns with a screw [kg]."""
    return inertia_kg_m2 * (2.0 * math.pi / screw_pitch_m) ** 2
