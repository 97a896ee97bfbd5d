"""Pictures that every diagnosis has: the residual over time, and its spectra."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorctl.identify.columns.measured import Array
from motorctl.identify.diagnose.report.pictures.axis_signals import AxisSignals
from motorctl.identify.diagnose.report.pictures.panels import (
    AFTER,
    BEFORE,
    MARK,
    NOISE,
    draw_broken,
    figure_in_file,
    figure_of,
    force_scale,
    legend_above,
    limits,
    span,
    zero_line,
)
from motorctl.identify.diagnose.report.pictures.statistics import position_noise, position_spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WAVES_A_TRAVEL = 400.0
"""Highest wave number drawn, in waves over the travel. Larger crowds the picture, smaller cuts fine
pitches off. Chosen by hand."""
LEAST_WAVELENGTH_STEPS = 4.0
"""The shortest wavelength drawn, in ways that the axis makes between two rows: 2 would be Nyquist's
limit, and twice that is room for faster rows. Smaller shows aliases, larger cuts off. Arithmetic,
the room chosen by hand."""
SHOWN_PART = 0.15
"""Waves are drawn as far as one reaches this part of the highest amplitude. Larger cuts weak waves
off, smaller draws a long empty tail. Chosen by hand."""
FEWEST_WAVES = 30.0
"""Waves are drawn at least up to this many a travel. More draws an empty tail, fewer hides common
pitches. Chosen by hand."""
LOWEST_AMPLITUDE = 0.005
"""Lowest amplitude drawn over position, as a part of the largest [1]. Larger hides noise, smaller
draws an empty decade. Chosen by hand."""
HEADROOM = 1.6
"""Height of the scale over the highest bar. Larger wastes room, smaller lets marks touch the frame.
Chosen by hand."""
DECADE = 4.0
"""A logarithmic scale reaches at least so many times below and above its middle. Smaller makes a
flat spectrum look rough, larger flattens all. Chosen by hand."""
FAR_RIGHT = 0.85
"""Part of the panel's width from which a label stands left of its mark. Larger lets labels leave
the frame. Chosen by hand."""
FLOOR = 1e-3
"""Lowest value drawn, as a part of the highest line. Larger hides weak lines, smaller stretches the
scale over nothing. Chosen by hand."""


def plot_residual(axis: AxisSignals, path: Path) -> Path:
    """Draw what the models leave of the command over time, and the motion below it."""
    traces = axis.traces
    both = bool(axis.effect_names)
    with figure_in_file(path, ["a", "b", "x"] if both else ["b", "x"], 2.0) as panels:
        if both:
            draw_broken(panels["a"], traces.time_s, traces.residual_before, BEFORE, "")
            panels["a"].set_title(_rms("declared model alone", traces.residual_before, axis))
            draw_broken(panels["b"], traces.time_s, traces.residual_after, AFTER, "")
            name = f"with {axis.effect_names}"
            panels["b"].set_title(_rms(name, traces.residual_after, axis))
        else:
            draw_broken(panels["b"], traces.time_s, traces.residual_before, BEFORE, "")
            panels["b"].set_title(_rms("declared model", traces.residual_before, axis))
        for key in ("a", "b") if both else ("b",):
            panel = panels[key]
            limits(panel, traces.residual_before, traces.residual_after)
            panel.set_ylabel(f"residual [{axis.command_unit}]")
            zero_line(panel)
            force_scale(panel, axis)
        scale, unit = axis.place
        draw_broken(panels["x"], traces.time_s, traces.position * scale, "black", "")
        panels["x"].set_ylabel(f"position [{unit}]")
        panels["x"].set_xlabel("time [s]" + _shade_held_out(panels, axis))
        for panel in panels.values():
            span(panel, float(traces.time_s[0]), float(traces.time_s[-1]))
        figure_of(panels["x"]).align_ylabels(list(panels.values()))
    return path


def plot_spectra(axis: AxisSignals, path: Path) -> Path:
    """Draw the residual's spectrum over time, with the noise model, and over position."""
    with figure_in_file(path, ["t", "x"], 2.9) as panels:
        _over_time(panels["t"], axis)
        wave, before, after = position_spectra(axis)
        draw_position_spectrum(panels["x"], axis, wave, before, after)
        _noise_line(panels["x"], axis)
        span(panels["x"], 0.0, _shown_wave(axis, wave, before))
        panels["x"].set_title("over position")
    return path


