"""Ways and speeds as a person writes them: 0.25, 250mm, +10mm, 50mm/s; of joints 10deg, 0.2rad."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from motorctl.axis_units import PositionUnit
from motorctl.errors import UsageError
from motorctl.log.units import POSITION_UNITS, usual_spelling

KNOWN: dict[PositionUnit, str] = {
    base: ", ".join(unit for unit, (_, own) in POSITION_UNITS.items() if own == base)
    for base in ("m", "rad")
}
_FORM = re.compile(r"(?P<number>[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)\s*(?P<unit>[^\d\s].*)?", re.I)
_WORDS = {"m": "metres", "rad": "radians"}
_LENGTH: dict[PositionUnit, str] = {
    "m": f"a length such as 0.25, 250mm or 25um (units: {KNOWN['m']})",
    "rad": f"an angle such as 0.2, 10deg or 0.2rad (units: {KNOWN['rad']})",
}
_VELOCITY: dict[PositionUnit, str] = {
    "m": "a velocity such as 0.05 or 50mm/s",
    "rad": "an angular velocity such as 0.5, 30deg/s or 10rpm",
}
_ACCELERATION: dict[PositionUnit, str] = {
    "m": "an acceleration such as 2 or 500mm/s^2",
    "rad": "an angular acceleration such as 20 or 500deg/s^2",
}


@dataclass(frozen=True)
class Target:
    """Where a move ends: at a position, or a way from where the axis holds; the other is None.

    In metres, of a rotary axis in radians.
    """

    position_m: float | None = None
    by_m: float | None = None


def target_of(position: str | None, by: str | None, own: PositionUnit | None = None) -> Target:
    """Return where a move is to end.

    A number without a unit is a position in the axis' own, metres or radians, whatever its sign.
    With a unit and a sign it could be either for whoever reads it, so + is a way, and - has to be
    told apart.

    Parameters
    ----------
    position
        The argument: ``0.25``, ``250mm``, ``+10mm``, ``90deg``; None: not given.
    by
        The option ``--by``: a way, with either sign; None: not given.
    own
        Unit of the axis; None while it is not known: then both kinds make sense.

    Returns
    -------
    Target
        One of both.

    Raises
    ------
    UsageError
        Where neither or both are given, or the words mean nothing or two things.
    """
    if (position is None) == (by is None):
        raise UsageError("move needs a position, or a way with --by, and not both")
    if by is not None:
        return Target(by_m=length_m(by, own))
    assert position is not None
    value, plain = length_m(position, own), _is_number(position)
    if position.strip().startswith("+"):
        if plain:
            number = position.strip()[1:]
            raise UsageError(
                f"{position}: is it a position or a way? A position is {number}, a way "
                f"{position}m or, of a rotary axis, {position}rad"
            )
        return Target(by_m=value)
    if position.strip().startswith("-") and not plain:
        found = _FORM.fullmatch(position.strip())
        assert found is not None  # it has been read
        base = POSITION_UNITS[usual_spelling(found["unit"])][1]
        raise UsageError(
            f"{position}: is it a position or a way? A position in {_WORDS[base]} is {value:g}, "
            f"a way --by {position}"
        )
    return Target(position_m=value)


def length_m(text: str, own: PositionUnit | None = None) -> float:
    """Return a length in metres, or an angle in radians; without a unit it is in the axis' own.

    own is the axis' unit, None while it is not known. Raises UsageError where the words make no
    sense for it.
    """
    units = {(unit, "") for unit in POSITION_UNITS}
    return _value(text, own, units, _LENGTH)


def velocity_m_s(text: str, own: PositionUnit | None = None) -> float:
    """Return a velocity in m/s or rad/s; without a unit it is in the axis' own.

    Raises UsageError where the words make no sense.
    """
    units = {(unit, "/s") for unit in POSITION_UNITS} | {("turn", "/min")}
    return _value(text, own, units, _VELOCITY)


def acceleration_m_s2(text: str, own: PositionUnit | None = None) -> float:
    """Return an acceleration in m/s^2 or rad/s^2; without a unit it is in the axis' own.

    Raises UsageError where the words make no sense.
    """
    powers = ("^2", "2", "²", "**2")
    units = {(unit, f"/s{power}") for unit in POSITION_UNITS for power in powers}
    return _value(text, own, units, _ACCELERATION)


def _value(
    text: str,
    own: PositionUnit | None,
    units: set[tuple[str, str]],
    wanted: Mapping[PositionUnit, str],
) -> float:
    known = {unit + per: POSITION_UNITS[unit][0] for unit, per in units if _of(unit, own)}
    if "turn/min" in known:
        known["turn/min"] /= 60.0
    found = _FORM.fullmatch(text.strip())
    if found:
        number, unit = found["number"], usual_spelling(found["unit"] or "")
        if not unit or unit in known:
            value = float(number) * known.get(unit, 1.0)
            if math.isfinite(value):
                return value
    kind = "" if own is None else " of this axis"
    raise UsageError(f"{text}: should be {wanted[own or 'm']}{kind}")


def _of(unit: str, own: PositionUnit | None) -> bool:
    return own is None or POSITION_UNITS[unit][1] == own


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
