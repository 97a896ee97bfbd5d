"""An elastic stop that the axis runs into at an end of its travel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Literal

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

PLACES = (0.01, 0.02, 0.04, 0.07, 0.12, 0.2)
"""Parts of the travel before its end at which the stop may begin. More takes time, fewer starts the
refinement too far away; larger takes any force near the end for a stop. Chosen by hand."""

DEEPEST = 0.3
"""Part of the travel before its end from which what begins there is no stop: a spring acts over so
much. Larger takes any force near the end for a stop, smaller misses long buffers. Chosen by hand:
half as much again as the forms that are tried."""


class HardStopOptions(EffectOptions):
    """Where it begins, and on which side."""

    begin_m: float = Field(allow_inf_nan=False, description="where the axis touches it")
    side: Literal["upper", "lower"] = Field(
        default="upper", description="upper: it acts above begin_m; lower: below"
    )
    progressive: bool = Field(default=False, description="it grows stiffer the deeper it is pushed")
    damped: bool = Field(default=False, description="it also takes speed away, more the deeper")


class HardStop(Effect):
    """K_s d + K_2 d |d| + B_s |d| v, with d = max(0, x - x_s) above or min(0, x - x_s) below.

    Rubber grows stiffer the deeper it is pushed in, and takes energy in proportion to how far it
    is (Hunt, Crossley, J. Applied Mechanics 42(2), 1975, pp. 440-445).
    """

    name = "hard_stop"
    kind = "state"
    title = "Elastic stop at an end of the travel"
    formula = "K_s d + K_2 d |d| + B_s |d| v,  d = max(0, x - x_s), or min(0, x - x_s)"
    compensated = "feedforward of its negative at the desired position and velocity"
    identified = "linear in K_s, and in K_2 and B_s where they pay; where it begins by a scan"
    visible_in = "travel to both ends, slowly, several times"
    groups = frozenset({"force_of_position"})
    refuted_at_end = MappingProxyType({"begin_m": "either"})
    revealed_by = ("two_speeds",)
    Options = HardStopOptions
    options: HardStopOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """K_s, K_2 and B_s: a stop pushes back, and takes energy."""
        stiffness = Parameter("stiffness", "K_s", "V/m", 0.0, 1e7, 0.0, 1e3)
        deeper = Parameter("progressive", "K_2", "V/m^2", 0.0, 1e9, 0.0, 1e5)
        damping = Parameter("damping", "B_s", "V*s/m^2", 0.0, 1e9, 0.0, 1e3)
        progressive, damped = self.options.progressive, self.options.damped
        return (stiffness, *((deeper,) * progressive), *((damping,) * damped))

    @property
    def constants(self) -> tuple[float, ...]:
        """Where it begins [m], 1 above or -1 below, and 1 where it is progressive."""
        side = 1.0 if self.options.side == "upper" else -1.0
        return self.options.begin_m, side, float(self.options.progressive)

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

    def ranges(self, spans: Spans) -> Mapping[str, tuple[float, float]]:
        """Return the way before the end of the travel, and as much beyond it: a stop is near it."""
        end = spans.position_m[1 if self.options.side == "upper" else 0]
        return {"begin_m": (end - DEEPEST * spans.travel_m, end + DEEPEST * spans.travel_m)}

    def richer(self, spans: Spans) -> Sequence[Effect]:
        """Return stops of rubber: stiffer the deeper, damped, each if it is not so yet."""
        shapes = [shape for shape in ("progressive", "damped") if not getattr(self.options, shape)]
        return [self.with_options(**{shape: True}) for shape in shapes]


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return how far it is pressed in, signed; its square; and its damping."""
    d = x - c[0]
    if d * c[1] <= 0.0:
        return 0.0
    if j == 0:
        return d
    return d * abs(d) if j == 1 and c[2] > 0.0 else abs(d) * v
