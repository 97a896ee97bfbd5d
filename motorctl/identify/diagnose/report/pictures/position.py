"""Pictures of forces that depend on position: cogging, springs, ripple, friction by place."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorctl.identify.columns.measured import Array
from motorctl.identify.diagnose.report.pictures.axis_signals import AxisSignals
from motorctl.identify.diagnose.report.pictures.panels import (
    AFTER,
    BEFORE,
    draw_bins,
    figure_in_file,
    force_scale,
    legend_above,
    span,
    zero_line,
)
from motorctl.identify.diagnose.report.pictures.residual import (
    draw_position_spectrum,
    mark_frequency,
    position_spectra,
)
from motorctl.identify.diagnose.report.pictures.statistics import binned, even_edges, ratio_in_bins
from motorctl.identify.diagnose.result import FoundEffect
from motorctl.model.columns import error_columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_WAVES = 30
"""Waves drawn side by side: more cannot be seen one by one, so a part of the travel is shown.
Chosen by hand."""
SHOWN_WAVES = 20
"""Waves in that part of the travel. More cannot be told apart, fewer hide that they differ. Chosen
by hand."""
POINTS_A_PERIOD = 24
"""Points of a curve, and bins, in a period. Fewer show corners, more leave bins noisy. Chosen by
hand."""
CURVE_POINTS = 2000
"""Points of a drawn curve over the travel. Fewer show corners, more make larger files. Chosen by
hand."""
SLOW = 0.02
"""Part of the top speed below which friction may not have its level yet; such rows are left out.
Larger loses rows, smaller mixes reversals into the level. Chosen by hand."""
FAST = 0.7
"""Part of the band up to which an error of the encoder is looked for. Nearer to 1 the filter
weakens it, smaller leaves places out. Chosen by hand."""


def plot_cogging(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw a force that repeats along the way: over the way, over one pitch, as a spectrum."""
    traces = axis.traces
    pitch, orders = _pitch(found), _orders(found)
    scale, unit = axis.place
    # what is added to the command works against the force on the carriage
    data = -axis.partial(found.name)
    with figure_in_file(path, ["aa", "bc"], 2.9) as panels:
        low, high = _window(traces.position, pitch, orders)
        inside = (traces.position >= low) & (traces.position <= high)
        count = int(np.ceil((high - low) / pitch * POINTS_A_PERIOD * max(orders)))
        edges = even_edges(traces.position[inside], min(count, 400), 12)
        shown = binned(traces.position[inside], data[inside], edges)
        draw_bins(panels["a"], shown, scale)
        if len(shown.centre):
            low, high = float(shown.centre[0]), float(shown.centre[-1])
        _draw_model(panels["a"], axis, found, traces.position, edges)
        x = np.linspace(low, high, CURVE_POINTS)
        _draw_form(panels["a"], x * scale, -axis.force_over(found, position=x))
        if high - low < np.ptp(traces.position):
            panels["a"].set_title(
                f"part of the travel of {np.ptp(traces.position) * scale:.4g} {unit}"
            )
        panels["a"].set_xlabel(f"position [{unit}]")
        span(panels["a"], low * scale, high * scale)
        legend_above(panels["a"])
        folded = np.mod(traces.position, pitch)
        edges = np.linspace(0.0, pitch, POINTS_A_PERIOD * min(max(orders), 6) + 1)
        draw_bins(panels["b"], binned(folded, data, edges), scale)
        _draw_model(panels["b"], axis, found, folded, edges)
        x = np.linspace(0.0, pitch, 400)
        _draw_form(panels["b"], x * scale, -axis.force_over(found, position=x))
        span(panels["b"], 0.0, pitch * scale)
        panels["b"].set_xlabel(f"position within a pitch of {pitch * scale:.5g} {unit} [{unit}]")
        for key in "ab":
            panels[key].set_ylabel(f"{axis.push} [{axis.command_unit}]")
            zero_line(panels[key])
            force_scale(panels[key], axis)
        _pitch_spectrum(panels["c"], axis, pitch, orders)
    return path


def _draw_model(
    panel: Axes, axis: AxisSignals, found: FoundEffect, places: Array, edges: Array
) -> None:
    """Draw the model as the dots are drawn: through the filter that the data went through."""
    scale, _ = axis.place
    bins = binned(places, -axis.contribution(found.name), edges)
    panel.plot(bins.centre * scale, bins.middle, color=AFTER, lw=1.4, label="model, filtered alike")