def position_spectra(axis: AxisSignals, highest: float | None = None) -> tuple[Array, Array, Array]:
    """Return wave numbers, and the amplitudes of the residuals before and after."""
    traces = axis.traces
    highest = highest or _highest_wave(axis)
    wave, before = position_spectrum(traces.position, traces.residual_before, highest)
    return wave, before, position_spectrum(traces.position, traces.residual_after, highest)[1]


def draw_position_spectrum(
    panel: Axes, axis: AxisSignals, wave: Array, before: Array, after: Array
) -> None:
    """Draw amplitudes over wave number, before and after."""
    unit = axis.diagnosis.data.position_unit
    panel.plot(wave, before, color=BEFORE, lw=1.0, label="declared model alone")
    if axis.effect_names:
        panel.plot(wave, after, color=AFTER, lw=1.0, label=f"with {axis.effect_names}")
    span(panel, 0.0, float(wave[-1]) if len(wave) else 1.0)
    highest = float(np.max(before, initial=0.0)) or 1.0
    panel.set_yscale("log")  # or the result and the noise would lie on zero
    panel.set_ylim(LOWEST_AMPLITUDE * highest, HEADROOM * highest)
    panel.set_xlabel(f"wave number [cycles/{unit}]")
    panel.set_ylabel(f"amplitude [{axis.command_unit}]")
    force_scale(panel, axis)


def mark_frequency(panel: Axes, at: float, words: str, *, top: bool = True) -> None:
    """Mark a place on a horizontal scale, with its name at the top or the bottom."""
    panel.axvline(at, color=MARK, lw=1.0, ls=(0, (4, 3)), zorder=0.8)
    # towards the middle of the panel where it would leave it at the right
    place = panel.transData.transform((at, panel.get_ylim()[1]))
    left = bool(panel.transAxes.inverted().transform(place)[0] > FAR_RIGHT)
    name = panel.annotate(
        words,
        (at, 1.0 if top else 0.0),
        (-3 if left else 3, -3 if top else 3),
        ha="right" if left else "left",
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        va="top" if top else "bottom",
        color=MARK,
        fontsize=9,
        annotation_clip=True,
    )
    name.set_in_layout(False)  # a mark outside the limits must not squeeze the panels


def _over_time(panel: Axes, axis: AxisSignals) -> None:
    traces, unit = axis.traces, axis.command_unit
    shown = traces.frequency_hz > 0.0
    f = traces.frequency_hz[shown]
    densities = [
        np.sqrt(np.maximum(power[shown], 0.0))
        for power in (traces.spectrum_before, traces.spectrum_after, traces.spectrum_noise)
    ]
    panel.loglog(f, densities[0], color=BEFORE, lw=1.0, label="declared model alone")
    if axis.effect_names:
        panel.loglog(f, densities[1], color=AFTER, lw=1.0, label=f"with {axis.effect_names}")
    panel.loglog(f, densities[2], color=NOISE, lw=1.3, ls="--", label="noise expected")
    highest = max((float(np.max(d, initial=0.0)) for d in densities), default=0.0)
    inside = f <= traces.band_hz
    lowest = min(float(np.min(d[inside & (d > 0.0)], initial=highest)) for d in densities)
    if highest > 0.0:
        top, bottom = 2.0 * highest, max(0.5 * lowest, FLOOR * highest)
        middle = np.sqrt(top * bottom)
        panel.set_ylim(min(bottom, middle / DECADE), max(top, middle * DECADE))
    if len(f):
        span(panel, float(f[0]), max(float(f[-1]), traces.band_hz))
    if len(f) and f[-1] > traces.band_hz:
        panel.axvspan(traces.band_hz, float(f[-1]), color="black", alpha=0.06, lw=0)
    panel.set_title("over time")
    panel.set_xlabel(f"frequency [Hz]   (fitted up to {traces.band_hz:.4g} Hz)")
    panel.set_ylabel(f"residual [{unit}/√Hz]")
    panel.grid(visible=True, which="minor", alpha=0.12)
    for found in axis.diagnosis.effects:
        if "line_over_time" in found.effect.groups:
            for frequency in found.effect.lines:
                mark_frequency(panel, frequency, f"{frequency:.4g} Hz")
    force_scale(panel, axis, "/√Hz")
    legend_above(panel)


