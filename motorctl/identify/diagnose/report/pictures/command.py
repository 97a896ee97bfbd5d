"""Pictures of how the command becomes force: lag, delay, resonance, what does not act."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.measured import Array
from motorctl.identify.diagnose.report.pictures.axis_signals import AxisSignals
from motorctl.identify.diagnose.report.pictures.frequency_response import (
    Response,
    bridge_rests,
    frequency_response,
)
from motorctl.identify.diagnose.report.pictures.panels import (
    AFTER,
    BEFORE,
    DATA,
    NOISE,
    draw_bins,
    figure_in_file,
    figure_of,
    force_scale,
    legend_above,
    span,
    zero_line,
)
from motorctl.identify.diagnose.report.pictures.residual import mark_frequency
from motorctl.identify.diagnose.report.pictures.statistics import binned
from motorctl.identify.diagnose.result import FoundEffect

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVE_POINTS = 600
"""Points of a drawn curve. Fewer show corners, more make larger files. Chosen by hand."""
UNSURE = 0.35
"""Standard error over gain beyond which a point of the response is not drawn. Larger draws noise,
smaller leaves gaps. Chosen by hand."""
WIDTHS = 4.0
"""Widths of the effect, such as half a dead zone, that are drawn to each side. More hides it, fewer
does not show that the gain returns. Chosen by hand."""

BEYOND = 0.005
"""Part of the largest command that has to be missing to be beyond a limit. Larger hides what is
hardly beyond, smaller marks noise. Chosen by hand."""
FAR = 4.0
"""Commands at which the line of the limit is looked at, in multiples of the largest. Any other
would do that is beyond the limit everywhere. Arithmetic."""
MOST_POINTS = 4000
"""Points of a cloud, at most. More make larger files, fewer thin it out. Chosen by hand."""


def plot_lag(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw gain and phase from the command to the part of it that acts, against frequency."""
    traces = axis.traces
    acting = traces.command - axis.partial(found.name)
    seen = _response(axis, traces.command, acting)
    f = _frequencies(seen, traces.band_hz)
    s = 2j * np.pi * f
    lag, delay = found.effect.lag_s, found.effect.delay_s
    model: NDArray[np.complex128] = np.exp(-s * delay) / (1.0 + s * lag)
    _bode(axis, path, seen, f, model, None, "from the command to what of it acts")
    return path


