"""The histograms as a picture."""

from __future__ import annotations

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Picture

from motorctl.latency.durations import EDGES_S, Durations
from motorctl.latency.result import Latency

US = 1e6
PER_BAR = 10
"""Fine bins that share a bar: 20 bars a decade."""
RANGE_US = (1e-2, 1e5)


def draw(latency: Latency, path: Path) -> None:
    """Write a PNG: lateness beside cyclictest's, and turnaround with its parts."""
    picture = Picture(figsize=(9.0, 8.0), layout="constrained")
    FigureCanvasAgg(picture)
    above, below = picture.subplots(2, 1, sharex=True)
    if latency.rival is not None:
        _steps(above, latency.rival.latency, "cyclictest", "tab:gray")
    _steps(above, latency.times.lateness, "motorctl", "tab:blue")
    above.axvline(latency.machine.period_s * US, color="tab:red", linestyle=":", label="period")
    above.set_title(f"Lateness of wake-ups, CPU {latency.cpu}: {latency.verdict.sentence}")
    colours = {
        "turnaround": "black",
        "read": "tab:green",
        "compute": "tab:orange",
        "write": "tab:purple",
    }
    for part, durations in latency.times.parts.items():
        _steps(below, durations, part, colours[part])
    below.set_title("Turnaround and its parts")
    below.set_xlabel("us")
    for axes in (above, below):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlim(*RANGE_US)
        axes.set_ylabel("ticks")
        axes.grid(alpha=0.3)
        axes.legend()
    picture.savefig(path, dpi=120)


def _steps(axes: object, durations: Durations, label: str, colour: str) -> None:
    edges = EDGES_S[::PER_BAR]
    counts = durations.between(edges)
    # What is off the chart is in its first and last bar.
    low, high = RANGE_US[0] / US, RANGE_US[1] / US
    inside = (edges[:-1] >= low * 0.999) & (edges[1:] <= high * 1.001)
    shown = counts[1:-1][inside]
    first = int(inside.argmax())
    shown[0] += counts[: first + 1].sum()
    shown[-1] += counts[1:-1][first + len(shown) :].sum() + counts[-1]
    used = edges[first : first + len(shown) + 1] * US
    axes.stairs(shown, used, label=label, color=colour)  # type: ignore[attr-defined]
