"""Interpolation error of the encoder: periodic in position, and in the measurement alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Self

from numba import njit
from pydantic import Field, model_validator

from motorctl.model.effect import Effect, EffectOptions, Parameter
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.pitch import SHORTEST_TRAVEL_M, wave_number_step

COUNTS = (4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100, 128, 160, 200, 256, 400, 512, 1000)
"""Counts in a period that encoders interpolate to."""
PERIODS_M = (20e-6, 40e-6)
"""Grating periods of the common linear scales."""
STEEPEST = 0.5
"""Largest slope of the error for which the position can be told from its measurement."""


class EncoderErrorOptions(EffectOptions):
    """Signal period of the encoder, and its error."""

    period_m: float = Field(
        ge=1e-12, allow_inf_nan=False, description="signal period: grating period or a part of it"
    )
    sin_m: float = Field(default=0.0, allow_inf_nan=False, description="amplitude of the sine")
    cos_m: float = Field(default=0.0, allow_inf_nan=False, description="amplitude of the cosine")

    @model_validator(mode="after")
    def _can_be_inverted(self) -> Self:
        amplitude = math.hypot(self.sin_m, self.cos_m)
        most = STEEPEST * self.period_m / (2.0 * math.pi)
        if amplitude > most:
            raise ValueError(f"an amplitude of {amplitude:g} m; at most {most:g} m can be undone")
        return self


class EncoderError(Effect):
    """The encoder shows y = x + S sin(2 pi x/p) + C cos(2 pi x/p)."""

    name = "encoder_error"
    kind = "measurement"
    title = "Interpolation error of the encoder"
    formula = "y = x + S sin(2 pi x/p) + C cos(2 pi x/p)"
    compensated = "correction of the measured position"
    identified = "linear in sine and cosine of the raw position; the period p by a scan"
    visible_in = (
        "slow constant speeds, at which a signal period takes many samples, at two different "
        "speeds: its apparent force grows with the square of the speed, a real one does not"
    )
    amplitudes = ("sin_m", "cos_m")
    revealed_by = ("two_speeds",)
    Options = EncoderErrorOptions
    options: EncoderErrorOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: the error is an option, since it acts before the force balance."""
        return ()

    @property
    def constants(self) -> tuple[float, ...]:
        """Wave number [rad/m] and both amplitudes [m]."""
        return 2.0 * math.pi / self.options.period_m, self.options.sin_m, self.options.cos_m

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
        """Return the periods that encoders of this resolution have; no error yet."""
        count = spans.resolution_m
        periods = {*(n * count for n in COUNTS), *PERIODS_M}
        return [
            cls(EncoderErrorOptions(period_m=period))
            for period in sorted(periods)
            if max(1e-12, 3.9 * count) <= period <= spans.travel_m / 10.0
        ]

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
        error = c[1] * sine + c[2] * cosine
        steepness = c[0] * (c[1] * cosine - c[2] * sine)
        x -= (x + error - y) / (1.0 + steepness)
    return x


@njit(inline="always")
def column(j: int, x: float, c: tuple[float, ...]) -> float:
    """Return what the encoder shows too much at x for an amplitude of one."""
    return math.sin(c[0] * x) if j == 0 else math.cos(c[0] * x)
