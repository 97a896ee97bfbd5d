"""Units of foreign recordings, and how they become ours."""

from __future__ import annotations

import math
import re
from typing import Literal

from motorctl.axis_units import PositionUnit

CommandUnit = Literal["V", "A", "N", "N*m", "%"]

POSITION_UNITS: dict[str, tuple[float, PositionUnit]] = {
    "m": (1.0, "m"),
    "mm": (1e-3, "m"),
    "um": (1e-6, "m"),
    "rad": (1.0, "rad"),
    "deg": (math.pi / 180.0, "rad"),
    "cm": (1e-2, "m"),
    "nm": (1e-9, "m"),
    "mrad": (1e-3, "rad"),
    "urad": (1e-6, "rad"),
    "arcsec": (math.pi / 648000.0, "rad"),
    "turn": (2.0 * math.pi, "rad"),
}
"""A unit in metres or radians."""
VELOCITY_UNITS: dict[str, tuple[float, PositionUnit]] = {
    **{f"{unit}/s": known for unit, known in POSITION_UNITS.items()},
    **{f"{unit}/min": (f / 60.0, base) for unit, (f, base) in POSITION_UNITS.items()},
}
COMMAND_UNITS: dict[str, tuple[float, CommandUnit]] = {
    "V": (1.0, "V"),
    "A": (1.0, "A"),
    "N": (1.0, "N"),
    "N*m": (1.0, "N*m"),
    "mV": (1e-3, "V"),
    "mA": (1e-3, "A"),
    "kN": (1e3, "N"),
    "mN*m": (1e-3, "N*m"),
    "%": (1.0, "%"),
}
"""A unit in volts, amperes, newtons or newton metres; per cent of an unknown full scale stay so."""
TIME_UNITS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
FORCE_UNITS: tuple[str, ...] = tuple(
    f"{force}/{command}" for force in ("N", "N*m") for command in COMMAND_UNITS
)

_OTHER_SPELLINGS = {
    **{"µm": "um", "μm": "um", "µs": "us", "μs": "us", "counts": "count", "percent": "%"},
    **{"µrad": "urad", "μrad": "urad", "°": "deg"},
    **{"rev": "turn", "revs": "turn", "turns": "turn", "rpm": "turn/min", "degrees": "deg"},
}


def usual_spelling(unit: str) -> str:
    """Return the spelling under which a unit is known here: ``Nm`` and ``N m`` are ``N*m``."""
    plain = re.sub(r"N\s*[·⋅.]?\s*m", "N*m", unit.strip())
    if plain in _OTHER_SPELLINGS:
        return _OTHER_SPELLINGS[plain]
    way, per, time = plain.partition("/")
    return _OTHER_SPELLINGS.get(way, way) + per + time


def unit_for(unit: str, position: PositionUnit, command: CommandUnit) -> str:
    """Translate a unit of the model, which is in V and m, to an axis' own: ``V*s^2/rad``."""
    own = {"m": position, "V": command, "/V": f"/({command})" if "*" in command else f"/{command}"}
    return "".join(own.get(part, part) for part in re.findall(r"/V\b|[A-Za-z]+|[^A-Za-z]", unit))
