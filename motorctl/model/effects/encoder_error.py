"""Periodic error of the measured position: of an encoder's interpolation, of a screw or a gear."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Self

from numba import njit
from pydantic import Field, model_validator

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.parameter import Parameter
from motorctl.model.pitch import SHORTEST_TRAVEL_M, wave_number_step

COUNTS = (4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100, 128, 160, 200, 256, 400, 512, 1000)
"""Counts in a period that encoders interpolate to, where a signal period is sought from the
resolution. More takes time, fewer misses encoders that interpolate otherwise. Chosen by hand:
powers of two and round numbers."""
PERIODS_M = (20e-6, 40e-6)
"""Grating periods that are tried besides [m], and alone where the resolution is not known. More
takes time, fewer misses scales that interpolate finer than the counts above. Convention: those of
the common linear scales."""
FEWEST_PERIODS = 3.5
"""Periods over the travel that the longest form has, which bounds the refinement as well: what
repeats less often may be any curve. Fewer takes a slow curve for an error that repeats, more misses
long ones of screws and gears. Chosen by hand."""
TURN_RAD = 2.0 * math.pi
"""Period that is tried of an axis that turns round at least once [rad]: a disc or a gear off its
centre errs once a turn. Larger or smaller is no turn. Arithmetic."""
STEEPEST = 0.5
"""Largest slope of the error [m/m]. Nearer to 1 three steps of the correction leave more of it, and
from there on one measurement belongs to several positions; smaller refuses errors that could be
undone. Chosen by hand."""


class EncoderErrorOptions(EffectOptions):
    """Signal period of the encoder, and its error."""

    period_m: float = Field(
        ge=1e-12, allow_inf_nan=False, description="signal period: grating period or a part of it"
    )
    sin_m: float = Field(default=0.0, allow_inf_nan=False, description="amplitude of the sine")
    cos_m: float = Field(default=0.0, allow_inf_nan=False, description="amplitude of the cosine")
    sin2_m: float = Field(
        default=0.0, allow_inf_nan=False, description="amplitude of the sine of twice the angle"
    )
    cos2_m: float = Field(
        default=0.0, allow_inf_nan=False, description="amplitude of the cosine of twice the angle"
    )

    @model_validator(mode="after")
    def _can_be_inverted(self) -> Self:
        amplitude = math.hypot(self.sin_m, self.cos_m) + 2.0 * math.hypot(self.sin2_m, self.cos2_m)
        most = STEEPEST * self.period_m / (2.0 * math.pi)
        if amplitude > most:
            raise ValueError(f"an amplitude of {amplitude:g} m; at most {most:g} m can be undone")
        return self


class EncoderError(Effect):
    """The encoder shows y = x + S sin(q) + C cos(q) + S2 sin(2q) + C2 cos(2q), q = 2 pi x/p.

    Two orders are what encoders (gain and offset of their signals), screws and gears mostly show.
    """

    name = "encoder_error"
    kind = "measurement"
    title = "Periodic error of the measured position"
    formula = "y = x + S sin(q) + C cos(q) + S2 sin(2q) + C2 cos(2q),  q = 2 pi x/p"
    compensated = "correction of the measured position"
    identified = "linear in sines and cosines of the raw position; the period p by a scan"
    visible_in = (
        "slow constant speeds, at which a signal period takes many samples, at two different "
        "speeds: its apparent force grows with the square of the speed, a real one does not"
    )
    amplitudes = ("sin_m", "cos_m", "sin2_m", "cos2_m")
    groups = frozenset({"wave_of_measurement"})
    revealed_by = ("two_speeds",)
    Options = EncoderErrorOptions
    options: EncoderErrorOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: the error is an option, since it acts before the force balance."""
        return ()

    @property
    def constants(self) -> tuple[float, ...]:
        """Wave number [rad/m] and the amplitudes [m]."""
        o = self.options
        return 2.0 * math.pi / o.period_m, o.sin_m, o.cos_m, o.sin2_m, o.cos2_m

    @property
    def lines(self) -> tuple[float, ...]:
        """Wave numbers [1/m] of both orders, and of what a large error makes of them."""
        return tuple(k / self.options.period_m for k in range(1, 5))

    @property
    def picture(self) -> Picture:
        """The error over one period."""
        return Picture(
            "error_over_period",
            "Error of the measured position over one period of the scale, as the acceleration "
            "tells.",
            scale=self.options.period_m,
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return the periods that encoders of this resolution have; no error yet.

        And the longest, and one turn: those of screws and gears come from the lines of a spectrum.
        """
        count = spans.resolution_m
        periods = {*(n * count for n in COUNTS), *PERIODS_M}
        shortest = max(1e-12, 3.9 * count)
        tried = [p for p in sorted(periods) if shortest <= p <= spans.travel_m / 10.0]
        longest = spans.travel_m / FEWEST_PERIODS
        if shortest < longest < math.inf:
            tried.append(longest)
        if spans.rotary and spans.travel_m > max(TURN_RAD, longest):
            tried.append(TURN_RAD)
        return [cls(EncoderErrorOptions(period_m=period)) for period in tried]

    @classmethod
    def at_line(cls, line: float) -> Effect:
        """Return an error of this wave number [1/m], whose size is not known yet."""
        return cls(EncoderErrorOptions(period_m=1.0 / line))

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the period by what the travel can tell."""
        if not SHORTEST_TRAVEL_M < spans.travel_m < math.inf:
            return {}
        return {"period_m": self.options.period_m**2 * wave_number_step(spans)}


@njit(error_model="numpy")
def correct(y: float, c: tuple[float, ...]) -> float:
    """Return the position x that the encoder shows as y, by three steps of Newton's method."""
    x = y
    for _ in range(3):
        sine, cosine = math.sin(c[0] * x), math.cos(c[0] * x)
        sine2, cosine2 = 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine
        error = c[1] * sine + c[2] * cosine + c[3] * sine2 + c[4] * cosine2
        steepness = c[0] * (c[1] * cosine - c[2] * sine + 2.0 * (c[3] * cosine2 - c[4] * sine2))
        x -= (x + error - y) / (1.0 + steepness)
    return x


@njit(inline="always")
def column(j: int, x: float, c: tuple[float, ...]) -> float:
    """Return what the encoder shows too much at x for an amplitude of one."""
    angle = c[0] * x if j < 2 else 2.0 * c[0] * x
    return math.sin(angle) if j % 2 == 0 else math.cos(angle)
