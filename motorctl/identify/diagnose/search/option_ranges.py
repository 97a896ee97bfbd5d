"""Between what values an option still means its effect, and what stands at an end of that range.

A form whose option comes to an end of what was sought has not been found: what lies beyond explains
more still. Most effects mean something else there, so such a form is refuted; some come to an end
by nature, and what can be told is "at least" or "at most".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf, isfinite
from typing import Literal

from motorctl.identify.columns.measured import Measured
from motorctl.model import Effect, Spans
from motorctl.model.option_units import option_unit

LONGEST_PITCH = 0.3
"""Longest pitch, as a part of the travel: what repeats less often than about three times is no
periodic force. Larger takes slow variation for a pitch, smaller misses long ones. Arithmetic: 1 /
0.3 = 3.3 waves."""
BEYOND_TRIALS = 1.5
"""Factor by which options may leave the range of the forms that are tried. Larger lets forms turn
into something else, smaller misses true ones at the ends. Chosen by hand: three halves."""
EDGE = 0.02
"""Relative distance to an end of an option's range within which it counts as standing there. Larger
refuses forms near it, smaller accepts ones that are something else. Chosen by hand."""
KEPT_RANGES = 256
"""Ranges of options that are remembered: those of all effects for some recordings. More takes
memory, fewer forms thousands of waves anew. Chosen by hand."""


def option_bounds(effect: Effect, names: Sequence[str], spans: Spans) -> list[tuple[float, float]]:
    """Return the range in which each option makes sense: its own, or around what is tried."""
    if "wave_over_position" in effect.groups:
        return [(0.0, LONGEST_PITCH * spans.travel_m)] * len(names)
    own = effect.ranges(spans)
    tried = _tried(type(effect), tuple(names), spans)
    return [own.get(name, around) for name, around in zip(names, tried, strict=True)]


@lru_cache(maxsize=KEPT_RANGES)
def _tried(
    cls: type[Effect], names: tuple[str, ...], spans: Spans
) -> tuple[tuple[float, float], ...]:
    """Return the range of sizes by the forms that are tried; without end where they show none."""
    forms = [*cls.trials(spans), *cls.trials_beyond(spans)]
    bounds = []
    for name in names:
        values = [float(getattr(form.options, name)) for form in forms]
        low, high = min(values, default=0.0), max(values, default=0.0)
        bounded = low > 0.0 and high > low
        bounds.append((low / BEYOND_TRIALS, high * BEYOND_TRIALS) if bounded else (-inf, inf))
    return tuple(bounds)


@dataclass(frozen=True)
class Reached:
    """An option that stands at an end of its range."""

    option: str
    value: float
    end: Literal["lower", "upper"]
    bound: float
    """The range's end; in the option's unit, as the value."""
    refutes: bool
    """Whether the effect means another one there."""

    def told(self, data: Measured) -> str:
        """Return the option and its value in words."""
        unit = data.unit(option_unit(self.option))
        if not self.refutes:
            side = "least" if self.end == "upper" else "most"
            return f"its {self.option} is at {side} {self.value:.3g} {unit}".rstrip()
        return (
            f"its {self.option} comes to {self.value:.3g} {unit}".rstrip()
            + f", the {self.end} end of what is sought ({self.bound:.3g}): it is beyond that, or "
            "something else"
        )


def ends_reached(effect: Effect, spans: Spans) -> list[Reached]:
    """Return the options of a form that stand at an end of what was sought."""
    found = []
    names = list(effect.steps(spans))
    own = effect.ranges(spans)
    for name, (low, high) in zip(names, option_bounds(effect, names, spans), strict=True):
        value, refuting = float(getattr(effect.options, name)), effect.refuted_at_end
        ends: tuple[tuple[Literal["lower", "upper"], float], ...] = (("upper", high),)
        if low > 0.0 or name in own:
            ends = (("upper", high), ("lower", low))
        for end, bound in ends:
            if bound == 0.0 and end == "lower":  # a size that is not there comes to no end
                continue
            near = EDGE * (high - low if name in own else bound)
            beyond = value - bound if end == "upper" else bound - value
            if isfinite(bound) and beyond > -near:
                refutes = refuting.get(name, "upper") in ("either", end)
                found.append(Reached(name, value, end, bound, refutes))
    return found


def at_bound(effect: Effect, spans: Spans) -> bool:
    """Return whether a form stands at an end of what is sought: a search does not take it.

    A wave too long for the travel it takes, to be refuted at the end: meanwhile it holds the place
    of a slow force, which other effects would be bent to.
    """
    if "wave_over_position" in effect.groups:
        return False
    return any(reached.refutes for reached in ends_reached(effect, spans))
