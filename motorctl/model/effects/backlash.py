"""Lost motion between motor and load: a worn gear, a nut with play, a loose coupling."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import log_grid, log_step
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter

Array = NDArray[np.float64]

PER_DECADE = 10
"""Gaps that are tried, a decade. More takes time, fewer start the refinement too far away. Chosen
by hand."""
COUNTS = 6.0
"""Counts of the encoder that a gap has at least. Smaller takes rounding for a gap, larger misses
fine ones. Chosen by hand."""
SHORTEST, LONGEST = 2e-4, 0.03
"""Gaps that are tried, as parts of the travel. Shorter ones are crossed too quickly to be seen,
longer ones hardly leave a machine; wider takes time. Chosen by hand."""
GLIDES = (0.03, 0.12, 0.5)
"""Decelerations with which the load glides through the gap, as parts of the top acceleration. More
takes time, fewer starts the refinement too far away. Chosen by hand."""
SLOWING = (0.0, 0.1)
"""Deceleration that the load's viscous friction adds to its glide at top speed, as parts of the top
acceleration. More takes time; without a part, wide gaps are met at the wrong moment. Chosen by
hand."""
FASTEST_1_S = 1e4
"""Most that viscous friction brakes a load [1/s]: it stops within a tick. Any other would do that
is beyond what machines have. Chosen by hand."""
CONTACT_HZ = 80.0
"""Frequency of the load on the flank's stiffness from which the search starts: gears and nuts of
machines come to rest in some milliseconds. Larger wants a finer sampling, smaller looks like a
spring. Chosen by hand."""
BANDS = 2.0
"""The same in bands of the recording, at most: a quicker contact is a blow between two samples.
Larger is missed by the samples, smaller is slower than most contacts. Chosen by hand."""
CONTACT_DAMPING = 0.8
"""Its damping ratio from which the search starts. Larger sticks at once, smaller bounces for long;
metal on grease lies between. Chosen by hand."""
SOFTEST, HARDEST = 0.25, 4.0
"""Contacts that are sought, as parts of the frequency from which the search starts. Larger ends
take time, smaller ones miss belts and blows. Chosen by hand."""
SLIPPERIEST, STICKIEST = 0.02, 1.2
"""Damping ratios of contacts that are sought. Larger ends take time, smaller ones miss what bounces
for long. Chosen by hand: beyond 1 nothing bounces."""
MOST_GLIDE, MOST_SLOWING = 0.75, 1.0
"""Most deceleration of a gliding load that is sought, by dry friction and at top speed by viscous
friction, as parts of the top acceleration. Larger stops at once, smaller misses loads that rub.
Chosen by hand."""
STEPS_A_TURN = 25.0
"""Steps of the integration in a turn of that oscillation. Fewer damp it by rounding, more take
time. Arithmetic: an implicit Euler step of 2 pi / 25 adds half of it to the damping ratio."""
MOST_STEPS = 32
"""Steps in a sample, at most: what is sampled more coarsely does not show the contact. Larger takes
time on recordings that show nothing. Chosen by hand."""


class BacklashOptions(EffectOptions):
    """How wide the gap is, and how the load behaves in it and at its flanks."""

    gap_m: float = Field(ge=1e-12, allow_inf_nan=False, description="g: from flank to flank")
    glide_m_s2: float = Field(
        ge=0.0, allow_inf_nan=False, description="d: deceleration of the load that is not pushed"
    )
    slows_1_s: float = Field(
        default=0.0,
        ge=0.0,
        le=FASTEST_1_S,
        description="k: part of its velocity that such a load loses in a second",
    )
    contact_hz: float = Field(
        default=CONTACT_HZ, ge=1.0, le=1e4, description="of the load on the flank's stiffness"
    )
    contact_damping: float = Field(
        default=CONTACT_DAMPING, ge=0.0, le=5.0, description="damping ratio of that oscillation"
    )


class Backlash(Effect):
    """m times what the load's push on the motor lacks of, or has beyond, that of a fixed load.

    The load is driven by the motor's motion through a gap: it glides, braked by its own friction,
    d + k v per mass, until a flank pushes it with stiffness and damping; flanks push, they do not
    pull (Nordin, Gutman 2002, the physical model with a shaft that is damped). Inertia and friction
    count the load as if it were fixed, so the column is the push of the flanks less that of a joint
    of the same stiffness without a gap, per mass: it is zero as long as one flank is in touch.
    """

    name = "backlash"
    kind = "state"
    memory = 8
    title = "Backlash before the load"
    formula = "m * (push of the flanks - push of a joint without gap), per unit of the load's mass"
    compensated = "feedforward with the load advanced along the desired motion"
    identified = "linear in the load's inertia m; gap, glide, slowing and contact by evolution"
    visible_in = (
        "many reversals, quick ones and slow ones, with the encoder on the motor, and an encoder "
        "that shows the gap with a dozen counts"
    )
    scan_shows_part = True
    valleys_along = "gap_m"  # a wrong one, too, is crossed in time now and then
    leaves_bursts = True
    # a load without friction glides for ever, one with much stops at once
    refuted_at_end = MappingProxyType(
        {
            "gap_m": "either",
            "glide_m_s2": "neither",
            "slows_1_s": "neither",
            "contact_hz": "neither",
            "contact_damping": "neither",
        }
    )
    revealed_by = ("fast_reversals", "slow_reversals")
    Options = BacklashOptions
    options: BacklashOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """m: the inertia beyond the gap, contained in theta1."""
        return (Parameter("inertia", "m", "V*s^2/m", 0.0, 1e3, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Half the gap [m], glide [m/s^2], stiffness [1/s^2], damping, steps and slowing [1/s]."""
        omega = 2.0 * math.pi * self.options.contact_hz
        return (
            0.5 * self.options.gap_m,
            self.options.glide_m_s2,
            omega * omega,
            2.0 * self.options.contact_damping * omega,
            STEPS_A_TURN * self.options.contact_hz,
            self.options.slows_1_s,
        )

    @property
    def picture(self) -> Picture:
        """Force against the way after a reversal: within the gap the load is not pushed."""
        return Picture(
            "friction_after_reversal",
            "Force against the way after each reversal, in the direction of the new motion: the "
            "load is not pushed until the gap is passed.",
            scale=self.options.gap_m,
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return gaps from a few counts to a thirtieth of the travel, each for several glides.

        None where the axis never turns round: one flank pushes all the time, and what rings there
        is no gap.
        """
        contact_hz = min(CONTACT_HZ, BANDS * spans.band_hz)
        low = max(COUNTS * spans.resolution_m, SHORTEST * spans.travel_m, 1e-12)
        if not spans.acceleration_m_s2 > 0.0 or spans.one_way:
            return ()
        top_1_s = _acceleration_over_speed(spans)
        return [
            cls(
                BacklashOptions(
                    gap_m=gap,
                    glide_m_s2=part * spans.acceleration_m_s2,
                    slows_1_s=slowing * top_1_s,
                    contact_hz=max(contact_hz, 1.0),
                )
            )
            for part in GLIDES
            for gap in log_grid(low, LONGEST * spans.travel_m, PER_DECADE)
            for slowing in SLOWING
        ]

    def ranges(self, spans: Spans) -> Mapping[str, tuple[float, float]]:
        """Return the ranges of all that the gap's width does not tell."""
        contact_hz = max(min(CONTACT_HZ, BANDS * spans.band_hz), 1.0)
        return {
            "glide_m_s2": (0.0, MOST_GLIDE * spans.acceleration_m_s2),
            "slows_1_s": (0.0, MOST_SLOWING * _acceleration_over_speed(spans)),
            "contact_hz": (SOFTEST * contact_hz, HARDEST * contact_hz),
            "contact_damping": (SLIPPERIEST, STICKIEST),
        }

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine gap, glide, slowing and contact."""
        return {
            "gap_m": log_step(self.options.gap_m, PER_DECADE),
            "glide_m_s2": max(0.5 * self.options.glide_m_s2, 1e-3 * spans.acceleration_m_s2),
            "slows_1_s": max(0.5 * self.options.slows_1_s, 0.05 * _acceleration_over_speed(spans)),
            "contact_hz": 0.3 * self.options.contact_hz,
            "contact_damping": 0.3 * self.options.contact_damping,
        }


def _acceleration_over_speed(spans: Spans) -> float:
    """Return the top acceleration over the top speed [1/s], as far as the option goes."""
    return min(spans.acceleration_m_s2 / max(spans.speed_m_s, 1e-300), FASTEST_1_S)


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, w: Array, c: tuple[float, ...]
) -> float:
    """Return the flanks' push less that of a joint without a gap [m/s^2].

    w is (that, last x, last v, way of the motor ahead of the load and the load's velocity with a
    gap, and without one; started).
    """
    return float(w[0])


@njit(inline="always")
def _braked(p: float, most: float) -> float:
    """Return a velocity after friction has taken at most so much of it."""
    return p - most if p > most else (p + most if p < -most else 0.0)


@njit(error_model="numpy")
def advance(
    w: Array, x: float, v: float, a: float, dt: float, others: Array, c: tuple[float, ...]
) -> None:
    """Take both loads along a motion whose velocity goes straight from the last to this.

    Implicit Euler on the flanks, so stable at any sample rate. The push is that of the last step:
    the mean over a sample would be half a sample late.
    """
    if w[7] == 0.0 or not dt > 0.0:
        w[1], w[2], w[7] = x, v, 1.0
        return
    steps = int(min(max(math.ceil(dt * c[4]), 1.0), MOST_STEPS))
    h = dt / steps
    brake, slowed = c[1] * h, 1.0 / (1.0 + c[5] * h)
    share = 1.0 / (1.0 + h * c[3] + h * h * c[2])
    stiff, damped = share * h * c[2], share * h * c[3]
    # the velocity's straight line misses the position by so much a step
    drift = (x - w[1] - 0.5 * (v + w[2]) * dt) / steps
    faster = (v - w[2]) / steps
    push, way, p, fixed_way, fixed_p = 0.0, w[3], w[4], w[5], w[6]
    for k in range(steps):
        u = w[2] + faster * (k + 0.5)
        moved = drift + h * u
        ahead, push = way + moved, 0.0
        depth = ahead - h * p
        if abs(depth) > c[0]:
            after = share * p + stiff * (ahead - math.copysign(c[0], depth)) + damped * u
            if (after - p) * depth > 0.0:  # flanks push, they do not pull
                push = after - p
                p = after
        p = slowed * _braked(p, brake)
        way = ahead - h * p
        ahead = fixed_way + moved
        after = share * fixed_p + stiff * ahead + damped * u
        push -= after - fixed_p
        fixed_p = slowed * _braked(after, brake)
        fixed_way = ahead - h * fixed_p
    w[0], w[1], w[2] = push / h, x, v
    w[3], w[4], w[5], w[6] = way, p, fixed_way, fixed_p
