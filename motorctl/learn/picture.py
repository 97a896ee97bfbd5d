"""A learning as a picture: the error over the cycle, what is added, the norms, the filters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.learn.learning import Learning
from motorctl.picture_style import COLOURS, STYLE, draw_curve, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

BEFORE, AFTER, OTHER, BOUND = COLOURS[:4]
SIZE_INCHES = (9.0, 8.6)
"""Width and height of the picture [inch]; only looks depend on it."""
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8}
LEAST_SHOWN = 1e-2
"""Least share that is left in the filters' panel; only looks depend on it."""


def draw_learning(learning: Learning, path: Path) -> Path:
    """Draw a learning into a PNG file and return it; raises UsageError where it cannot be."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE_INCHES, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplot_mosaic(
            [["error", "error"], ["learned", "learned"], ["norms", "filters"]]
        )
        panels["learned"].sharex(panels["error"])
        _draw_error(panels["error"], learning)
        _draw_learned(panels["learned"], learning)
        _draw_norms(panels["norms"], learning)
        _draw_filters(panels["filters"], learning)
        figure.suptitle(
            f"Axis {learning.axis}: learned for '{learning.program}'", x=0.01, ha="left"
        )
        try:
            save(figure, path)
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    return path


def _draw_error(panel: Axes, learning: Learning) -> None:
    first, words = learning.trials[0], learning.loop.units.words
    name = "with what had been learned" if learning.before else "nothing learned"
    shown = [(first, BEFORE, name)]
    if learning.best:
        shown.append((learning.trials[learning.best], AFTER, f"run {learning.best + 1}"))
    for trial, colour, label in shown:
        each = trial.repetition
        time_s = each.period_s * np.arange(each.points) / each.points
        told = words(f"{label}: last cycle, eF {trial.eF_m * 1e6:.2g} µm")
        panel.plot([], [], color=colour, label=told)
        draw_curve(panel, time_s, each.error[-1] * 1e6, colour)
    panel.set_ylabel(words("error [µm]"))
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2, **LEGEND)


def _draw_learned(panel: Axes, learning: Learning) -> None:
    each = learning.trials[0].repetition
    volts = np.array(learning.volts)
    time_s = each.period_s * np.arange(len(volts)) / len(volts)
    draw_curve(panel, time_s, volts, AFTER)
    panel.set_xlabel("time in the cycle [s]")
    panel.set_ylabel("learned [V]", color=AFTER)
    beside = panel.twinx()
    beside.spines["right"].set_visible(True)
    beside.grid(visible=False)
    at_s = each.period_s * np.arange(each.points) / each.points
    beside.plot(at_s, each.reference_velocity, color="0.6", lw=0.8)
    beside.set_ylabel(learning.loop.units.words("reference [m/s]"), color="0.5")


def _draw_norms(panel: Axes, learning: Learning) -> None:
    runs = np.arange(1, len(learning.trials) + 1)
    kept = [trial.repetition for trial in learning.trials]
    curves = (
        ("eF", [trial.eF_m for trial in learning.trials], BEFORE),
        ("rms", [each.rms_m for each in kept], AFTER),
        ("repeats", [each.repeats_rms_m for each in kept], OTHER),
        ("does not repeat", [each.left_over_rms_m for each in kept], "0.5"),
    )
    for label, values, colour in curves:
        panel.semilogy(runs, np.array(values) * 1e6, marker=".", color=colour, label=label)
    panel.set_xticks(runs)
    panel.set_xlabel("run")
    panel.set_ylabel(learning.loop.units.words("error [µm]"))
    panel.legend(**LEGEND)


def _draw_filters(panel: Axes, learning: Learning) -> None:
    filters = learning.filters
    hz = filters.frequency_hz[1:]
    curves = (
        ("|Q|", filters.robust, "0.5"),
        ("|Q (1 - L PS)|, fitted plant", filters.shrinks, AFTER),
        ("worst plant that may be", filters.shrinks_at_worst, BOUND),
    )
    for label, values, colour in curves:
        panel.loglog(hz, values[1:], color=colour, lw=1.2, label=label)
    panel.axhline(1.0, color="black", lw=0.8, ls="--")
    panel.set_ylim(LEAST_SHOWN, 2.0)
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("left after a repetition")
    panel.legend(loc="lower left", **LEGEND)
