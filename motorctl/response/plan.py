"""What an axis is made to do for its frequency response, and what that means, before it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.config.analysis import loop_margins
from motorctl.config.loop_rules import loop_gains, parameter_range
from motorctl.config.machine import Axis
from motorctl.errors import UsageError
from motorctl.loop.excitation import EXCITATION_TICKS, LEAST_FADE_TICKS, Excitation
from motorctl.motion import Move, Moves
from motorctl.response.estimate import LEAST_LINES
from motorctl.response.model import model_response
from motorctl.response.multisine import Multisine, multisine

Array = NDArray[np.float64]

USUAL_SHARE = 0.5
"""Of the largest excitation that is allowed, unless another is asked for. By hand: louder tells
more, and shakes more."""
LOWEST_PER_CROSSOVER = 0.15
"""Where the usual band begins, over the model's crossover. Lower, the loop takes nearly all of the
excitation back, higher, the slope towards the crossover is not seen."""
HIGHEST_PER_NYQUIST = 0.25
"""Where the usual band ends, over the Nyquist frequency. Higher, encoders see nothing."""
LOWEST_HARMONIC = 5
"""Harmonic of the period at which the band begins. More resolves sharper resonances and takes
longer, fewer leave too little room below for von Hann's window."""
WANTED_LINES = 40
"""In the band, at least, where the longest period allows. Fewer miss resonances, more share the
excitation. By hand."""
MEASURED_S, LEAST_PERIODS = 120.0, 16
"""How long the excitation stays [s], and in how many periods at least. Longer lowers what noise
makes of the response by the root, shorter leaves it."""
STROKE_PERIODS = 1.3
"""Periods in a stroke, at least: a window of one, and a quarter before it, in even motion. Fewer
leave no window; more refuse short axes that can be measured. Arithmetic."""
FADE_S = 0.5
"""At least so long it comes, and goes [s]: more than the loop's own time constants. By hand."""
FASTER = 3.0
"""How many times as fast as it is shaken the axis moves: friction that changes its sign hides the
plant. Fewer may let it, more uses the travel up. By hand."""
SLOWEST_SHARE, FASTEST_SHARE = 0.01, 0.2
"""Of the top speed, between which it moves meanwhile. By hand."""
END_SHARE = 0.1
"""Of the travel, left at each end. By hand."""
ERROR_SHARE = 0.5
"""Of the following error's limit, that the model expects of the excitation at most. More may trip
the axis, less allows little."""


@dataclass(frozen=True)
class ResponsePlan:
    """An excitation, and the motion meanwhile."""

    axis: str
    period_s: float
    """Of the axis [s]."""
    waves: Multisine
    excitation: Excitation
    band_hz: tuple[float, float]
    peak_v: float
    share: float
    """The peak, over the axis' largest voltage."""
    motion: Moves | None
    """To and fro at an even speed; None: the axis stands."""
    speed_m_s: float
    shaken_m: float
    """Largest position error that the model expects of the excitation [m]."""
    duration_s: float
    units: AxisUnits = LINEAR

    @property
    def words(self) -> str:
        """What is going to happen, for whoever has to say yes."""
        low, high = self.band_hz
        told = (
            f"axis {self.axis}: {self.peak_v:.3g} V ({self.share:.1%} of max_voltage_v) from "
            f"{low:.3g} to {high:.3g} Hz on {len(self.waves.lines)} lines, for "
            f"{self.duration_s:.0f} s; the model expects it to be shaken by "
            f"{self.units.words(f'{self.shaken_m * 1e6:.3g} µm')} at most"
        )
        if self.motion is None:
            return f"{told}; it holds where it is"
        start, target = self.motion.start_m, self.motion.moves[0].target_m
        return self.units.words(
            f"{told}; meanwhile it moves to and fro between {start:g} and {target:g} m at "
            f"{self.speed_m_s:.3g} m/s"
        )


def plan_response(
    axis: Axis,
    period_s: float,
    *,
    band_hz: tuple[float, float] | None = None,
    amplitude_v: float | None = None,
    periods: int | None = None,
    moving: bool = True,
) -> ResponsePlan:
    """Plan the measurement of an axis' response.

    Parameters
    ----------
    axis, period_s
        The axis, and its period [s].
    band_hz
        Lowest and highest frequency [Hz]; None: around what the model says of the loop.
    amplitude_v
        Peak of the excitation [V]; None: half of what the axis allows.
    periods
        At full size; None: as many as take two minutes.
    moving
        Whether it moves to and fro meanwhile, so that friction does not hide the plant.

    Returns
    -------
    ResponsePlan
        What to do; nothing has moved.

    Raises
    ------
    UsageError
        Where the axis' limits do not allow it.
    """
    band = _band(axis, period_s, band_hz)
    ticks = _ticks(axis, period_s, band)
    limits = axis.limits
    peak_v = USUAL_SHARE * limits.max_excitation_v if amplitude_v is None else amplitude_v
    if peak_v <= 0.0 and amplitude_v is not None:
        raise UsageError(f"--amplitude {amplitude_v:g} V: should be above 0")
    waves = multisine(ticks, period_s, band, peak_v)
    if len(waves.lines) < LEAST_LINES:
        raise UsageError(
            f"--band {band[0]:g},{band[1]:g}: has {len(waves.lines)} lines, "
            f"{2 / (ticks * period_s):.3g} Hz apart; needs {LEAST_LINES}: ask for a wider one"
        )
    lasts_s = ticks * period_s
    fades = max(1, math.ceil(FADE_S / lasts_s), math.ceil(LEAST_FADE_TICKS / ticks))
    count = max(LEAST_PERIODS, math.ceil(MEASURED_S / lasts_s)) if periods is None else periods
    excitation = Excitation(waves.volts, count, fades)
    if problem := excitation.problem(limits, period_s):
        raise UsageError(f"axis {axis.name}: {problem}")
    shaken_m, shaken_m_s = _shaken(axis, period_s, waves)
    most_m = ERROR_SHARE * limits.following_error.minimum_m
    if shaken_m > most_m:
        words = (
            f"axis {axis.name}: {peak_v:.3g} V would shake it by {shaken_m * 1e6:.3g} µm; limit "
            f"{most_m * 1e6:.3g} µm, {ERROR_SHARE:.0%} of limits.following_error.minimum_m: ask "
            f"for --amplitude {peak_v * most_m / shaken_m:.2g} or less, or for a higher band"
        )
        raise UsageError(axis.units.words(words))
    duration_s = excitation.total_ticks * period_s
    slowest, fastest = (s * limits.max_velocity_m_s for s in (SLOWEST_SHARE, FASTEST_SHARE))
    speed = min(max(FASTER * shaken_m_s, slowest), fastest) if moving else 0.0
    return ResponsePlan(
        units=axis.units,
        axis=axis.name,
        period_s=period_s,
        waves=waves,
        excitation=excitation,
        band_hz=band,
        peak_v=peak_v,
        share=peak_v / limits.max_voltage_v,
        motion=_to_and_fro(axis, speed, duration_s, lasts_s) if moving else None,
        speed_m_s=speed,
        shaken_m=shaken_m,
        duration_s=duration_s,
    )


