"""Pictures of what changes with time: gain, mass, disturbances, and other axes' pulls."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorctl.identify.diagnose.report.parameter_text import own_unit, pretty
from motorctl.identify.diagnose.report.pictures.axis_signals import AxisSignals
from motorctl.identify.diagnose.report.pictures.panels import (
    AFTER,
    draw_bins,
    draw_broken,
    figure_in_file,
    force_scale,
    legend_above,
    limits,
    span,
    zero_line,
)
from motorctl.identify.diagnose.report.pictures.statistics import binned, even_edges, ratio_in_bins
from motorctl.identify.diagnose.result import FoundEffect, Traces

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVE_POINTS = 1000
"""Points of a drawn curve over time. Fewer show corners, more make larger files. Chosen by hand."""
PERIODS_SHOWN = 12.0
"""Periods of a disturbance that are drawn. More cannot be seen one by one, fewer hide that it
repeats. Chosen by hand."""


def plot_gain_drift(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw how the motor's gain changes with time."""
    traces = axis.traces
    edges = even_edges(traces.time_s, 50, 100)
    with figure_in_file(path, ["a"], 3.4) as panels:
        panel = panels["a"]
        time, ratio = ratio_in_bins(traces.time_s, axis.partial(found.name), traces.command, edges)
        panel.plot(time, -100.0 * ratio, ".", color="#5c5c5c", ms=6, label="data")
        t = np.linspace(edges[0], edges[-1], CURVE_POINTS)
        curve = -100.0 * axis.force_over(found, time=t, command=np.ones(len(t)))
        panel.plot(t, curve, color=AFTER, lw=1.4, label="model")
        _over_time(panel, "change of the thrust [%]", edges)
    return path


def plot_payload(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw how the moving mass changes with time."""
    traces = axis.traces
    edges = even_edges(traces.time_s, 50, 100)
    base = axis.coefficient("acceleration")
    gain, unit = 1.0, pretty(own_unit(axis.diagnosis.data, "V*s^2/m"))
    if axis.force_per_command:
        gain = axis.force_per_command
        place = axis.diagnosis.data.position_unit
        unit = "kg" if place == "m" else f"{axis.force_unit} s²/{place}"
    with figure_in_file(path, ["a"], 3.4) as panels:
        panel = panels["a"]
        time, added = ratio_in_bins(
            traces.time_s, axis.partial(found.name), traces.acceleration, edges
        )
        panel.plot(time, gain * (base + added), ".", color="#5c5c5c", ms=6, label="data")
        t = np.linspace(edges[0], edges[-1], CURVE_POINTS)
        begin = found.effect.picture.scale
        step = np.where(t >= begin, float(np.sum(found.theta)), 0.0)
        panel.plot(t, gain * (base + step), color=AFTER, lw=1.4, label="model")
        name = "moving mass" if axis.diagnosis.data.position_unit == "m" else "moment of inertia"
        _over_time(panel, f"{name} [{unit}]", edges)
    return path


def plot_periodic(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw a disturbance over time, and folded over its period."""
    traces = axis.traces
    period_s = found.effect.picture.scale
    partial = axis.partial(found.name)
    with figure_in_file(path, ["a", "b"], 2.7) as panels:
        middle = float(np.median(traces.time_s))
        begin = max(middle - 0.5 * PERIODS_SHOWN * period_s, float(traces.time_s[0]))
        shown = (traces.time_s >= begin) & (traces.time_s <= begin + PERIODS_SHOWN * period_s)
        time = traces.time_s[shown]
        draw_broken(panels["a"], time, -partial[shown], "#5c5c5c", "data")
        t = np.linspace(begin, begin + PERIODS_SHOWN * period_s, CURVE_POINTS)
        panels["a"].plot(t, -axis.force_over(found, time=t), color=AFTER, lw=1.4, label="model")
        span(panels["a"], t[0], t[-1])
        panels["a"].set_xlabel("time [s]")
        panels["a"].set_title(f"{PERIODS_SHOWN:g} periods")
        legend_above(panels["a"])
        edges = np.linspace(0.0, period_s, 41)
        draw_bins(panels["b"], binned(np.mod(traces.time_s, period_s), -partial, edges), 1e3)
        t = np.linspace(0.0, period_s, 400)
        panels["b"].plot(1e3 * t, -axis.force_over(found, time=t), color=AFTER, lw=1.4)
        span(panels["b"], 0.0, 1e3 * period_s)
        panels["b"].set_title("all of them, folded")
        panels["b"].set_xlabel(f"time within a period of {1e3 * period_s:.5g} ms [ms]")
        for panel in panels.values():
            panel.set_ylabel(f"disturbance [{axis.command_unit}]")
            zero_line(panel)
            force_scale(panel, axis)
    return path


def plot_cross_axis(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw the pull of other axes against their accelerations, else over time."""
    known = [name for name in found.effect.other_axes if name in axis.others]
    if not known:
        return plot_contribution(axis, found, path)
    layout = ["abcdefgh"[k] for k in range(len(known))]
    with figure_in_file(path, layout, 3.4) as panels:
        for key, other in zip(layout, known, strict=True):
            _pull_panel(panels[key], axis, found, other)
        legend_above(panels[layout[0]])
    return path


def plot_contribution(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw over time what an effect adds to the command, and what the data ask of it."""
    traces = axis.traces
    with figure_in_file(path, ["a"], 3.4) as panels:
        panel = panels["a"]
        partial = axis.partial(found.name)
        draw_broken(panel, traces.time_s, partial, "#b0b0b0", "data")
        draw_broken(panel, traces.time_s, axis.contribution(found.name), AFTER, "model")
        limits(panel, partial)
        zero_line(panel)
        span(panel, float(traces.time_s[0]), float(traces.time_s[-1]))
        panel.set_xlabel("time [s]")
        panel.set_ylabel(f"part of the command [{axis.command_unit}]")
        force_scale(panel, axis)
        legend_above(panel)
    return path


def _pull_panel(panel: Axes, axis: AxisSignals, found: FoundEffect, other: str) -> None:
    traces = axis.traces
    theta = dict(zip((p.name for p in found.effect.parameters), found.theta, strict=True))
    motion: Traces = axis.others[other]
    acceleration = np.interp(traces.time_s, motion.time_s, motion.acceleration)
    slope = float(theta.get(f"acceleration_{other}", 0.0))
    # what is left once everything else is taken away, the pull of further axes and speeds too
    data = traces.residual_after + slope * acceleration
    edges = even_edges(acceleration, 60, 30)
    draw_bins(panel, binned(acceleration, data, edges), 1.0)
    panel.plot(edges, slope * edges, color=AFTER, lw=1.4, label="model")
    zero_line(panel)
    unit = axis.diagnosis.data.position_unit
    panel.set_xlabel(f"acceleration of axis {other} [{unit}/s²]")
    panel.set_ylabel(f"part of the command [{axis.command_unit}]")
    force_scale(panel, axis)


def _over_time(panel: Axes, label: str, edges: np.ndarray) -> None:
    span(panel, edges[0], edges[-1])
    panel.set_xlabel("time [s]")
    panel.set_ylabel(label)
    legend_above(panel)