def _draw_form(panel: Axes, x: Array, force: Array) -> None:
    """Draw the force itself, which no filter has made smaller."""
    panel.plot(x, force, color=AFTER, lw=0.9, ls=":", label="model")


def plot_force_ripple(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw how the motor's gain depends on the place: over the way, and over one pitch."""
    traces = axis.traces
    pitch, orders = _pitch(found), _orders(found)
    scale, unit = axis.place
    partial, command = axis.partial(found.name), traces.command
    with figure_in_file(path, ["a", "b"], 2.7) as panels:
        low, high = _window(traces.position, pitch, orders)
        inside = (traces.position >= low) & (traces.position <= high)
        count = int(np.ceil((high - low) / pitch * POINTS_A_PERIOD * max(orders)))
        edges = even_edges(traces.position[inside], min(count, 300), 25)
        places = (traces.position[inside], partial[inside], command[inside], edges)
        _gain_panel(panels["a"], axis, found, places, np.linspace(low, high, CURVE_POINTS))
        panels["a"].set_xlabel(f"position [{unit}]")
        span(panels["a"], low * scale, high * scale)
        legend_above(panels["a"])
        folded = np.mod(traces.position, pitch)
        edges = np.linspace(0.0, pitch, POINTS_A_PERIOD * min(max(orders), 4) + 1)
        places = (folded, partial, command, edges)
        _gain_panel(panels["b"], axis, found, places, np.linspace(0.0, pitch, 400))
        panels["b"].set_xlabel(f"position within a pitch of {pitch * scale:.5g} {unit} [{unit}]")
        span(panels["b"], 0.0, pitch * scale)
    return path


def plot_position_force(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw a force that depends on the place alone, and the residual before and after."""
    traces = axis.traces
    scale, unit = axis.place
    edges = even_edges(traces.position, 150)
    with figure_in_file(path, ["a", "b"], 2.7) as panels:
        draw_bins(panels["a"], binned(traces.position, axis.partial(found.name), edges), scale)
        x = np.linspace(edges[0], edges[-1], CURVE_POINTS)
        curve = axis.force_over(found, position=x)
        # theta psi has the mean of its columns, which the offset takes: so have the dots
        panels["a"].plot(x * scale, curve, color=AFTER, lw=1.4, label="model")
        panels["a"].set_ylabel(f"command against it [{axis.command_unit}]")
        legend_above(panels["a"])
        draw_residuals(panels["b"], axis, traces.position, edges, scale)
        panels["b"].set_xlabel(f"position [{unit}]")
        for panel in panels.values():
            zero_line(panel)
            force_scale(panel, axis)
            span(panel, edges[0] * scale, edges[-1] * scale)
    return path


def plot_friction_by_place(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw the level of friction against position: what of it keeps its size and turns its sign."""
    traces = axis.traces
    scale, unit = axis.place
    direction = np.sign(traces.velocity)
    direction[np.abs(traces.velocity) < SLOW * np.max(np.abs(traces.velocity), initial=0.0)] = 0.0
    edges = even_edges(traces.position, 60, 60)

    # the same viscous part from all, or the levels could not be compared
    viscous = axis.coefficient("velocity") * traces.velocity

    def level(friction: Array) -> tuple[Array, Array]:
        place, size = ratio_in_bins(traces.position, friction - viscous, direction, edges)
        return place * scale, size

    data = level(axis.friction_model + traces.residual_after)
    with figure_in_file(path, ["a"], 3.4) as panels:
        panel = panels["a"]
        panel.plot(*data, ".", color="#5c5c5c", ms=6, label="data")
        alone = level(axis.declared_friction)
        panel.plot(*alone, color=BEFORE, lw=1.4, ls="--", label="declared model alone")
        words = f"with {axis.effect_names}"
        panel.plot(*level(axis.friction_model), color=AFTER, lw=1.4, label=words)
        panel.set_ylim(bottom=min(0.0, float(np.min(data[1], initial=0.0))))
        span(panel, edges[0] * scale, edges[-1] * scale)
        panel.set_xlabel(f"position [{unit}]")
        panel.set_ylabel(f"level of friction [{axis.command_unit}]")
        force_scale(panel, axis)
        legend_above(panel)
    return path


def plot_encoder_error(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw the error of the measured position over one period of the encoder's scale.

    An error e(x) is seen as the acceleration that it seems to make: at speed v that is
    -(2 pi v / period)^2 e, so every row tells of e with a weight that grows with v^2.
    """
    traces = axis.traces
    period = found.effect.picture.scale
    scale, unit = axis.small_place
    within = np.abs(traces.velocity) < FAST * traces.band_hz * period
    weight = axis.coefficient("acceleration") * (2.0 * np.pi * traces.velocity / period) ** 2
    folded = np.mod(traces.position, period)[within]
    edges = np.linspace(0.0, period, POINTS_A_PERIOD + 1)
    with figure_in_file(path, ["a"], 3.4) as panels:
        panel = panels["a"]
        partial = axis.partial(found.name)[within]
        place, error = ratio_in_bins(folded, partial, weight[within], edges)
        panel.plot(place * scale, error * scale, ".", color="#5c5c5c", ms=6, label="data")
        x = np.linspace(0.0, period, 400)
        amplitudes = [float(getattr(found.effect.options, a)) for a in found.effect.amplitudes]
        curve = np.array(amplitudes) @ error_columns(found.effect, x)
        panel.plot(x * scale, curve * scale, color=AFTER, lw=1.4, label="model")
        zero_line(panel)
        span(panel, 0.0, period * scale)
        panel.set_xlabel(f"position within a period of {period * scale:.5g} {unit} [{unit}]")
        panel.set_ylabel(f"error of the measured position [{unit}]")
        legend_above(panel)
    return path


def draw_residuals(
    panel: Axes, axis: AxisSignals, variable: Array, edges: Array, scale: float
) -> None:
    """Draw the residuals' medians in bins of a variable, before and after."""
    traces = axis.traces
    pairs = [(traces.residual_before, BEFORE, "declared model alone")]
    if axis.effect_names:
        pairs.append((traces.residual_after, AFTER, f"with {axis.effect_names}"))
    for residual, colour, label in pairs:
        bins = binned(variable, residual, edges)
        panel.fill_between(bins.centre * scale, bins.low, bins.high, color=colour, alpha=0.15, lw=0)
        panel.plot(bins.centre * scale, bins.middle, color=colour, lw=1.2, label=label)
    panel.set_ylabel(f"residual [{axis.command_unit}]")
    legend_above(panel)


def _gain_panel(
    panel: Axes,
    axis: AxisSignals,
    found: FoundEffect,
    places: tuple[Array, Array, Array, Array],
    x: Array,
) -> None:
    """Draw the deviation of the gain in percent: data in bins, and the model at places x."""
    scale, _ = axis.place
    place, ratio = ratio_in_bins(*places)
    # the command has to make up for what the gain has too much
    panel.plot(place * scale, -100.0 * ratio, ".", color="#5c5c5c", ms=4, label="data")
    curve = -100.0 * axis.force_over(found, position=x, command=np.ones(len(x)))
    panel.plot(x * scale, curve, color=AFTER, lw=1.4, label="model")
    panel.set_ylabel("deviation of the thrust [%]")
    zero_line(panel)


def _pitch_spectrum(panel: Axes, axis: AxisSignals, pitch: float, orders: tuple[int, ...]) -> None:
    highest = (max(orders) + 1.6) / pitch
    wave, before, after = position_spectra(axis, highest)
    draw_position_spectrum(panel, axis, wave, before, after)
    for order in orders:
        mark_frequency(panel, order / pitch, f"{order}/pitch")
    panel.set_title("residual over position")


def _window(position: Array, pitch: float, orders: tuple[int, ...]) -> tuple[float, float]:
    """Return the whole way, or so many waves in its middle as can be seen one by one."""
    low, high = float(np.min(position)), float(np.max(position))
    wave = pitch / min(max(orders), 6)
    if high - low <= MOST_WAVES * wave:
        return low, high
    length = max(SHOWN_WAVES * wave, 2.0 * pitch)
    low = min(max(float(np.median(position)) - 0.5 * length, low), high - length)
    return low, low + length


def _pitch(found: FoundEffect) -> float:
    return found.effect.picture.scale


def _orders(found: FoundEffect) -> tuple[int, ...]:
    return tuple(round(line * found.effect.repeats_every) for line in found.effect.lines)
