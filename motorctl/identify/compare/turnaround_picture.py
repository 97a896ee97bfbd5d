"""The histogram of turnaround, with bars at its ends for what is off the chart."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motorctl.picture_style import colour, panels_in_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

BINS = 60
"""Bins of the histogram. More are noisy, fewer hide a second peak. Chosen by hand."""
SHOWN_PERCENT = 99.9
"""Percentile up to which times are drawn. Nearer to 100 lets single outliers set the scale. Chosen
by hand."""
ROOM = 1.5
"""The chart ends at this many times the slowest of the shown percentiles, and begins as far below
the fastest. Only looks depend on it. Chosen by hand."""
LATE = "#b00020"
LEAST_MICROSECONDS = 0.1
"""Shortest time drawn [µs]: a logarithmic scale needs one above zero. Larger cuts off fast ticks,
smaller draws an empty decade. Chosen by hand."""


def plot_turnaround(
    turnarounds: Mapping[str, Array], path: Path, deadline_s: float | None = None
) -> Path:
    """Draw turnaround [s] of each run on logarithmic axes, all on the same scale.

    `deadline_s` is the loop's period, after which a tick is late; None: not known.
    """
    micro = {label: values[np.isfinite(values)] * 1e6 for label, values in turnarounds.items()}
    deadline_us = None if deadline_s is None else deadline_s * 1e6
    edges = _edges(list(micro.values()), deadline_us)
    with panels_in_file(len(micro), path, height=2.0) as (figure, panels):
        for k, (panel, (label, values)) in enumerate(zip(panels, micro.items(), strict=True)):
            _histogram(panel, values, edges, colour(k))
            if deadline_us is not None:
                _draw_deadline(panel, values, deadline_us)
            panel.set_ylabel(f"{label}\nticks")
        highest = max(panel.get_ylim()[1] for panel in panels)
        for panel in panels:
            panel.set_ylim(0.5, highest)
        panels[-1].set_xlabel("turnaround [µs]   (hatched: everything beyond the chart)")
        figure.suptitle("Turnaround: from wake-up to the end of the write", x=0.01, ha="left")
    return path


def _draw_deadline(panel: Axes, values: Array, deadline_us: float) -> None:
    late = np.count_nonzero(values > deadline_us)
    panel.axvline(deadline_us, color=LATE, lw=1.4)
    panel.annotate(
        f"period {deadline_us:g} µs: {late:,} ticks late",
        (deadline_us, 1.0),
        (-4, -3),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=8,
        color=LATE,
    )


def _edges(runs: list[Array], deadline_us: float | None) -> Array:
    """Cover what is usual in any run, from the fastest tick to beyond the slow percentile.

    The deadline, and what is just behind it, is always on the chart.
    """
    fast = min(float(np.percentile(values, 100.0 - SHOWN_PERCENT)) for values in runs)
    slow = max(float(np.percentile(values, SHOWN_PERCENT)) for values in runs)
    slow = max(slow, deadline_us or 0.0)
    low = max(fast, LEAST_MICROSECONDS) / ROOM
    return np.geomspace(low, max(slow, low) * ROOM, BINS + 1)


def _histogram(panel: Axes, values: Array, edges: Array, bar_colour: str) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    counts, _ = np.histogram(values, edges)
    width = edges[1] / edges[0]
    panel.bar(edges[:-1], counts, np.diff(edges), align="edge", color=bar_colour, lw=0)
    ends = (
        (edges[0] / width**3, edges[0] / width, np.count_nonzero(values < edges[0])),
        (edges[-1] * width, edges[-1] * width**3, np.count_nonzero(values > edges[-1])),
    )
    for begin, end, count in ends:
        style: dict[str, Any] = {
            "facecolor": "white",
            "edgecolor": bar_colour,
            "hatch": "/////",
            "lw": 1,
        }
        panel.bar(begin, count, end - begin, align="edge", **style)
        if count:
            panel.annotate(
                str(count),
                ((begin * end) ** 0.5, 1.3 * count),
                ha="center",
                va="bottom",
                fontsize=8,
            )
    panel.set_xscale("log")
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.set_yscale("log")
    panel.set_xlim(ends[0][0] / width, ends[1][1] * width)
    panel.set_ylim(0.5, 2.0 * max(1, counts.max(), *(end[2] for end in ends)))
    median, high = np.percentile(values, (50.0, SHOWN_PERCENT))
    panel.axvline(median, color="black", lw=0.8)
    panel.set_title(
        f"median {median:.1f} µs (line),   {SHOWN_PERCENT:g} % {high:.1f} µs,   "
        f"worst {values.max():.4g} µs",
        loc="right",
        fontsize=8,
    )
