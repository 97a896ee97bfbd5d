"""The look of every picture, and curves that keep their peaks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motorctl.printable import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLOURS = ("#b5482e", "#1f5f8b", "#3f7f3f", "#7a5195", "#8a6d3b")
MOST_PIECES = 2400
"""A curve is drawn as the extremes of as many pieces: no peak is lost, and none is drawn twice."""
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.dpi": 130,
}


def colour(k: int) -> str:
    """Return the colour of the k-th run."""
    return COLOURS[k % len(COLOURS)]


@contextmanager
def panels_in_file(
    rows: int, path: Path, *, height: float, columns: int = 1
) -> Iterator[tuple[Figure, Sequence[Axes]]]:
    """Make a figure of panels, row by row, `height` inches each, and save it as PNG."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 0.9 + rows * height), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(rows, columns, squeeze=False, sharex="col").ravel()
        yield figure, list(panels)
        save(figure, path)


def save(figure: Figure, path: Path) -> None:
    """Save a figure as PNG, with its words as they are: no name of others is read as a formula."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        words = printable(text.get_text())
        # Labels of ticks, which may be formulas, are written anew when they are drawn.
        text.set_text(words.replace("\\$", "$").replace("$", "\\$"))
    figure.savefig(path, metadata={"Software": None})


def draw_curve(
    panel: Axes, time_s: Array, values: Array, line_colour: str, label: str | None = None
) -> None:
    """Draw values over time; of a long curve the least and the greatest value of each piece."""
    step = -(-len(values) // MOST_PIECES)
    if step > 2:
        starts = np.arange(0, len(values), step)
        low = np.minimum.reduceat(values, starts)
        high = np.maximum.reduceat(values, starts)
        time_s, values = np.repeat(time_s[starts], 2), np.column_stack((low, high)).ravel()
    panel.plot(time_s, values, color=line_colour, lw=0.7, label=label)
