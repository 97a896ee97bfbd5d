"""Quantities as people write them, with their unit: 12kg, 30N/V, -200mm..0.3m, 60rpm."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from motorctl.errors import UsageError
from motorctl.log.units import POSITION_UNITS, VELOCITY_UNITS, usual_spelling

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class Kind:
    """What a quantity may be given in."""

    name: str
    units: Mapping[str, float]
    """How much of the SI unit each is."""
    example: str
    bare: bool = True
    """Whether a number without a unit is taken as the first one."""


_METRES = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "cm": 1e-2}
LENGTH = Kind("a length", _METRES, "5mm")
RESOLUTION = Kind("metres a count, or counts a turn of a screw", _METRES, "0.5um or 10000/turn")
MASS = Kind("a mass", {"kg": 1.0, "g": 1e-3, "t": 1e3}, "12kg")
VELOCITY = Kind(
    "a speed", {f"{unit}/s": size for unit, size in _METRES.items()} | {"m/min": 1 / 60}, "0.5m/s"
)
ACCELERATION = Kind(
    "an acceleration",
    {f"{unit}/s^2": size for unit, size in _METRES.items()} | {"g": STANDARD_GRAVITY_M_S2},
    "10m/s^2",
)
FORCE_CONSTANT = Kind(
    "a force constant", {"N/V": 1.0, "N/A": 1.0, "N*m/V": 1.0, "N*m/A": 1.0}, "30N/V", bare=False
)
FORCE = Kind("a force", {"N": 1.0, "kN": 1e3}, "8N")
CURRENT_GAIN = Kind("amperes a volt of command", {"A/V": 1.0}, "2A/V")
VOLTAGE = Kind("a voltage", {"V": 1.0, "mV": 1e-3}, "10V")
FREQUENCY = Kind("a frequency", {"Hz": 1.0, "kHz": 1e3}, "5kHz")
ROTARY_INERTIA = Kind(
    "a rotary inertia", {"kg*m^2": 1.0, "kg*cm^2": 1e-4, "g*cm^2": 1e-7}, "1.2e-5kg*m^2"
)
_RADIANS = {unit: size for unit, (size, base) in POSITION_UNITS.items() if base == "rad"}
_RADIANS_S = {unit: size for unit, (size, base) in VELOCITY_UNITS.items() if base == "rad"}
ANGLE = Kind("an angle", _RADIANS, "90deg")
ANGLE_A_COUNT = Kind("counts a turn, or the angle of a count", _RADIANS, "1000000/turn or 5urad")
ANGULAR_VELOCITY = Kind("an angular speed", _RADIANS_S, "2rad/s or 60rpm")
ANGULAR_ACCELERATION = Kind(
    "an angular acceleration", {f"{u}/s^2": size for u, size in _RADIANS.items()}, "50rad/s^2"
)
TORQUE_CONSTANT = Kind("a torque constant", {"N*m/V": 1.0, "N*m/A": 1.0}, "0.8N*m/V", bare=False)
TORQUE = Kind("a torque", {"N*m": 1.0, "mN*m": 1e-3}, "0.2N*m")
NO_ANGLES = (
    "is an angle, and this axis is linear, in metres. An axis that turns is told by --kind rotary, "
    "with --inertia and --torque-constant. One that a screw, rack or belt moves is linear: it is "
    "told by its travel a turn, as in --screw-pitch 5mm, its encoder by counts a turn, as in "
    "--encoder 10000/turn"
)


def quantity(option: str, text: str, kind: Kind) -> tuple[float, str]:
    """Return a number in SI units, and the unit that it was given in.

    Parameters
    ----------
    option
        Where it was given, for messages.
    text
        A number and its unit.
    kind
        What it may be.

    Raises
    ------
    UsageError
        Where it is none; it says what would be right.
    """
    found = re.fullmatch(rf"\s*({NUMBER})\s*(\D\S*)?\s*", text)
    unit = _spelled(found[2] or "") if found else ""
    if unit.split("/")[0] in _RADIANS and unit not in kind.units:
        raise UsageError(f"{option} {text} {NO_ANGLES}")
    if found and not unit and kind.bare:
        unit = next(iter(kind.units))
    if found is None or unit not in kind.units:
        raise UsageError(
            f"{option} {text}: should be {kind.name}, as in {kind.example}; units: "
            f"{', '.join(kind.units)}"
        )
    value = float(found[1]) * kind.units[unit]
    if not math.isfinite(value):
        raise UsageError(f"{option} {text}: should be a finite number")
    return value, unit


def positive(option: str, text: str, kind: Kind) -> float:
    """Return a number above 0 in SI units. Raises UsageError."""
    value, _ = quantity(option, text, kind)
    if not value > 0.0:
        raise UsageError(f"{option} {text}: should be above 0, as in {kind.example}")
    return value


def travel(option: str, text: str, kind: Kind = LENGTH) -> tuple[float, float]:
    """Return both ends of a travel such as ``-0.2..0.3`` or ``-200mm..300mm`` [m or rad].

    The unit of the second end holds for both where the first has none. Raises UsageError.
    """
    ends = text.split("..")
    if len(ends) != 2:
        raise UsageError(f"{option} {text}: should be two ends, as in -0.2..0.3 or -200mm..300mm")
    high, unit = quantity(option, ends[1], kind)
    first = ends[0] if re.search(r"[a-zA-Zµ°]\s*$", ends[0]) else f"{ends[0]}{unit}"
    low, _ = quantity(option, first, kind)
    if not low < high:
        raise UsageError(f"{option} {text}: the lower end should stand first")
    return low, high


def resolution(option: str, text: str, turn: float | None, kind: Kind = RESOLUTION) -> float:
    """Return metres (or radians) a count, which may be told by counts a turn.

    turn is the way of one turn: of a screw, or 2 pi. Raises UsageError.
    """
    found = re.fullmatch(rf"\s*({NUMBER})\s*(?:counts?)?\s*/\s*(?:turn|rev)\s*", text)
    if found is None:
        return positive(option, text, kind)
    counts = float(found[1])
    if not counts > 0.0:
        raise UsageError(f"{option} {text}: should be above 0, as in 10000/turn")
    if turn is None:
        raise UsageError(
            f"{option} {text}: counts a turn need the travel a turn, as in --screw-pitch 5mm"
        )
    return turn / counts


def _spelled(unit: str) -> str:
    """Return a unit as the tables have it."""
    unit = unit.replace("µ", "u").replace("μ", "u").replace("²", "^2").replace("·", "*")
    unit = re.sub(r"^Nm\b", "N*m", unit)
    unit = re.sub(r"/s2$", "/s^2", unit)
    return usual_spelling(re.sub(r"m2$", "m^2", unit)) if unit else unit
