"""Pictures of structure without a name: the residual against everything that it may depend on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorctl.identify.columns.measured import Array
from motorctl.identify.diagnose.report.pictures.axis_signals import AxisSignals
from motorctl.identify.diagnose.report.pictures.panels import (
    AFTER,
    BEFORE,
    DATA,
    figure_in_file,
    figure_of,
    force_scale,
    zero_line,
)
from motorctl.identify.diagnose.report.pictures.statistics import binned, even_edges, since_reversal
from motorctl.identify.diagnose.result import UnknownStructure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BINS = 60
"""Bins over one variable. More leaves bins noisy, fewer blurs the curve. Chosen by hand."""
MAP_CELLS = (24, 18)
"""Cells of a map over position and over velocity. More leaves them empty, fewer blurs the
structure. Chosen by hand."""
REVERSAL_PART = 1e-4
"""A reversal counts once the axis has gone back by this part of its travel. Smaller takes noise for
reversals, larger misses short strokes. Chosen by hand."""
FEWEST_IN_CELL = 8
"""Fewest rows in a cell that is drawn. Smaller draws noise, larger leaves the map empty. Chosen by
hand."""
NAMES = {"history": "the way since the last reversal"}


def plot_unknown(axis: AxisSignals, unknown: UnknownStructure, path: Path) -> Path:
    """Draw the residual against position, velocity, command, and what else it depends on."""
    chosen = _variables(axis, unknown)
    both = {"position", "velocity"} <= set(unknown.depends_on)
    layout = ["ab", "cd"]
    with figure_in_file(path, [*layout, "mm"] if both else layout, 2.6) as panels:
        for key, name in zip("abcd", chosen, strict=True):
            _panel(panels[key], axis, name)
            named = NAMES.get(name, name)
            marked = name in unknown.depends_on
            panels[key].set_title(
                f"depends on {named}" if marked else named,
                fontweight="bold" if marked else "normal",
            )
        if both:
            _map(panels["m"], axis)
        figure = figure_of(panels["a"])
        handles, labels = panels["a"].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=3)
    return path


def _variables(axis: AxisSignals, unknown: UnknownStructure) -> list[str]:
    """Return four variables, those that the residual depends on first."""
    possible = ("position", "velocity", "command", "acceleration", "time", "history")
    first = [name for name in possible if name in unknown.depends_on]
    return [*first, *(name for name in possible if name not in first)][:4]


def _panel(panel: Axes, axis: AxisSignals, name: str) -> None:
    traces = axis.traces
    variable, scale, label = _variable(axis, name)
    known = np.isfinite(variable)
    if not known.any():
        return
    if name == "history":
        panel.set_xscale("log")
        low, high = np.percentile(variable[known], (2, 98))
        edges = np.geomspace(max(low, 1e-12), max(high, 2.0 * low, 2e-12), BINS + 1)
    else:
        edges = even_edges(variable[known], BINS)
    bins = binned(variable, traces.residual_before, edges)
    panel.fill_between(
        bins.centre * scale,
        bins.low,
        bins.high,
        color=DATA,
        alpha=0.3,
        lw=0,
        zorder=1,
        label="middle half",
    )
    panel.plot(
        bins.centre * scale, bins.middle, color=BEFORE, lw=1.4, label="declared model alone, median"
    )
    if axis.effect_names:
        after = binned(variable, traces.residual_after, edges)
        words = f"with {axis.effect_names}"
        panel.plot(after.centre * scale, after.middle, color=AFTER, lw=1.4, label=words)
    zero_line(panel)
    panel.set_xlabel(label)
    panel.set_ylabel(f"residual [{axis.command_unit}]")
    force_scale(panel, axis)


def _variable(axis: AxisSignals, name: str) -> tuple[Array, float, str]:
    """Return a variable's values, the factor in which it is drawn, and its label."""
    traces, (scale, unit) = axis.traces, axis.place
    match name:
        case "position":
            return traces.position, scale, f"position [{unit}]"
        case "velocity":
            return traces.velocity, scale, f"velocity [{unit}/s]"
        case "acceleration":
            own = axis.diagnosis.data.position_unit
            return traces.acceleration, 1.0, f"acceleration [{own}/s²]"
        case "command":
            return traces.command, 1.0, f"command [{axis.command_unit}]"
        case "time":
            return traces.time_s, 1.0, "time [s]"
    least = REVERSAL_PART * float(np.ptp(traces.position))
    way, direction = since_reversal(traces.position, least)
    way = np.where((direction != 0.0) & (way > 0.0), way, np.nan)
    return way, scale, f"way since the last reversal [{unit}]"


def _map(panel: Axes, axis: AxisSignals) -> None:
    """Draw the residual's mean over position and velocity as colours."""
    traces, (scale, unit) = axis.traces, axis.place
    edges = [
        np.linspace(float(np.min(signal)), float(np.max(signal)), cells + 1)
        for signal, cells in zip((traces.position, traces.velocity), MAP_CELLS, strict=True)
    ]
    count = np.histogram2d(traces.position, traces.velocity, edges)[0]
    total = np.histogram2d(traces.position, traces.velocity, edges, weights=traces.residual_before)[
        0
    ]
    mean = np.where(count >= FEWEST_IN_CELL, total / np.maximum(count, 1.0), np.nan)
    if not np.isfinite(mean).any():
        return
    worst = float(np.nanpercentile(np.abs(mean), 99))
    mesh = panel.pcolormesh(
        edges[0] * scale, edges[1] * scale, mean.T, cmap="RdBu_r", vmin=-worst, vmax=worst
    )
    panel.grid(visible=False)
    # below the panel: beside it, it would take width from those above
    bar = figure_of(panel).colorbar(mesh, ax=panel, location="bottom", shrink=0.5, aspect=50)
    bar.set_label(f"residual [{axis.command_unit}]")
    panel.set_title("mean residual of the declared model alone")
    panel.set_xlabel(f"position [{unit}]")
    panel.set_ylabel(f"velocity [{unit}/s]")
