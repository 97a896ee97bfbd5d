"""A part of the moving mass that hangs on a spring: load on a beam, cable chain, tool."""

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

GRID = ((0.3, 6), (0.1, 12), (0.03, 30), (0.01, 80))
"""Damping ratios that are tried, each with its frequencies a decade: a sharper resonance needs a
finer search. More takes time, fewer step over resonances. Chosen by hand; arithmetic: neighbours
are 0.8 to 1.5 times the width of a resonance, 2 zeta, apart."""
SLOWEST_HZ = 2.0
"""Lowest frequency that is tried [Hz]. Larger misses heavy loads on soft springs, smaller takes the
drift of small forces for one. Chosen by hand."""
SHARP, SHARP_FROM_HZ = 0.02, 8.0
"""Resonances sharper than this are tried from this frequency on [Hz]: slower ones ring too few
times in a recording to be missed by the broader forms. More takes time. Chosen by hand."""
SLOW_DAMPING = (0.03, 0.01, 0.003)
"""Damping ratios of slower resonances, which are tried where something swings: a pendulum that
carries the axis, or hangs on it. More take time, fewer miss some. Chosen by hand: each is three
times the next."""
SLOW_AROUND = (0.8, 1.05)
"""Parts of the frequency that was seen between which such a resonance is sought: with the carriage
held still it is slower than it rings. Further apart takes time, closer misses heavy parts. Chosen
by hand; arithmetic: at 0.8 the part has a third of the inertia."""
SLOW_BROADEST = 0.06
"""Damping ratio from which a slow resonance is refuted. Larger takes drift for one, smaller refutes
parts that swing with friction. Chosen by hand: twice the largest that is tried."""
SLOW_APART = 1.5
"""Distance of neighbouring frequencies of slow resonances, in their widths. Larger steps over some,
smaller takes time. Chosen by hand."""
LONG_ENOUGH = 6.0
"""Periods of a slow resonance in the recording, at least. Larger misses slow swings, smaller takes
the beginning of a motion for one. Chosen by hand."""
BRAKED_GRID = (0.1, 12)
"""Damping ratio of parts that are tried with friction of their own, and their frequencies a decade.
More takes time, fewer start the refinement too far away. Chosen by hand: of `GRID`."""
BRAKED = (0.15, 0.5)
"""Decelerations by that friction that are tried, as parts of the top acceleration. More take time;
with none, parts that stick for half of the time are missed. Chosen by hand."""
STRETCHED = 6.0
"""Counts of the encoder by which friction stretches the spring at least, before the part slides.
Smaller takes bristles for it, larger misses stiff springs. Chosen by hand."""
UNSEEN_PART = 0.5
"""The same in ways that every reversal makes before the band shows it. Smaller takes friction that
turns over for a part, larger misses stiff springs. Chosen by hand on simulated axes of other
authors: a spring has 0.87, dry friction 0.3."""
STRETCHED_MOST = 0.125
"""Part of the travel by which friction stretches the spring at most. Larger takes a spring to the
ground for a part that sticks, smaller misses soft springs. Chosen by hand: at a half nothing ever
slides."""
SLIGHT = 0.02
"""Friction of the part, as a part of the top acceleration, below which it is as good as none.
Larger lets bristles pass for a part, smaller refutes free parts for a trace of friction. Chosen by
hand."""
BEYOND = 1.5
"""Factor by which the frequency may leave those that are tried. Larger lets it turn into something
else, smaller misses those at the ends. Chosen by hand: as for all options."""
FIRST_FRICTION = 0.1
"""First step by which the part's own friction is refined, as a part of the top acceleration. Larger
steps over small friction, smaller takes time. Chosen by hand."""
MOST_FRICTION = 1.0
"""Largest friction of the part that is tried, as a part of the top acceleration. Larger lets it
stick for most of the time, where it is a spring to the ground and takes the inertia away; smaller
misses guides that run dry. Chosen by hand."""
HIGHEST_HZ = 1e6
"""Highest frequency that the option takes and that is tried [Hz]. Larger allows what no machine
shows, smaller refuses small and stiff parts. Chosen by hand."""
LARGEST_PART = 0.9
"""Part of the inertia that may hang on the spring, either sign. Nearer to 1 the carriage itself
weighs nothing and the two forms of the mode run apart without end, smaller cuts heavy loads off.
Chosen by hand."""


