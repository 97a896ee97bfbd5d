"""Lengths and speeds as a person writes them: 0.25, 250mm, +10mm, 50mm/s."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from motorctl.errors import UsageError

UNITS_M = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9}
KNOWN = "m, mm, um or nm"
_FORM = re.compile(r"(?P<number>[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)\s*(?P<unit>[^\d\s].*)?", re.I)


@dataclass(frozen=True)
class Target:
    """Where a move ends: at a position, or a way from where the axis holds; the other is None."""

    position_m: float | None = None
    by_m: float | None = None


def target_of(position: str | None, by: str | None) -> Target:
    """Return where a move is to end.

    A number without a unit is a position in metres, whatever its sign. With a unit and a sign it
    could be either for whoever reads it, so + is a way, and - has to be told apart.

    Parameters
    ----------
    position
        The argument: ``0.25``, ``250mm``, ``+10mm``; None: not given.
    by
        The option ``--by``: a way, with either sign; None: not given.

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
        return Target(by_m=length_m(by))
    assert position is not None
    value_m, plain = length_m(position), _is_number(position)
    if position.strip().startswith("+"):
        if plain:
            raise UsageError(
                f"{position}: is it a position or a way? A position in metres is "
                f"{position.strip()[1:]}, a way {position}m"
            )
        return Target(by_m=value_m)
    if position.strip().startswith("-") and not plain:
        raise UsageError(
            f"{position}: is it a position or a way? A position in metres is {value_m:g}, "
            f"a way --by {position}"
        )
    return Target(position_m=value_m)


def length_m(text: str) -> float:
    """Return a length in metres; without a unit it is in metres.

    Raises UsageError where the words make no sense.
    """
    return _value(text, UNITS_M, f"a length such as 0.25, 250mm or 25um (units: {KNOWN})")


def velocity_m_s(text: str) -> float:
    """Return a velocity in m/s; without a unit it is in m/s.

    Raises UsageError where the words make no sense.
    """
    units = {f"{unit}/s": factor for unit, factor in UNITS_M.items()}
    return _value(text, units, "a velocity such as 0.05 or 50mm/s")


def acceleration_m_s2(text: str) -> float:
    """Return an acceleration in m/s^2; without a unit it is in m/s^2.

    Raises UsageError where the words make no sense.
    """
    units = {
        f"{unit}/s{power}": factor
        for unit, factor in UNITS_M.items()
        for power in ("^2", "2", "²", "**2")
    }
    return _value(text, units, "an acceleration such as 2 or 500mm/s^2")


def _value(text: str, units: dict[str, float], wanted: str) -> float:
    found = _FORM.fullmatch(text.strip())
    if found:
        number, unit = found["number"], found["unit"]
        if not unit or unit in units:
            value = float(number) * units.get(unit, 1.0)
            if math.isfinite(value):
                return value
    raise UsageError(f"{text}: should be {wanted}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
