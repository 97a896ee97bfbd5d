"""Waves along the travel: what effects that repeat with a pitch have in common."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pydantic import Field, field_validator

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import even_grid
from motorctl.model.knowledge import Spans

HIGHEST_ORDER = 24
"""Highest order that the option takes. Larger allows waves that a pitch has by chance, smaller
refuses forms that diagnosis finds: it looks for orders up to this one. Chosen by hand."""
ORDERS = (1, 2, 3, 4, 5, 6, 8, 12)
"""Orders that are added to a wave: those that motors and screws are known to show. More takes time
and finds chance ones, fewer misses true ones. Chosen by hand."""
MULTIPLES = (2, 3, 4, 6)
"""Orders of the true pitch that its strongest wave may be, where a form is made richer. More takes
time and finds long pitches by chance, fewer misses pitches whose first order is weak. Chosen by
hand."""
MOST_FORMS = 2000
"""Pitches from the longest to the shortest, at most. More makes long lists of long travel, fewer
makes the steps coarser, and then leaves the shortest out. Chosen by hand."""
SHORTEST_TRAVEL_M = 1e-6
"""Travel up to which no pitch is sought or refined [m]. Smaller divides by next to nothing, larger
refuses very fine stages. Chosen by hand."""
TYPICAL_PITCHES = 12.0
"""Pitches in the travel of a typical form, by which a motion is asked whether it could show one.
More are short waves that pass too quickly, fewer are slow ones that look like other forces of
position. Chosen by hand: linear motors have 20 to 60 mm in half a metre or so."""


class PitchOptions(EffectOptions):
    """The pitch, and which waves of it there are."""

    pitch_m: float = Field(ge=1e-9, allow_inf_nan=False, description="length of one period")
    orders: tuple[int, ...] = Field(
        default=(1,), min_length=1, description="waves per period, ascending"
    )

    @field_validator("orders")
    @classmethod
    def _ascend(cls, orders: tuple[int, ...]) -> tuple[int, ...]:
        if list(orders) != sorted(set(orders)) or orders[0] < 1 or orders[-1] > HIGHEST_ORDER:
            raise ValueError(f"must be different, ascending, each 1 to {HIGHEST_ORDER}")
        return orders


def pitch_constants(options: PitchOptions) -> tuple[float, ...]:
    """Return the wave number [rad/m] of each order."""
    return tuple(2.0 * math.pi * order / options.pitch_m for order in options.orders)


def wave_number_step(spans: Spans) -> float:
    """Return the distance of two wave numbers 1/P [1/m] that a search must look at.

    Over a travel L a wave is told from one that is 1/L away; at half of that between neighbours
    nine tenths of an amplitude are still seen, at 1/1.5 L eight tenths.
    """
    highest = _highest(spans)
    step = max(1.0 / (4.0 * spans.travel_m), highest / MOST_FORMS)
    return min(step, 1.0 / (1.5 * spans.travel_m))


def trial_pitches(spans: Spans) -> list[float]:
    """Return the pitches [m] that are worth trying, from the longest to the shortest."""
    if not SHORTEST_TRAVEL_M < spans.travel_m < math.inf:
        return []
    lowest, step = 0.75 / spans.travel_m, wave_number_step(spans)
    # where these are not enough for a long travel, the longest pitches are the likely ones
    highest = min(_highest(spans), lowest + (MOST_FORMS - 1) * step)
    return [1.0 / number for number in even_grid(lowest, highest, step)]


def pitch_steps(options: PitchOptions, spans: Spans) -> dict[str, float]:
    """Return the step of the pitch that is one step of its wave number."""
    if not SHORTEST_TRAVEL_M < spans.travel_m < math.inf:
        return {}
    return {"pitch_m": options.pitch_m**2 / options.orders[-1] * wave_number_step(spans)}


def richer_pitches(options: PitchOptions, spans: Spans) -> list[PitchOptions]:
    """Return the forms with one order more, of this pitch or of one that this is a part of."""
    pitch, orders = options.pitch_m, options.orders
    richer = [(pitch, (*orders, n)) for n in ORDERS if n not in orders]
    for multiple in MULTIPLES:
        raised = tuple(multiple * order for order in orders)
        if raised[-1] > HIGHEST_ORDER or multiple * pitch * 0.75 > spans.travel_m:
            continue
        # an order that shares a factor with the multiple belongs to a smaller multiple
        added = (n for n in ORDERS if math.gcd(n, multiple) == 1)
        richer += [(multiple * pitch, (*raised, n)) for n in added if n < raised[-1]]
    return [PitchOptions(pitch_m=p, orders=tuple(sorted(o))) for p, o in richer]


def _highest(spans: Spans) -> float:
    """Return the highest wave number [1/m]: a millimetre, or a hundredth of a short travel."""
    highest = max(1000.0, 100.0 / spans.travel_m)
    if spans.resolution_m > 0.0:
        highest = min(highest, 1.0 / (8.0 * spans.resolution_m))
    return highest


class PitchWave(Effect):
    """Base of the effects that repeat over position: sine and cosine of each order of a pitch."""

    Options = PitchOptions
    options: PitchOptions

    @property
    def constants(self) -> tuple[float, ...]:
        """Wave number of every order [rad/m]."""
        return pitch_constants(self.options)

    @property
    def lines(self) -> tuple[float, ...]:
        """Wave number of every order [1/m]."""
        return tuple(order / self.options.pitch_m for order in self.options.orders)

    @property
    def repeats_every(self) -> float:
        """The pitch [m]."""
        return self.options.pitch_m

    @classmethod
    def typical(cls, spans: Spans) -> Effect | None:
        """Return a wave that repeats a dozen times over the travel."""
        return cls(PitchOptions(pitch_m=spans.travel_m / TYPICAL_PITCHES))

    @classmethod
    def at_line(cls, line: float) -> Effect:
        """Return one order of this wave number [1/m]."""
        return cls(PitchOptions(pitch_m=1.0 / line))

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return one order at every pitch that the travel can tell from the next."""
        return [cls(PitchOptions(pitch_m=pitch)) for pitch in trial_pitches(spans)]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the pitch."""
        return pitch_steps(self.options, spans)

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return one order more."""
        return [type(self)(options) for options in richer_pitches(self.options, spans)]
