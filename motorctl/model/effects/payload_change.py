"""A load put on the carriage, or taken off, at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import even_grid
from motorctl.model.knowledge import CarriedOver, Picture, Spans
from motorctl.model.parameter import Parameter

FORMS = 60
"""Times of the change that are tried. More takes time, fewer starts the refinement too far away.
Chosen by hand: steps of 1.5 % of the recording."""
OUTER = 0.05
"""Part of the recording, at each end, in which no change is sought. Smaller tells an inertia from
too short a piece, larger misses early and late changes. Chosen by hand."""


class PayloadOptions(EffectOptions):
    """When the load changes."""

    time_s: float = Field(allow_inf_nan=False, description="time of the change")


class PayloadChange(Effect):
    """m a from the time of the change on."""

    name = "payload_change"
    kind = "state"
    title = "Change of payload"
    formula = "m * a,  t >= t_0"
    compensated = "the inertia after the change, which a refined configuration starts with"
    identified = "linear in acceleration from t_0 on; the time t_0 by a scan"
    visible_in = "accelerations well above the noise both before and after the change"
    sets_in = True
    refuted_at_end = MappingProxyType({"time_s": "either"})
    revealed_by = ("longer_run",)
    Options = PayloadOptions
    options: PayloadOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """m: what is added to theta1; negative where a load is taken off."""
        return (Parameter("", "m", "V*s^2/m", -1e3, 1e3, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """t_0 [s]."""
        return (self.options.time_s,)

    @property
    def picture(self) -> Picture:
        """Moving mass over time."""
        return Picture("mass_over_time", "Moving mass against time.", scale=self.options.time_s)

    def carry_over(self, theta: Sequence[float], spans: Spans) -> CarriedOver:
        """Carry over the inertia after the change, not the time of the change."""
        after_s = self.options.time_s - spans.time_s[0]
        return CarriedOver(
            kept=False,
            adds={"acceleration": theta[0]},
            note=(
                f"the load changed by {theta[0]:.3g} V*s^2/m of inertia {after_s:.4g} s after the "
                "begin of this recording: the refined configuration has the inertia after the "
                "change; the time of the recording is no time of the daemon"
            ),
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return times all over the recording but its ends."""
        return [cls(PayloadOptions(time_s=time)) for time in even_grid(*_span(spans), _step(spans))]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the time."""
        return {"time_s": _step(spans)} if spans.duration_s > 0.0 else {}

    def ranges(self, spans: Spans) -> Mapping[str, tuple[float, float]]:
        """Return the recording without its ends."""
        return {"time_s": _span(spans)}


def _span(spans: Spans) -> tuple[float, float]:
    """Return between what times a change is sought."""
    outer = OUTER * spans.duration_s
    return spans.time_s[0] + outer, spans.time_s[1] - outer


def _step(spans: Spans) -> float:
    return (1.0 - 2.0 * OUTER) * spans.duration_s / (FORMS - 0.5)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return the acceleration, once the load has changed."""
    return a if t >= c[0] else 0.0
