"""Friction as a hysteretic spring, before the contact slides."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from motorctl.model.effect import Effect
from motorctl.model.grids import log_grid, log_step
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter
from motorctl.model.sign_function import SlopeOptions, sf

Array = NDArray[np.float64]

PER_DECADE = 6
"""Displacements that are tried, a decade. More takes time, fewer starts the refinement too far
away. Chosen by hand: each is about half as long again as the last."""
COUNTS = 3.0
"""Counts of the encoder that a displacement has at least: less motion is not seen to turn the
friction over. Smaller takes rounding for it, larger misses short ones. Chosen by hand."""
LONGEST_PART = 5e-3
"""Longest displacement that is tried, as a part of the travel, or thirty times the shortest where
that is more. Larger takes a spring for friction, smaller misses soft contacts on short travel.
Chosen by hand."""

LEAST_M = 1e-12
"""Least displacement that can be declared: any other would do that no machine has. Convention."""
SOONER = 0.03
"""Displacement of a friction that is dry for all that a recording shows, over the one that was
found. Larger doubts displacements that are known to a few tenths, smaller names those of which only
an upper limit is known. Chosen by hand on machines of other hands: with that little, bristles that
are there take no more than 0.54 of what they took, dry friction 0.97 and 0.995."""
DRY_FROM_S_M = 3000.0
"""Slope of the friction beside it from which that is dry by itself. Larger names bristles of dry
friction, smaller misses a dry part of friction that turns over slowly otherwise, as a ball screw's.
Chosen by hand: dry machines of other hands are mended to 8,700 and 12,000, a published ball screw
that sticks to 50."""


class PreslidingOptions(SlopeOptions):
    """How far the contact yields before it slides."""

    displacement_m: float = Field(
        ge=LEAST_M,
        allow_inf_nan=False,
        description="x_s: motion over which a reversal of the friction takes place",
    )


class Presliding(Effect):
    """Dahl's bristle state h instead of Sf(v), and the damping of the bristles.

    dh/dx = (sign(dx) - h)/x_s (Dahl 1968), integrated exactly over every motion; the second
    column is x_s dh/dt = v - |v| h, LuGre's bristle rate (Canudas de Wit et al. 1995).
    """

    name = "presliding"
    kind = "state"
    memory = 3
    title = "Presliding friction"
    formula = "F_h * (h - Sf(v)) + sigma * (v - |v| h),  dh/dx = (sign(dx) - h)/x_s"
    compensated = "feedforward with h advanced along the desired position"
    identified = "linear in its force F_h and damping sigma; displacement x_s by a scan"
    visible_in = (
        "many slow reversals and short strokes, from x_s itself (micrometres) to a hundred "
        "times as much, with an encoder that resolves x_s"
    )
    groups = frozenset({"friction"})
    scan_shows_part = True
    refuted_at_end = MappingProxyType({"displacement_m": "either"})
    corner_is = (
        f"with {100.0 * SOONER:g} % of its displacement it is friction that is dry, which sticks "
        "and lets go at once. Shorter strokes, or a finer encoder, would tell the two apart"
    )
    revealed_by = ("slow_reversals",)
    Options = PreslidingOptions
    options: PreslidingOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """F_h takes the place of as much Coulomb friction; sigma is LuGre's sigma_1."""
        return (
            Parameter("force", "F_h", "V", 0.0, 1e3, 0.0, 1.0),
            Parameter("micro_damping", "sigma", "V*s/m", 0.0, 1e4, 0.0, 10.0),
        )

    @property
    def constants(self) -> tuple[float, ...]:
        """1/x_s [1/m], slope of Sf [s/m]."""
        return 1.0 / self.options.displacement_m, *self.options.sign.constants

    def way_of_rise_m(self, low: float, high: float) -> float:
        """Return the way of an exponential approach: x_s ln((1 - low) / (1 - high))."""
        return self.options.displacement_m * math.log((1.0 - low) / (1.0 - high))

    @property
    def picture(self) -> Picture:
        """Friction against the way after a reversal."""
        return Picture(
            "friction_after_reversal",
            "Friction against the way after each reversal, in the direction of the new motion, and "
            "against velocity.",
            scale=self.options.displacement_m,
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return displacements from a few counts, or millionths of the travel, to a two hundredth.

        None that is passed in less time than a part of the band's period: such a turning over looks
        like any other.
        """
        low = max(COUNTS * spans.resolution_m, 2e-6 * spans.travel_m, spans.unseen_way_m, 1e-12)
        high = max(LONGEST_PART * spans.travel_m, 30.0 * low)
        if not spans.travel_m > high:
            return ()
        return [
            cls(PreslidingOptions(displacement_m=displacement))
            for displacement in log_grid(low, high, PER_DECADE)
        ]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the displacement."""
        return {"displacement_m": log_step(self.options.displacement_m, PER_DECADE)}

    def corner(self) -> Effect | None:
        """Return the form that turns over at once, as friction does that does not bend."""
        sooner = SOONER * self.options.displacement_m
        return self.with_options(displacement_m=sooner) if sooner >= LEAST_M else None

    @property
    def only_corner_is_left(self) -> bool:
        """Whether the friction beside it is dry: a slower one may lack a part that is."""
        return self.options.slope_s_m >= DRY_FROM_S_M


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, w: Array, c: tuple[float, ...]
) -> float:
    """Return what h adds to Sf, or the rate of the bristles [m/s]; w is (h, last x, started)."""
    h = float(w[0])
    return h - sf(vs, c[1], c[2]) if j == 0 else v - abs(v) * h


@njit
def advance(
    w: Array, x: float, v: float, a: float, dt: float, others: Array, c: tuple[float, ...]
) -> None:
    """Take h along the motion since the last position; the first position only starts it."""
    moved = x - w[1] if w[2] != 0.0 else 0.0
    if moved != 0.0:
        target = math.copysign(1.0, moved)
        w[0] = target + (w[0] - target) * math.exp(-abs(moved) * c[0])
    w[1] = x
    w[2] = 1.0
