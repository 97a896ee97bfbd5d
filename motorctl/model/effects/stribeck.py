"""Friction that changes at low speed, while the lubricating film builds up."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from numba import njit
from pydantic import Field

from motorctl.model.effect import Effect
from motorctl.model.grids import log_grid, log_step
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter
from motorctl.model.sign_function import SlopeOptions, sf

PER_DECADE = 12
"""Speeds that are tried, a decade. More takes time, fewer starts the refinement too far away.
Chosen by hand: each is about a fifth faster than the last."""
BEYOND_TURNOVER = 2.0
"""Speed of the decay over that at which Sf turns over, from which it is no part of the corner.
Larger asks true ones whether they are, smaller names wide corners. Chosen by hand: true ones of
other hands have 5 to 120, a corner that was named had 1.1."""


class StribeckOptions(SlopeOptions):
    """Speed and sharpness of the change."""

    velocity_m_s: float = Field(
        ge=1e-9, allow_inf_nan=False, description="speed at which the extra friction has decayed"
    )
    exponent: float = Field(default=2.0, ge=0.1, le=10.0, description="sharpness of the decay")


class Stribeck(Effect):
    """F_s exp(-(|v|/v_s)^d) Sf(v), on top of Coulomb friction."""

    name = "stribeck"
    kind = "state"
    title = "Stribeck friction"
    formula = "F_s * exp(-(|v|/v_s)^d) * Sf(v)"
    compensated = "feedforward at the desired velocity"
    identified = "linear in its force F_s; speed v_s and exponent d by a scan"
    visible_in = (
        "slow travel in both directions, at several constant speeds below and around v_s "
        "(a thousandth to a tenth of the top speed), not only reversals"
    )
    corner_is = (
        "decaying within the speeds in which friction turns over it is the corner of a friction of "
        "another shape. Slower reversals would tell the two apart"
    )
    groups = frozenset({"friction"})
    ordinary = True
    # how sharply it decays says little beside the speed: a sharper one is the same effect
    refuted_at_end = MappingProxyType({"velocity_m_s": "either", "exponent": "neither"})
    revealed_by = ("slow_reversals",)
    Options = StribeckOptions
    options: StribeckOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """F_s, never negative: friction that is lower at low speed only turns over less steeply."""
        return (Parameter("", "F_s", "V", 0.0, 1e3, 0.0, 1.0),)

    @property
    def constants(self) -> tuple[float, ...]:
        """1/v_s [s/m], exponent, slope of Sf [s/m]."""
        return 1.0 / self.options.velocity_m_s, self.options.exponent, *self.options.sign.constants

    @property
    def picture(self) -> Picture:
        """Friction against velocity, and slow motion close by."""
        return Picture(
            "friction_over_velocity",
            "Friction against velocity: data and models.",
            scale=self.options.velocity_m_s,
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return speeds up to a third of the top speed, decaying as exp and as a bell.

        None that every reversal passes in less time than a part of the band's period: what happens
        there is the corner of friction.
        """
        # slower than where Sf turns over, the two cannot be told apart
        turnover = 1.0 / StribeckOptions.model_fields["slope_s_m"].default
        slowest = max(spans.speed_m_s / 5e3, turnover)
        if slowest > spans.speed_m_s / 6.0:
            slowest = max(spans.speed_m_s / 5e3, 1e-9)
        slowest = max(slowest, min(spans.unseen_speed_m_s, spans.speed_m_s / 6.0))
        speeds = log_grid(slowest, spans.speed_m_s / 3.0, PER_DECADE)
        return [
            cls(StribeckOptions(velocity_m_s=speed, exponent=exponent))
            for exponent in (1.0, 2.0)
            for speed in speeds
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine speed and exponent."""
        return {
            "velocity_m_s": log_step(self.options.velocity_m_s, PER_DECADE),
            "exponent": 0.25 * self.options.exponent,
        }

    def corner(self) -> Effect | None:
        """Return the form that decays where Sf turns over; None for one that decays well beyond."""
        turnover = 1.0 / self.options.slope_s_m
        if self.options.velocity_m_s >= BEYOND_TURNOVER * turnover:
            return None
        return self.with_options(velocity_m_s=turnover)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]
) -> float:
    """Return the decay times Sf, both of the velocity that is free of quantisation."""
    return math.exp(-((abs(vs) * c[0]) ** c[1])) * sf(vs, c[2], c[3])