def _band(axis: Axis, period_s: float, asked: tuple[float, float] | None) -> tuple[float, float]:
    nyquist_hz = 0.5 / period_s
    if asked is not None:
        low, high = asked
        least = LOWEST_HARMONIC / (EXCITATION_TICKS * period_s)
        if not (least <= low < high < nyquist_hz):
            raise UsageError(
                f"--band {low:g},{high:g}: should be two frequencies from {least:.2g} Hz, for "
                f"which a period of the excitation has room, to below {nyquist_hz:g} Hz, half of "
                "the rate"
            )
        return low, high
    margins = loop_margins(
        parameter_range(axis.model, axis.estimates, "acceleration")[0],
        parameter_range(axis.model, axis.estimates, "velocity")[0],
        **vars(loop_gains(axis.gains, period_s)),
        period_s=period_s,
        delay_s=axis.adaptation.input_delay_s + axis.model.delay_s,
        lag_s=axis.model.lag_s,
    )
    high = HIGHEST_PER_NYQUIST * nyquist_hz
    crossover_hz = (margins.crossover_rad_s or 0.1 * 2.0 * math.pi * high) / (2.0 * math.pi)
    low = max(LOWEST_PER_CROSSOVER * crossover_hz, LOWEST_HARMONIC / (EXCITATION_TICKS * period_s))
    return min(low, 0.1 * high), high


def _ticks(axis: Axis, period_s: float, band: tuple[float, float]) -> int:
    """Return the ticks of a period; an even number.

    Its fifth harmonic is the lowest frequency, or a higher one where the band would have few lines.
    """
    lasts_s = max(LOWEST_HARMONIC / band[0], 2.0 * WANTED_LINES / (band[1] - band[0]))
    return min(2 * round(lasts_s / period_s / 2.0), EXCITATION_TICKS)


def _shaken(axis: Axis, period_s: float, waves: Multisine) -> tuple[float, float]:
    """Return the largest position error [m] and speed [m/s] that the model expects of it."""
    n = len(waves.volts)
    frequency = np.arange(1, n // 2 + 1) / (n * period_s)
    model = model_response(axis, period_s, frequency[:-1])
    spectrum = np.fft.rfft(waves.volts)
    error, speed = np.zeros_like(spectrum), np.zeros_like(spectrum)
    error[1:-1] = spectrum[1:-1] * model.plant * model.sensitivity
    speed[1:-1] = 2j * np.pi * frequency[:-1] * error[1:-1]
    peaks = (float(np.abs(np.fft.irfft(each, n)).max()) for each in (error, speed))
    return next(peaks), next(peaks)


def _to_and_fro(axis: Axis, speed_m_s: float, duration_s: float, lasts_s: float) -> Moves:
    low, high = axis.limits.travel_m
    left = END_SHARE * (high - low)
    ends = (low + left, high - left)
    stroke_s = (ends[1] - ends[0]) / speed_m_s
    if stroke_s < STROKE_PERIODS * lasts_s:
        raise UsageError(
            f"axis {axis.name}: a stroke of "
            f"{axis.units.words(f'{ends[1] - ends[0]:.3g} m at {speed_m_s:.3g} m/s')} takes "
            f"{stroke_s:.3g} s, and a period of the excitation {lasts_s:.3g} s: needs "
            f"{STROKE_PERIODS:g} in a stroke; ask for a --band that begins higher, for less "
            "--amplitude, which is slower, or for --standing"
        )
    strokes = max(1, math.ceil(duration_s / stroke_s))
    stop, limits = axis.limits.stop, axis.limits
    move = {
        "max_velocity_m_s": speed_m_s,
        "max_acceleration_m_s2": min(stop.acceleration_m_s2, limits.max_acceleration_m_s2),
        "max_jerk_m_s3": min(stop.jerk_m_s3, limits.max_jerk_m_s3),
    }
    moves = tuple(Move(target_m=ends[(k + 1) % 2], **move) for k in range(strokes))
    return Moves(name="response", axis=axis.name, start_m=ends[0], moves=moves)
