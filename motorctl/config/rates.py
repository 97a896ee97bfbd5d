"""The rates of drivers: the loop's, or a whole part of it."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import TypeAdapter, ValidationError

from motorctl.config.keys import Rate
from motorctl.errors import Problem
from motorctl.located_yaml import Document

WHOLE = 1e-5
"""How far, as a part, a ratio of two rates may be from a whole number: a third of 1000 Hz has no
end as a decimal, and six digits of it are enough. The driver then gets the whole part itself."""


def loop_rate(document: Document) -> float | None:
    """Return the rate of the loop, or None where it cannot be read."""
    return _rate(document.at(("rate_hz",)))


def read_divisors(
    document: Document, rate_hz: float | None
) -> tuple[dict[str, int], list[Problem]]:
    """Return the ticks of the loop in one of each driver, and what does not divide.

    Problems of names and types are told by whoever validates the whole document.
    """
    divisors: dict[str, int] = {}
    problems: list[Problem] = []
    for name, part in document.part(("drivers",)).items():
        given = part.get("rate_hz") if isinstance(part, dict) else None
        if given is None:
            divisors[name] = 1
            continue
        own = _rate(given)
        if own is None or rate_hz is None:
            continue
        divisor = round(rate_hz / own)
        if divisor < 1 or abs(rate_hz / own / divisor - 1.0) > WHOLE:
            near = max(1, divisor)
            message = (
                f"found {own:g}, should be the loop's {rate_hz:g} Hz or a whole part of it; "
                f"near: {rate_hz / (near + 1):.6g} or {rate_hz / near:.6g}"
            )
            problems.append(document.problem(("drivers", name, "rate_hz"), message))
            continue
        divisors[name] = divisor
    return divisors, problems


def axis_rate(
    document: Document, axis: str, rate_hz: float | None, divisors: Mapping[str, int]
) -> float | None:
    """Return the rate at which an axis is controlled, where it can be read."""
    driver = document.at(("axes", axis, "driver"))
    if rate_hz is None or not isinstance(driver, str) or driver not in divisors:
        return None
    return rate_hz / divisors[driver]


def _rate(value: object) -> float | None:
    try:
        return TypeAdapter(Rate).validate_python(value, strict=True)
    except ValidationError:
        return None
