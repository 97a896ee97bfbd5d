"""An elastic stop that the axis runs into at an end of its travel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions, Parameter
from motorctl.model.knowledge import Picture, Spans

PLACES = (0.01, 0.02, 0.04, 0.07, 0.12, 0.2)
"""Parts of the travel before its end at which the stop may begin."""


class HardStopOptions(EffectOptions):
    """Where it begins, and on which side."""

    begin_m: float = Field(allow_inf_nan=False, description="where the axis touches it")
    side: Literal["upper", "lower"] = Field(
        default="upper", description="upper: it acts above begin_m; lower: below"
    )


class HardStop(Effect):
    """K_s max(0, x - x_s) above, or K_s min(0, x - x_s) below."""

    name = "hard_stop"
    kind = "state"
    title = "Elastic stop at an end of the travel"
    formula = "K_s * max(0, x - x_s), or K_s * min(0, x - x_s)"
    compensated = "feedforward of its negative at the desired position"
    identified = "linear in its stiffness K_s; where it begins by a scan"
    visible_in = "travel to both ends, slowly, several times"
    groups = frozenset({"force_of_position"})
    revealed_by = ("two_speeds",)
    Options = HardStopOptions
    options: HardStopOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """K_s: a stop pushes back."""
        return (Parameter("stiffness", "K_s", "V/m", 0.0, 1e7, 0.0, 1e3),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Where it begins [m], and 1 above or -1 below."""
        return self.options.begin_m, 1.0 if self.options.side == "upper" else -1.0

    @property
    def picture(self) -> Picture:
        """Force against position."""
        return Picture(
            "force_over_position",
            "Command that works against the stop, over position; below, the residual.",
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return stops in the last fifth of the travel, on both sides."""
        if spans.travel_m <= 0.0:
            return ()
        low, high = spans.position_m
        upper = [HardStopOptions(begin_m=high - part * spans.travel_m) for part in PLACES]
        lower = [
            HardStopOptions(begin_m=low + part * spans.travel_m, side="lower") for part in PLACES
        ]
        return [cls(options) for options in (*upper, *lower)]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine where it begins."""
        return {"begin_m": 0.01 * spans.travel_m}


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return how far it is pressed in, signed."""
    d = x - c[0]
    return d if d * c[1] > 0.0 else 0.0
