"""With what the configuration of a new machine begins: what a driver is told, and what it says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class FirstAxis:
    """What is known of an axis when the first configuration of its machine is written.

    Of a rotary axis in radians, where the names say metres.
    """

    name: str
    channel: int
    resolution_m: float
    counter_bits: int
    absolute: bool
    """Whether its encoder knows the position at power-on."""
    max_voltage_v: float
    travel_m: tuple[float, float]
    """Soft limits."""
    inertia_v_s2_m: float
    """Mass over the force constant."""
    viscous_friction_v_s_m: float
    coulomb_friction_v: float
    homing: str
    """How it is homed: absolute, switch, switch_index or index."""
    home_position_m: float
    """Where its home switch's edge or index mark is, where it has one."""
    friction_slope_s_m: float | None = None
    """How steeply its friction turns over; None: as that of a carriage."""
    delay_s: float = 0.0
    """How late a command of the real machine's bus acts, for one that is simulated in its place."""
    end_of: str | None = None
    """Of a beam with two motors, this being one of them: the axis that the two ends are. Inertia
    and friction are those of the mean motion, over the force of both."""


@dataclass(frozen=True)
class FirstOptions:
    """Options for a device that nobody has told everything of."""

    options: Mapping[str, Any]
    """As they stand in YAML; `late` is not the driver's own, and may be among them."""
    told: Mapping[tuple[str | int, ...], str] = field(default_factory=dict)
    """A comment for some of them, by their path."""
    to_be_set: tuple[str, ...] = ()
    """What only the device or its papers can tell, and was put in as a guess: a sentence each,
    which begins with the option's path."""


@dataclass(frozen=True)
class FoundAxis:
    """What a device tells of one of its channels; None: it does not tell."""

    channel: int
    name: str | None = None
    resolution_m: float | None = None
    counter_bits: int | None = None
    inertia_v_s2_m: float | None = None
    travel_m: tuple[float, float] | None = None
    max_voltage_v: float | None = None
    homing: str | None = None
    home_position_m: float | None = None
    remarks: tuple[str, ...] = ()
    """What else it tells, in words."""


@dataclass(frozen=True)
class FoundDevice:
    """What answers."""

    axes: tuple[FoundAxis, ...]
    options: Mapping[str, Any] | None = None
    """Options with which a configuration has what was found, whatever is known of the axes; None:
    those of `Driver.first_options`."""