class FlexibleOptions(EffectOptions):
    """The resonance of the part with the carriage held still."""

    frequency_hz: float = Field(
        ge=1e-6, le=HIGHEST_HZ, description="of the part on its spring, carriage held still"
    )
    damping_ratio: float = Field(default=0.01, ge=0.0, le=0.99, description="of this oscillation")
    friction_m_s2: float = Field(
        default=0.0,
        ge=0.0,
        allow_inf_nan=False,
        description="d: deceleration by which the part's own dry friction brakes it",
    )


class FlexibleMode(Effect):
    """-m s^2/(s^2 + 2 zeta omega s + omega^2) a, with m the part on the spring.

    Inertia counts the part as if it were fixed; this column is what the spring adds. With the
    part's offset r: r'' + 2 zeta omega r' + omega^2 r = a, so that the column is -r''. A part that
    slides on a guide of its own is braked by d besides, and may stick; the column is then the
    spring's push less a, and Coulomb friction counts the carriage's alone.
    """

    name = "flexible_mode"
    kind = "state"
    memory = 3
    title = "Flexible mode"
    formula = "-m * [s^2/(s^2 + 2 zeta omega s + omega^2)] (a + d), d of a part that rubs"
    compensated = "feedforward with the oscillation advanced along the desired acceleration"
    identified = "linear in the filtered acceleration; frequency, damping and friction by a scan"
    visible_in = (
        "high jerk: starts and stops shorter than a period of the oscillation, rests after them, "
        "sampled several times as fast as the oscillation"
    )
    groups = frozenset({"line_over_time", "resonance"})
    scan_shows_part = True
    refuted_at_end = MappingProxyType({"damping_ratio": "either", "frequency_hz": "either"})
    may_lack = ("friction_m_s2",)
    revealed_by = ("fast_reversals",)
    Options = FlexibleOptions
    options: FlexibleOptions
    lever: float = 1.0
    """Offset of the part over the memory's; another on the acceleration of a rigid machine."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """m: the inertia of the part, contained in theta1."""
        return (Parameter("inertia", "m", "V*s^2/m", 0.0, 1e3, 0.0, 0.1),)

    @property
    def constants(self) -> tuple[float, ...]:
        """Omega, zeta omega, damped frequency [rad/s], its reciprocal; friction [m/s^2], lever."""
        omega, zeta = 2.0 * math.pi * self.options.frequency_hz, self.options.damping_ratio
        damped = omega * math.sqrt(1.0 - zeta * zeta)
        return omega, zeta * omega, damped, 1.0 / damped, self.options.friction_m_s2, self.lever

    @property
    def lines(self) -> tuple[float, ...]:
        """The resonance [Hz]."""
        return (self.options.frequency_hz,)

    @property
    def picture(self) -> Picture:
        """Response from force to acceleration."""
        return Picture(
            "force_response",
            "Gain and phase from force to acceleration.",
            scale=self.options.frequency_hz,
            damping_ratio=self.options.damping_ratio,
        )

    def over_acceleration(self, w: Array) -> NDArray[np.complex128]:
        """Return -s^2/(s^2 + 2 zeta omega s + omega^2) at s = j w."""
        omega, decay = self.constants[:2]
        behind: NDArray[np.complex128] = omega * omega - w * w + 2j * decay * w
        result: NDArray[np.complex128] = (w * w).astype(np.complex128) / behind
        return result

    def on_own_acceleration(self, theta: Sequence[float]) -> tuple[Effect, tuple[float, ...]]:
        """Return the mode itself, theta being the part's share of the inertia.

        With r the rigid machine's acceleration, a = r/(1 - f G) = r + f/(1 - f) G' r, where G' has
        its frequency and damping 1/sqrt(1 - f) times those of
        G = s^2/(s^2 + 2 zeta omega s + omega^2).
        """
        share = theta[0]
        f = share / (1.0 + share) if share > -LARGEST_PART else 0.0
        f = min(max(f, -LARGEST_PART), LARGEST_PART)
        return self._shifted(math.sqrt(1.0 - f)), (f,)

    def on_rigid_acceleration(self, theta: Sequence[float]) -> tuple[Effect, tuple[float, ...]]:
        """Return the mode as it acts on what the machine would do if it were rigid.

        The reverse of `on_own_acceleration`: a = r/(1 - f G) = r + f/(1 - f) G' r.
        """
        f = min(max(theta[0], -LARGEST_PART), LARGEST_PART)
        rigid = self._shifted(1.0 / math.sqrt(1.0 - f))
        rigid.lever = 1.0 / (1.0 - f)
        return rigid, (f / (1.0 - f),)

    def _shifted(self, by: float) -> FlexibleMode:
        shifted = self.with_options(
            frequency_hz=self.options.frequency_hz * by,
            damping_ratio=min(self.options.damping_ratio * by, 0.99),
            friction_m_s2=self.options.friction_m_s2 / (by * by),
        )
        assert isinstance(shifted, FlexibleMode)
        return shifted

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return frequencies up to the band's, broad resonances first, then those with friction."""
        if not (spans.period_s > 0.0 and spans.duration_s > 0.0):
            return ()
        free = [
            cls(FlexibleOptions(frequency_hz=frequency, damping_ratio=zeta))
            for zeta, per_decade in GRID
            for frequency in log_grid(*_tried_hz(zeta, spans), per_decade)
        ]
        zeta, per_decade = BRAKED_GRID
        braked = [
            FlexibleOptions(frequency_hz=frequency, damping_ratio=zeta, friction_m_s2=friction)
            for friction in (part * spans.acceleration_m_s2 for part in BRAKED)
            for frequency in log_grid(*_tried_hz(zeta, spans), per_decade)
            if _slides_at(frequency, friction, spans)
        ]
        return [*free, *(cls(options) for options in braked)]

    @classmethod
    def ringing_at(cls, line_hz: float, spans: Spans) -> Sequence[Effect]:
        """Return sharp resonances about a line below the frequencies of `trials`."""
        if line_hz >= SLOWEST_HZ or line_hz * spans.duration_s < LONG_ENOUGH:
            return ()
        low, high = (part * line_hz for part in SLOW_AROUND)
        forms = []
        for zeta in SLOW_DAMPING:
            apart = 1.0 + 2.0 * SLOW_APART * zeta
            per_decade = math.ceil(1.0 / math.log10(apart))
            forms += [
                cls(FlexibleOptions(frequency_hz=frequency, damping_ratio=zeta))
                for frequency in log_grid(low, high, per_decade)
            ]
        return forms

    def ranges(self, spans: Spans) -> Mapping[str, tuple[float, float]]:
        """Return the ranges of friction and frequency, and of a slow resonance that of its line."""
        frequency, friction = self.options.frequency_hz, self.options.friction_m_s2
        braked = {"friction_m_s2": (0.0, MOST_FRICTION * spans.acceleration_m_s2)}
        if friction > SLIGHT * spans.acceleration_m_s2 and spans.duration_s > 0.0:
            low, high = _tried_hz(self.options.damping_ratio, spans)
            softest, stiffest = _sliding_hz(friction, spans)
            braked["frequency_hz"] = max(low / BEYOND, softest), min(high * BEYOND, stiffest)
        if frequency >= SLOWEST_HZ or self.options.damping_ratio > SLOW_BROADEST:
            return braked
        down, _ = SLOW_AROUND
        return braked | {
            "frequency_hz": (down * frequency, frequency / down),
            "damping_ratio": (-SLOW_BROADEST, SLOW_BROADEST),  # a pendulum may have next to none
        }

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine frequency and damping, and friction where there is motion and no mere response."""
        zeta = self.options.damping_ratio
        per_decade = next((n for width, n in GRID if zeta >= width), GRID[-1][1])
        frequency = log_step(self.options.frequency_hz, per_decade)
        steps = {"frequency_hz": frequency, "damping_ratio": max(0.5 * zeta, 1e-3)}
        first = FIRST_FRICTION * spans.acceleration_m_s2
        rubs = self.options.friction_m_s2 > 0.0
        if rubs or _slides_at(self.options.frequency_hz, first, spans):
            steps["friction_m_s2"] = max(0.5 * self.options.friction_m_s2, first)
        return steps


def _tried_hz(zeta: float, spans: Spans) -> tuple[float, float]:
    """Return the lowest and the highest frequency that is tried [Hz]."""
    high = min(1.2 * spans.band_hz, 0.45 / spans.period_s, HIGHEST_HZ)
    slowest = SHARP_FROM_HZ if zeta < SHARP else SLOWEST_HZ
    return max(min(slowest, spans.band_hz / 10.0), 4.0 / spans.duration_s, 1e-6), high


def _sliding_hz(friction_m_s2: float, spans: Spans) -> tuple[float, float]:
    """Return between what frequencies a part with friction slides, and shows it [Hz].

    A stiffer spring is hardly stretched before the part slides: these are bristles of friction, and
    no part of the mass. A softer one holds the carriage, for the part sticks all along.
    """
    unseen = max(STRETCHED * spans.resolution_m, UNSEEN_PART * spans.unseen_way_m, 1e-12)
    most = max(STRETCHED_MOST * spans.travel_m, unseen)
    softest, stiffest = (math.sqrt(friction_m_s2 / way) / (2.0 * math.pi) for way in (most, unseen))
    return softest, stiffest


def _slides_at(frequency_hz: float, friction_m_s2: float, spans: Spans) -> bool:
    softest, stiffest = _sliding_hz(friction_m_s2, spans)
    return softest < frequency_hz < stiffest


@njit(inline="always")
def column(
    j: int, x: float, v: float, a: float, vs: float, t: float, w: Array, c: tuple[float, ...]
) -> float:
    """Return the spring's push less a [m/s^2]; w is (r, r', last acceleration)."""
    return float(2.0 * c[1] * w[1] + c[0] * c[0] * w[0] - a)


@njit(error_model="numpy")
def advance(
    w: Array, x: float, v: float, a: float, dt: float, others: Array, c: tuple[float, ...]
) -> None:
    """Advance the oscillation exactly, with the acceleration going straight from last to this.

    Exact for any step, so stable at any sample rate (first-order hold), while the part slides one
    way. Where friction can stop it within the step, it has stopped at the end.
    """
    omega, decay, damped = c[0], c[1], c[2]
    if dt > 0.0:
        # what a ramp of acceleration settles to: r = start + rate t
        rate = (a - w[2]) / (dt * omega * omega)
        start = (w[2] - 2.0 * decay * rate) / (omega * omega)
        r, dr = w[0] - start, w[1] - rate
        shrunk = math.exp(-decay * dt)
        cosine, sine = shrunk * math.cos(damped * dt), shrunk * math.sin(damped * dt) * c[3]
        w[0] = r * cosine + (dr + decay * r) * sine + start + rate * dt
        w[1] = dr * cosine - (omega * omega * r + decay * dr) * sine + rate
        if c[4] > 0.0:
            # what as much friction all along the step would have made of it; less where it sticks
            kick = sine * c[4]
            slides = v - c[5] * w[1]
            stops = c[5] * kick
            part = math.copysign(1.0, slides)
            if abs(slides) < stops:
                part = slides / stops
            w[0] += part * c[4] * (1.0 - cosine - decay * sine) / (omega * omega)
            w[1] += part * kick
    w[2] = a
