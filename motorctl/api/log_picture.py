"""A small picture of a log for notebooks: position and following error of each axis, as SVG."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from motorctl.api.signals import Signals
from motorctl.notebook import escaped
from motorctl.picture_style import colour

WIDTH, HEIGHT, MARGIN = 640, 90, 16
"""Of a panel, and the room for words above it [px]. Only looks depend on them. Chosen by hand."""
MOST_ROWS = 3_000_000
"""Rows up to which a log is drawn. More hold hundreds of megabytes for a glance: 24 MB a column;
fewer leave out ordinary logs. Chosen by hand; it is ten minutes at 5 kHz."""
MOST_AXES = 4
"""Axes that are drawn at most. Only looks depend on it. Chosen by hand."""
MICRO = 1e6


def log_picture(log: Signals) -> str:
    """Return an SVG element; nothing where there is nothing to draw, or too much."""
    if "time_s" not in log or not 1 < len(log.time_s) <= MOST_ROWS:
        return ""
    panels = [
        panel for k, axis in enumerate(log.axes[:MOST_AXES]) for panel in _panels(log, axis, k)
    ]
    height = len(panels) * (HEIGHT + MARGIN)
    parts = [
        f'<g transform="translate(0,{k * (HEIGHT + MARGIN)})">{panel}</g>'
        for k, panel in enumerate(panels)
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" '
        f'viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="11">'
        f"{''.join(parts)}</svg>"
    )


def _panels(log: Signals, axis: str, k: int) -> Iterator[str]:
    span = f"{log.time_s[0]:.4g} to {log.time_s[-1]:.4g} s"
    unit = log.units.get(f"{axis}.position_m") or "m"
    position = np.asarray(log[f"{axis}.position_m"], float)
    if not np.isfinite(position).any():
        return
    low, high = np.nanmin(position), np.nanmax(position)
    yield _panel(
        log.time_s, position, k, f"{axis} position, {low:.4g} to {high:.4g} {unit}, {span}"
    )
    if f"{axis}.following_error_m" in log:
        error = np.asarray(log[f"{axis}.following_error_m"], float)
        if not np.isfinite(error).any():
            return
        worst = MICRO * np.nanmax(np.abs(error))
        yield _panel(log.time_s, error, k, f"{axis} following error, at most {worst:.3g} µ{unit}")


def _panel(time_s: NDArray[np.float64], values: NDArray[np.float64], k: int, words: str) -> str:
    """Draw the least and the greatest value of each pixel: no peak is lost."""
    x = (time_s - time_s[0]) * (WIDTH - 1) / max(float(time_s[-1] - time_s[0]), 1e-300)
    starts = np.flatnonzero(np.diff(x.astype(np.int64), prepend=-1))
    low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
    bottom, top = float(np.nanmin(low)), float(np.nanmax(high))
    scale = (HEIGHT - 4) / (top - bottom) if top > bottom else 0.0
    points = np.column_stack((np.repeat(x[starts], 2), np.ravel(np.column_stack((low, high)))))
    points = points[np.isfinite(points[:, 1])]
    drawn = " ".join(f"{px:.0f},{HEIGHT - 2 - (v - bottom) * scale:.1f}" for px, v in points)
    return (
        f'<text x="2" y="{MARGIN - 4}" fill="#444">{escaped(words)}</text>'
        f'<g transform="translate(0,{MARGIN})">'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#ccc"/>'
        f'<polyline fill="none" stroke="{colour(k)}" stroke-width="1" points="{drawn}"/></g>'
    )
