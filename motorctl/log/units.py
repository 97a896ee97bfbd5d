"""Units of foreign recordings, and how they become ours."""

from __future__ import annotations

import math
import re
from typing import Literal

PositionUnit = Literal["m", "rad"]
CommandUnit = Literal["V", "A", "N", "N*m"]

POSITION_UNITS: dict[str, tuple[float, PositionUnit]] = {
    "m": (1.0, "m"),
    "mm": (1e-3, "m"),
    "um": (1e-6, "m"),
    "rad": (1.0, "rad"),
    "deg": (math.pi / 180.0, "rad"),
}
COMMAND_UNITS: dict[str, CommandUnit] = {"V": "V", "A": "A", "N": "N", "N*m": "N*m"}
TIME_UNITS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
FORCE_UNITS: tuple[str, ...] = tuple(
    f"{force}/{command}" for force in ("N", "N*m") for command in COMMAND_UNITS
)

_OTHER_SPELLINGS = {"µm": "um", "μm": "um", "µs": "us", "μs": "us", "counts": "count"}


def usual_spelling(unit: str) -> str:
    """Return the spelling under which a unit is known here: ``Nm`` and ``N·m`` are ``N*m``."""
    plain = unit.strip().replace("·", "*").replace("Nm", "N*m")
    return _OTHER_SPELLINGS.get(plain, plain)


def unit_for(unit: str, position: PositionUnit, command: CommandUnit) -> str:
    """Translate a unit of the model, which is in V and m, to an axis' own: ``V*s^2/rad``."""
    own = {"m": position, "V": command, "/V": f"/({command})" if "*" in command else f"/{command}"}
    return "".join(own.get(part, part) for part in re.findall(r"/V\b|[A-Za-z]+|[^A-Za-z]", unit))
