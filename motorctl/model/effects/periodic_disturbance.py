"""A force of fixed frequency from outside: fan, pump, mains, a part that swings by itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import even_grid
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

LOWEST_HZ = 0.2
"""Lowest frequency of the forms [Hz], which bounds the refinement as well; less in a narrow band,
more in a short recording. Larger keeps slow swings from being refined, smaller lets drift pass for
one. Chosen by hand."""
MOST_FORMS = 8000
"""Frequencies from the lowest to the band's end, at most. More makes long lists of long recordings,
fewer makes their steps coarser than a line. Chosen by hand."""


class PeriodicOptions(EffectOptions):
    """The frequency."""

    frequency_hz: float = Field(
        ge=1e-9, allow_inf_nan=False, description="frequency of the disturbance"
    )


class PeriodicDisturbance(Effect):
    """A force on the carriage, S sin(2 pi f t) + C cos(2 pi f t)."""

    name = "periodic_disturbance"
    kind = "state"
    title = "Periodic disturbance"
    formula = "-(S sin(2 pi f t) + C cos(2 pi f t))"
    compensated = "feedforward of its negative; the adaptation follows its phase"
    identified = "linear in sine and cosine of time; the frequency f by a scan"
    visible_in = (
        "many periods of the disturbance, at rest too, at two different speeds: what follows the "
        "speed is periodic in position instead"
    )
    groups = frozenset({"wave_over_time", "line_over_time"})
    revealed_by = ("two_speeds",)
    Options = PeriodicOptions
    options: PeriodicOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """S and C."""
        return (
            Parameter("sin", "S", "V", -1e3, 1e3, 0.0, 1.0),
            Parameter("cos", "C", "V", -1e3, 1e3, 0.0, 1.0),
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """Angular frequency [rad/s]."""
        return (2.0 * math.pi * self.options.frequency_hz,)

    @property
    def lines(self) -> tuple[float, ...]:
        """The frequency [Hz]."""
        return (self.options.frequency_hz,)

    @property
    def repeats_every(self) -> float:
        """The period [s]."""
        return 1.0 / self.options.frequency_hz

    @property
    def picture(self) -> Picture:
        """Over time, and folded over the period."""
        return Picture(
            "folded_over_time",
            "Disturbance that everything else leaves, over time and folded over its period.",
            scale=1.0 / self.options.frequency_hz,
        )

    @classmethod
    def at_line(cls, line: float) -> Effect:
        """Return a wave of this frequency [Hz]."""
        return cls(PeriodicOptions(frequency_hz=line))

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return every frequency that the duration can tell from the next."""
        if not spans.duration_s > 0.0:
            return ()
        low = max(min(LOWEST_HZ, spans.band_hz / 100.0), 2.0 / spans.duration_s, 1e-9)
        frequencies = even_grid(low, spans.band_hz, _step(spans))
        return [cls(PeriodicOptions(frequency_hz=frequency)) for frequency in frequencies]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the frequency."""
        return {"frequency_hz": _step(spans)} if spans.duration_s > 0.0 else {}


def _step(spans: Spans) -> float:
    # half of 1/duration loses a tenth of an amplitude between neighbours
    return max(0.5 / spans.duration_s, spans.band_hz / (MOST_FORMS - 1))


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return minus the sine or the cosine of time."""
    return -math.sin(c[0] * t) if j == 0 else -math.cos(c[0] * t)
