"""Panels of the pictures of a diagnosis: their look, a second scale in newtons, usual curves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from motorctl.identify.columns.measured import Array
from motorctl.identify.diagnose.report.pictures.axis_signals import AxisSignals
from motorctl.identify.diagnose.report.pictures.statistics import Bins, unbroken
from motorctl.picture_style import COLOURS, STYLE, draw_curve, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE, AFTER = COLOURS[:2]
DATA = "#9a9a9a"
NOISE = "#444444"
MARK = "#3f7f3f"
WIDTH_INCHES = 9.0
"""Width of a picture [inch]. Larger shrinks the writing on the page, smaller crowds three panels.
Chosen by hand."""
MARGIN = 0.12
"""Part of the range that stays free above and below. Only looks depend on it. Chosen by hand."""
LOOK: dict[Any, Any] = STYLE | {
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "legend.fontsize": 9,
}


@contextmanager
def figure_in_file(path: Path, layout: list[str], height: float) -> Iterator[dict[str, Axes]]:
    """Make panels laid out as letters in rows (``["aa", "bc"]``), and save them as PNG.

    `height` is that of a row in inches. Gives the panels by their letters.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(WIDTH_INCHES, 0.3 + len(layout) * height), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplot_mosaic([list(row) for row in layout])
        yield {str(key): panel for key, panel in panels.items()}
        save(figure, path)


def force_scale(panel: Axes, axis: AxisSignals, per: str = "") -> None:
    """Add a second scale at the right in units of force, where the force constant is known."""
    gain = axis.force_per_command
    if not gain:
        return

    def to_force(command: Any) -> Any:
        return np.asarray(command) * gain

    def to_command(force: Any) -> Any:
        return np.asarray(force) / gain

    right = panel.secondary_yaxis("right", functions=(to_force, to_command))
    right.spines["right"].set_visible(True)
    right.spines["right"].set_color("#999999")
    right.set_ylabel(f"[{axis.force_unit}{per}]")


def draw_bins(panel: Axes, bins: Bins, scale: float) -> None:
    """Draw medians as dots, with a band from quartile to quartile."""
    panel.fill_between(
        bins.centre * scale, bins.low, bins.high, color=DATA, alpha=0.3, lw=0, zorder=1
    )
    label = "data: median, middle half"
    panel.plot(bins.centre * scale, bins.middle, ".", color="#5c5c5c", ms=4, label=label, zorder=2)


def draw_broken(panel: Axes, time_s: Array, values: Array, colour: str, label: str) -> None:
    """Draw a curve over time that is not joined across gaps."""
    if len(time_s) < 2:
        return
    stretches = list(unbroken(time_s, float(np.median(np.diff(time_s)))))
    for k, rows in enumerate(stretches):
        draw_curve(panel, time_s[rows], values[rows], colour, label if k == 0 else None)


def limits(panel: Axes, *values: Array, share: float = 0.2) -> None:
    """Set the vertical limits to what nearly all of `values` need, so that no outlier rules."""
    known = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    if len(known) == 0:
        return
    low, high = np.percentile(known, (share, 100.0 - share))
    if high > low:
        margin = MARGIN * (high - low)
        panel.set_ylim(low - margin, high + margin)


def span(panel: Axes, low: float, high: float) -> None:
    """Set the horizontal limits, where they are apart."""
    if high > low:
        panel.set_xlim(low, high)


def legend_above(panel: Axes, columns: int = 4) -> None:
    """Put the legend above the panel, where it hides nothing."""
    if panel.get_legend_handles_labels()[0]:
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.2)


def zero_line(panel: Axes) -> None:
    """Draw where nothing is missing."""
    panel.axhline(0.0, color="black", lw=0.7, zorder=0.5)


def figure_of(panel: Axes) -> Figure:
    """Return the figure that a panel stands in."""
    figure = panel.get_figure(root=True)
    assert figure is not None
    return figure
