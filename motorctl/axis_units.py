"""An axis is linear or rotary; the units of everything that is said of it follow from that."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

AxisKind = Literal["linear", "rotary"]
PositionUnit = Literal["m", "rad"]

_PREFIXED = {"m": "rad", "mm": "mrad", "um": "urad", "µm": "µrad", "nm": "nrad"}
_LENGTH = re.compile(
    r"(?:(?<=\d)|(?<=\d )|(?<=inf )|(?<=[Vs2-4²³]/)|(?<=\[)|(?<= )(?=[mµun]m))"
    r"(mm|um|µm|nm|m)(?![A-Za-z0-9_])"
)
"""A unit of length behind a number, a bracket or a fraction's bar, and no other letter m."""


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown: times `factor`, in `unit`."""

    factor: float
    unit: str


@dataclass(frozen=True)
class AxisUnits:
    """The units of an axis.

    Keys, columns and names in code are those of a linear axis; of a rotary one they hold radians
    where they say metres. So rules and sentences are written once, in metres, and `words` tells
    them in the axis' own units, without touching a number.
    """

    kind: AxisKind
    position: PositionUnit
    place: Shown
    """Of positions."""
    error: Shown
    velocity: Shown
    place_digits: int
    """Behind the point, of a position that is shown."""
    velocity_digits: int
    inertia: str
    """Of what moves."""
    force: str

    def words(self, text: str) -> str:
        """Return a sentence or a unit that speaks of metres in the axis' own units.

        The factors of prefixes are the same: 0.4 mm is 0.4 mrad, 3 V*s^2/m are 3 V*s^2/rad.
        """
        if self.position == "m":
            return text
        if text in _PREFIXED or text.startswith("m/"):
            return _PREFIXED.get(text, f"rad{text[1:]}")
        return _LENGTH.sub(lambda found: _PREFIXED[found[1]], text)

    def told(self, position: float) -> str:
        """Return a position as people read it: 12.3456 mm, 0.12346 rad."""
        return f"{position * self.place.factor:.{self.place_digits}f} {self.place.unit}"


LINEAR = AxisUnits(
    kind="linear",
    position="m",
    place=Shown(1e3, "mm"),
    error=Shown(1e6, "µm"),
    velocity=Shown(1e3, "mm/s"),
    place_digits=4,
    velocity_digits=2,
    inertia="kg",
    force="N",
)
ROTARY = AxisUnits(
    kind="rotary",
    position="rad",
    place=Shown(1.0, "rad"),
    error=Shown(1e6, "µrad"),
    velocity=Shown(1.0, "rad/s"),
    place_digits=6,
    velocity_digits=4,
    inertia="kg*m^2",
    force="N*m",
)


def units_of(kind_or_unit: object) -> AxisUnits:
    """Return the units of a kind of axis, or those of which one is its unit of position.

    Anything else, as of a log that is older than rotary axes, is linear.
    """
    return ROTARY if kind_or_unit in ("rotary", "rad") else LINEAR


def units_in(config: Mapping[str, Any], axis: str) -> AxisUnits:
    """Return the units of an axis of a configuration in plain data, as a log's metadata has it."""
    axes = config.get("axes")
    keys = axes.get(axis) if isinstance(axes, Mapping) else None
    return units_of(keys.get("kind") if isinstance(keys, Mapping) else None)
