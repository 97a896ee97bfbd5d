"""A tuning as a picture: the error before and after, what it costs, and the loop's sensitivity."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import Frequencies, LoopGains
from motorctl.errors import UsageError
from motorctl.picture_style import COLOURS, STYLE, draw_curve, save
from motorctl.tune.recorded_loop import RecordedLoop
from motorctl.tune.tuning import Tuning

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

BEFORE, AFTER, TRIED, PLAIN = COLOURS[:4]
SIZE_INCHES = (9.0, 7.6)
"""Width and height of the picture [inch]; only looks depend on it."""
POINTS = 600
"""Frequencies of the sensitivity; only looks depend on it."""
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8}


def draw_tuning(tuning: Tuning, path: Path) -> Path:
    """Draw a tuning into a PNG file and return it.

    Parameters
    ----------
    tuning
        What was chosen, with or without a run that tried it out.
    path
        The file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UsageError
        Where it cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE_INCHES, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplot_mosaic([["error", "error"], ["phase", "noise"], ["loop", "loop"]])
        _draw_error(panels["error"], tuning)
        _draw_phase(panels["phase"], tuning)
        _draw_noise(panels["noise"], tuning)
        _draw_sensitivity(panels["loop"], tuning)
        figure.suptitle(f"Gains of axis {tuning.loop.axis}", x=0.01, ha="left")
        try:
            save(figure, path)
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    return path


def _draw_error(panel: Axes, tuning: Tuning) -> None:
    loop, words = tuning.loop, tuning.loop.units.words
    recorded = words(f"recorded, eF {loop.eF_m * 1e6:.3g} µm")
    draw_curve(panel, *_counted(loop), BEFORE, recorded)
    told = tuning.chosen.prediction
    length_s = loop.counted * loop.period_s
    time_s = np.linspace(0.0, length_s, len(told.error), endpoint=False)
    label = words(f"predicted with the tuned gains, eF {told.eF_m * 1e6:.3g} µm")
    draw_curve(panel, time_s, told.error * 1e6, AFTER, label)
    if (plain := tuning.without_filter) is not None:
        label = words(f"predicted without the filter, eF {plain.prediction.eF_m * 1e6:.3g} µm")
        draw_curve(panel, time_s, plain.prediction.error * 1e6, PLAIN, label)
    if (tried := tuning.tried_out) is not None:
        label = words(f"tried out with them, eF {tried.eF_m * 1e6:.3g} µm")
        draw_curve(panel, *_counted(tried), TRIED, label)
    panel.set_xlabel("time [s], over the rows of eF")
    panel.set_ylabel(words("error [µm]"))
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2, **LEGEND)


def _counted(loop: RecordedLoop) -> tuple[Array, Array]:
    error = loop.error[-loop.counted :]
    time_s: Array = loop.period_s * np.arange(float(len(error)))
    return time_s, error * 1e6


def _draw_phase(panel: Axes, tuning: Tuning) -> None:
    curves = tuning.curves
    plain = None if tuning.without_filter is None else "without the filter"
    colour = AFTER if plain is None else PLAIN
    at_phase = curves.at_phase_m * 1e6
    panel.plot(curves.phase_deg, at_phase, color=colour, marker=".", lw=1.0, label=plain)
    margin = tuning.before_margins.phase_margin_deg
    _mark(panel, margin, tuning.loop.eF_m, BEFORE, "before")
    _mark(panel, tuning.margins.phase_margin_deg, tuning.chosen.prediction.eF_m, AFTER, "tuned")
    panel.axvline(tuning.wanted.phase_deg, color="black", lw=0.8, ls="--")
    panel.set_yscale("log")
    panel.set_xlabel("phase margin [degrees]   (dashed: asked for)")
    panel.set_ylabel(tuning.loop.units.words("least predicted eF [µm]"))
    panel.legend(**LEGEND)


def _draw_noise(panel: Axes, tuning: Tuning) -> None:
    curves = tuning.curves
    colour = AFTER if tuning.without_filter is None else PLAIN
    panel.plot(curves.noise_v, curves.at_noise_m * 1e6, color=colour, marker=".", lw=1.0)
    before = tuning.before_prediction.command_noise_v
    _mark(panel, before, tuning.loop.eF_m, BEFORE, "before")
    told = tuning.chosen.prediction
    _mark(panel, told.command_noise_v, told.eF_m, AFTER, "tuned")
    panel.axvline(tuning.wanted.command_noise_v or 0.0, color="black", lw=0.8, ls="--")
    panel.set_yscale("log")
    panel.set_xscale("log")
    panel.set_xlabel("noise of the command at rest [V rms]   (dashed: at most)")
    panel.set_ylabel(tuning.loop.units.words("least predicted eF [µm]"))


def _mark(panel: Axes, x: float | None, eF_m: float, colour: str, label: str) -> None:
    if x is not None and math.isfinite(x):
        panel.plot([x], [eF_m * 1e6], "o", color=colour, label=label)


def _draw_sensitivity(panel: Axes, tuning: Tuning) -> None:
    loop = tuning.loop
    w = np.geomspace(2.0 * np.pi, np.pi / loop.period_s, POINTS)
    plant = loop.plant_response(w)
    at = Frequencies.at(w, loop.period_s)

    def sensitivity(gains: LoopGains) -> Array:
        size: Array = np.abs(1.0 / (1.0 + gains.feedback(at) * plant))
        return size

    shown = [(tuning.before, BEFORE, "before"), (tuning.gains, AFTER, "tuned")]
    if tuning.without_filter is not None:
        shown.append((tuning.without_filter.gains, PLAIN, "without the filter"))
    for gains, colour, name in shown:
        size = sensitivity(gains)
        label = f"{name}, largest {size.max():.2f}"
        panel.loglog(w / (2.0 * np.pi), size, color=colour, lw=1.2, label=label)
    panel.axhline(1.0, color="black", lw=0.8)
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("|S|: error over\nwhat disturbs it")
    panel.legend(loc="lower right", **LEGEND)
