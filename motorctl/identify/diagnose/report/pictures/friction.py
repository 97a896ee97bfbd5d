"""Pictures of friction: against velocity with its model, and against the way after a reversal."""

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
    limits,
    span,
    zero_line,
)
from motorctl.identify.diagnose.report.pictures.statistics import binned, since_reversal
from motorctl.identify.diagnose.result import FoundEffect

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SLOW_PART = 0.1
"""Part of the top speed that the close view shows, where the effect tells no speed of its own.
Larger hides what happens near rest, smaller shows too few points. Chosen by hand."""
VELOCITIES = 6.0
"""The close view in multiples of the effect's own velocity. Larger hides the dip near rest, smaller
cuts it off. Chosen by hand."""
BINS = 90
"""Bins over velocity. More leaves single bins noisy, fewer blurs the curve. Chosen by hand."""
REVERSAL_COUNTS = 4.0
"""Way back, in encoder counts, from which a reversal counts. Smaller takes flicker for reversals,
larger misses small ones. Chosen by hand."""
REVERSAL_PART = 0.1
"""Way back, as a part of the effect's own displacement, from which a reversal counts. Larger misses
reversals, smaller finds them in noise. Chosen by hand."""


def plot_friction(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw friction against velocity, of both signs: all speeds, and slow ones close by."""
    traces = axis.traces
    fastest = float(np.max(np.abs(traces.velocity), initial=0.0))
    slow = min(VELOCITIES * found.effect.picture.scale or SLOW_PART * fastest, fastest)
    with figure_in_file(path, ["a", "b"], 2.9) as panels:
        _velocity_panel(panels["a"], axis, fastest)
        _velocity_panel(panels["b"], axis, slow)
        panels["b"].set_title("slow motion, close by")
        legend_above(panels["a"], 3)
    return path


def plot_presliding(axis: AxisSignals, found: FoundEffect, path: Path) -> Path:
    """Draw friction against the way after each reversal, and against velocity."""
    fastest = float(np.max(np.abs(axis.traces.velocity), initial=0.0))
    with figure_in_file(path, ["a", "b"], 2.9) as panels:
        _reversal_panel(panels["a"], axis, found)
        _velocity_panel(panels["b"], axis, SLOW_PART * fastest)
        legend_above(panels["a"], 3)
    return path


def _velocity_panel(panel: Axes, axis: AxisSignals, fastest: float) -> None:
    traces = axis.traces
    scale, unit = axis.place
    if fastest <= 0.0:
        return
    inside = np.abs(traces.velocity) <= fastest
    velocity = traces.velocity[inside]
    edges = np.linspace(-fastest, fastest, BINS + 1)
    # with the constant force: an asymmetry shows as one where a model has only that
    signal = axis.constant + axis.friction_model + traces.residual_after
    data = binned(velocity, signal[inside], edges)
    draw_bins(panel, data, scale)
    for friction, constant, colour, style, label in _models(axis):
        model = binned(velocity, (friction + constant)[inside], edges)
        panel.plot(model.centre * scale, model.middle, color=colour, lw=1.4, ls=style, label=label)
    limits(panel, data.low, data.high, share=0.0)
    zero_line(panel)
    panel.axvline(0.0, color="black", lw=0.7, zorder=0.5)
    span(panel, -fastest * scale, fastest * scale)
    panel.set_xlabel(f"velocity [{unit}/s]")
    panel.set_ylabel(f"friction and offset [{axis.command_unit}]")
    force_scale(panel, axis)


def _reversal_panel(panel: Axes, axis: AxisSignals, found: FoundEffect) -> None:
    """Draw the friction in the direction of the new motion: it starts where the old one left."""
    traces = axis.traces
    scale, unit = axis.small_place
    own = found.effect.picture.scale
    least = max(REVERSAL_PART * own, REVERSAL_COUNTS * (axis.diagnosis.data.resolution or 0.0))
    way, direction = since_reversal(traces.position, least)
    rows = (direction != 0.0) & (way > 0.0)
    edges = np.geomspace(0.1 * own, max(1e3 * own, 10.0 * least), 41)
    viscous = axis.coefficient("velocity") * traces.velocity
    data = direction * (axis.friction_model + traces.residual_after - viscous)
    draw_bins(panel, binned(way[rows], data[rows], edges), scale)
    for friction, _, colour, style, label in _models(axis):
        model = binned(way[rows], (direction * (friction - viscous))[rows], edges)
        panel.plot(model.centre * scale, model.middle, color=colour, lw=1.4, ls=style, label=label)
    panel.set_xscale("log")
    panel.axvline(own * scale, color="black", lw=0.8, ls=(0, (4, 3)))
    panel.annotate(
        f"{own * scale:.3g} {unit}",
        (own * scale, 1.0),
        (4, -3),
        va="top",
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        fontsize=9,
    )
    zero_line(panel)
    panel.set_xlabel(f"way since the last reversal [{unit}]")
    panel.set_ylabel(f"friction without\nits viscous part [{axis.command_unit}]")
    force_scale(panel, axis)


def _models(axis: AxisSignals) -> list[tuple[Array, float, str, str, str]]:
    """Return the models' friction and constant force, with colour, line and name."""
    return [
        (
            axis.declared_friction,
            -axis.declared_coefficient("one"),
            BEFORE,
            "--",
            "declared model alone",
        ),
        (
            axis.friction_model,
            axis.constant,
            AFTER,
            "-",
            f"with {axis.effect_names}",
        ),
    ]