def plot_flexible_mode(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw gain and phase from force to acceleration, a rigid mass being 1, against frequency.

    With part m of the inertia M on a spring, G(s) = s^2/(s^2 + 2 zeta w s + w^2), the force is
    (M - m G(s)) a, so the gain is M / (M - m G(s)).
    """
    traces = axis.traces
    inertia = axis.coefficient("acceleration")
    force = inertia * traces.acceleration + axis.partial(found.name)
    seen = _response(axis, force, inertia * traces.acceleration, bins=60)
    f = _frequencies(seen, traces.band_hz)
    resonance, damping = found.effect.picture.scale, found.effect.picture.damping_ratio
    ratio = (f / resonance).astype(np.complex128)
    spring = -(ratio**2) / (1.0 - ratio**2 + 2j * damping * ratio)
    model = inertia / (inertia - float(np.sum(found.theta)) * spring)
    _bode(axis, path, seen, f, model, resonance, "from force to acceleration (0 dB: rigid mass)")
    return path


def plot_acting_command(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw the command that acts against the command that is given, over the effect's width."""
    traces, unit = axis.traces, axis.command_unit
    width = found.effect.picture.scale
    inside = np.abs(traces.command) <= WIDTHS * width
    acting = (traces.command - axis.partial(found.name))[inside]
    edges = np.linspace(-WIDTHS * width, WIDTHS * width, 61)
    with figure_in_file(path, ["a"], 4.2) as panels:
        panel = panels["a"]
        draw_bins(panel, binned(traces.command[inside], acting, edges), 1.0)
        u = np.linspace(edges[0], edges[-1], CURVE_POINTS)
        curve = u - axis.force_over(found, command=u)
        panel.plot(u, curve, color=AFTER, lw=1.4, label="model")
        panel.plot(u, u, color=BEFORE, lw=1.2, ls="--", label="command that is given")
        panel.set_ylim(1.2 * edges[0], 1.2 * edges[-1])
        span(panel, edges[0], edges[-1])
        for at in (-width, width):
            panel.axvline(at, color="black", lw=0.8, ls=(0, (4, 3)), zorder=0.5)
        panel.set_xlabel(f"command [{unit}]")
        panel.set_ylabel(f"command that acts [{unit}]")
        force_scale(panel, axis)
        legend_above(panel)
    return path


def plot_limit(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw commands against velocity, and the line beyond which they do not act."""
    traces, unit = axis.traces, axis.command_unit
    scale, length = axis.place
    lost = axis.partial(found.name)
    most = float(np.max(np.abs(traces.command), initial=0.0))
    if not most > 0.0:
        most = 1.0
    beyond = np.abs(lost) > BEYOND * most
    fastest = float(np.max(np.abs(traces.velocity), initial=0.0))
    v = np.linspace(-fastest, fastest, CURVE_POINTS)
    with figure_in_file(path, ["a"], 4.2) as panels:
        panel = panels["a"]
        for rows, values, colour, size, label in (
            (~beyond, traces.command, DATA, 2.0, "command"),
            (beyond, traces.command, BEFORE, 3.0, "command beyond the limit"),
            (beyond, traces.command - lost, NOISE, 3.0, "what of it acts"),
        ):
            shown = _thinned(np.flatnonzero(rows))
            panel.plot(
                traces.velocity[shown] * scale, values[shown], ".", color=colour, ms=size,
                label=label,
            )  # fmt: skip
        for side in (-1.0, 1.0):
            given = np.full(len(v), side * FAR * most)
            limit = given - axis.force_over(found, velocity=v, command=given)
            line = "model" if side > 0.0 else None
            panel.plot(v * scale, limit, color=AFTER, lw=1.4, label=line)
        panel.set_ylim(-1.15 * most, 1.15 * most)
        zero_line(panel)
        panel.set_xlabel(f"velocity [{length}/s]")
        panel.set_ylabel(f"command [{unit}]")
        force_scale(panel, axis)
        legend_above(panel)
    return path


def _thinned(rows: NDArray[np.intp]) -> NDArray[np.intp]:
    return rows[:: max(1, len(rows) // MOST_POINTS)]


def _response(axis: AxisSignals, source: Array, answer: Array, bins: int = 24) -> Response:
    traces = axis.traces
    instrument = axis.reference_acceleration
    driving = source if instrument is None else instrument
    time_s, signals = bridge_rests(traces.time_s, traces.position, [source, answer, driving])
    return frequency_response(time_s, signals[0], signals[1], traces.band_hz, signals[2], bins)


def _bode(
    axis: AxisSignals,
    path: Path,
    seen: Response,
    f: Array,
    model: NDArray[np.complex128],
    mark_hz: float | None,
    title: str,
) -> None:
    sure = seen.std_error < UNSURE * np.abs(seen.gain)
    size = np.abs(seen.gain[sure])
    relative = seen.std_error[sure] / size
    with figure_in_file(path, ["a", "b"], 2.6) as panels:
        gain, phase = panels["a"], panels["b"]
        decibel = 20.0 / np.log(10.0)
        _points(gain, seen.frequency_hz[sure], 20.0 * np.log10(size), decibel * relative)
        degrees = np.degrees(np.angle(seen.gain[sure]))
        _points(phase, seen.frequency_hz[sure], degrees, np.degrees(relative))
        gain.plot(f, 20.0 * np.log10(np.abs(model)), color=AFTER, lw=1.4, label=_name(axis))
        phase.plot(f, np.degrees(np.unwrap(np.angle(model))), color=AFTER, lw=1.4)
        for panel in (gain, phase):
            panel.axhline(0.0, color=BEFORE, lw=1.2, ls="--", label="declared model alone")
            panel.set_xscale("log")
            span(panel, f[0], f[-1])
            panel.grid(visible=True, which="minor", alpha=0.12)
            if mark_hz is not None:
                mark_frequency(panel, mark_hz, f"{mark_hz:.4g} Hz", top=False)
        gain.set_title(title)
        gain.set_ylabel("gain [dB]")
        phase.set_ylabel("phase [°]")
        phase.set_xlabel("frequency [Hz]   (bars: one standard error)")
        figure_of(gain).align_ylabels([gain, phase])
        legend_above(gain)


def _points(panel: Axes, x: Array, y: Array, error: Array) -> None:
    panel.errorbar(
        x,
        y,
        error,
        fmt="o",
        ms=3.5,
        color="#5c5c5c",
        ecolor="#9a9a9a",
        elinewidth=1.0,
        label="data",
    )


def _frequencies(seen: Response, band_hz: float) -> Array:
    lowest = float(seen.frequency_hz[0]) if len(seen.frequency_hz) else 0.01 * band_hz
    return np.geomspace(min(lowest, 0.5 * band_hz), band_hz, CURVE_POINTS)


def _name(axis: AxisSignals) -> str:
    return f"with {axis.effect_names}"