def _noise_line(panel: Axes, axis: AxisSignals) -> None:
    """Draw what noise alone does not exceed."""
    traces = axis.traces
    rate_hz = 1.0 / float(np.median(np.diff(traces.time_s)))
    # rows closer than half a period of the band's end repeat their neighbours' noise
    repeated = max(0.5 * rate_hz / traces.band_hz, 1.0)
    rms = traces.noise_floor_rms * np.sqrt(repeated)
    level = position_noise(traces.position, rms, _highest_wave(axis))
    if np.isfinite(level) and level > 0.0:
        label = "99 % of noise is below"
        panel.axhline(level, color=NOISE, lw=1.3, ls="--", label=label)
        bottom, top = panel.get_ylim()
        panel.set_ylim(min(bottom, 0.5 * level), max(top, 2.0 * level))
        legend_above(panel)


def _highest_wave(axis: AxisSignals) -> float:
    """Return the shortest waves that the rows can show at the usual speed, as a wave number."""
    traces = axis.traces
    travel = float(np.ptp(traces.position))
    if travel <= 0.0:
        return 1.0
    period_s = float(np.median(np.diff(traces.time_s)))
    speed = float(np.median(np.abs(traces.velocity)))
    least = LEAST_WAVELENGTH_STEPS * speed * period_s
    highest = WAVES_A_TRAVEL / travel
    return min(highest, 1.0 / least) if least > 0.0 else highest


def _shown_wave(axis: AxisSignals, wave: Array, amplitude: Array) -> float:
    travel = float(np.ptp(axis.traces.position))
    if travel <= 0.0:
        return 1.0
    strong = np.flatnonzero(amplitude > SHOWN_PART * np.max(amplitude))
    return float(min(max(1.4 * wave[strong[-1]], FEWEST_WAVES / travel), wave[-1]))


def _rms(words: str, residual: Array, axis: AxisSignals) -> str:
    known = residual[np.isfinite(residual)]
    rms = float(np.sqrt(np.mean(known**2))) if len(known) else 0.0
    # the report's errors are those of the whole band, weighted by its noise
    told = f"{words}, below {axis.traces.band_hz:.3g} Hz: rms {rms:.3g} {axis.command_unit}"
    if axis.force_per_command:
        told += f" = {abs(axis.force_per_command) * rms:.3g} {axis.force_unit}"
    return told


def _shade_held_out(panels: dict[str, Axes], axis: AxisSignals) -> str:
    """Shade the rows that were not fitted, and return the caption's words for that."""
    time_s, held = axis.traces.time_s, axis.traces.held_out
    if not held.any() or held.all():
        return ""
    edges = np.flatnonzero(np.diff(held.astype(np.int8))) + 1
    for first, last in zip([0, *edges], [*edges, len(held)], strict=True):
        if held[first]:
            for panel in panels.values():
                panel.axvspan(
                    float(time_s[first]), float(time_s[last - 1]), color="black", alpha=0.06, lw=0
                )
    return "   (shaded: held out from the fit)"
