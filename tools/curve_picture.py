"""Set the curves of an effect as a small SVG, and tell whether two such pictures are the same."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from xml.sax.saxutils import escape

import numpy as np
from effect_curves import Curve, Curves
from numpy.typing import NDArray

from motorctl.picture_style import colour

Array = NDArray[np.float64]

# All in pixels.
LEFT, TOP, WIDTH, HEIGHT, LINE = 66, 12, 440, 168, 17
RIGHT, BELOW = 24, 44
TICKS = 5
"""Numbers along an axis, about. Only looks depend on it. Chosen by hand."""
SAME_PIXELS = 0.25
"""Pictures whose points are nearer than this are the same: the last digits of a sine are another on
another processor. Smaller calls those different, larger misses what can be seen. Chosen by hand."""
STYLE = """
  text { font: 12px system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif; fill: #23303b }
  .paper { fill: #ffffff }
  .grid { stroke: #d9dee2; stroke-width: 1 }
  .zero { stroke: #7d99a8; stroke-width: 1 }
  .curve { fill: none; stroke-width: 1.6 }
  .faint { stroke: #5a6b78; stroke-dasharray: 5 4; stroke-width: 1.2 }
"""
TIE_PIXELS = 1e-6
"""Lengths that differ by less are the same one: which is longer the last digit of a sum decides."""
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_PLACED = re.compile(r' (?:points|d|x|y)="[^"]*"')
"""What tells where something is drawn; other numbers are to be read, as words are."""


def picture(title: str, drawn: Curves) -> str:
    """Return a picture of curves, as SVG.

    Parameters
    ----------
    title
        What it shows, for who cannot see it.
    drawn
        The curves.
    """
    x_low, x_high, x_step = _limits([curve.x for curve in drawn.curves], tight=True)
    y_low, y_high, y_step = _limits([curve.y for curve in drawn.curves])

    def right(x: Array | float) -> Array:
        return np.asarray(LEFT + (x - x_low) / (x_high - x_low) * WIDTH)

    def down(y: Array | float) -> Array:
        return np.asarray(TOP + (y_high - y) / (y_high - y_low) * HEIGHT)

    labels = [(k, curve) for k, curve in enumerate(drawn.curves) if curve.label]
    height = TOP + HEIGHT + BELOW + LINE * len(labels) + 6
    width = LEFT + WIDTH + RIGHT
    foot = TOP + HEIGHT
    lines = [
        "<!-- Drawn by tools/reference.py; do not edit. -->",
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img">',
        f"<title>{escape(title)}</title>",
        f"<style>{STYLE}</style>",
        '<rect class="paper" width="100%" height="100%"/>',
    ]
    for x in _ticks(x_low, x_high, x_step):
        at = f"{right(x):.1f}"
        lines.append(f'<path class="grid" d="M{at} {TOP}V{foot}"/>')
        lines.append(f'<text x="{at}" y="{foot + 15}" text-anchor="middle">{_number(x)}</text>')
    for y in _ticks(y_low, y_high, y_step):
        at = f"{down(y):.1f}"
        lines.append(f'<path class="{"grid" if y else "zero"}" d="M{LEFT} {at}H{LEFT + WIDTH}"/>')
        lines.append(f'<text x="{LEFT - 6}" y="{at}" dy="4" text-anchor="end">{_number(y)}</text>')
    for k, curve in enumerate(drawn.curves):
        points = _thinned(np.column_stack([right(curve.x), down(curve.y)]))
        told = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        lines.append(f'<polyline {_look(k, curve)} points="{told}"/>')
    middle = LEFT + WIDTH // 2
    lines.append(
        f'<text x="{middle}" y="{foot + 33}" text-anchor="middle">{escape(drawn.x_label)}</text>'
    )
    lines.append(
        f'<text transform="translate(13 {TOP + HEIGHT // 2}) rotate(-90)" text-anchor="middle">'
        f"{escape(drawn.y_label)}</text>"
    )
    for line, (k, curve) in enumerate(labels):
        y = foot + BELOW + LINE * line + 8
        lines.append(f'<path {_look(k, curve)} d="M{LEFT} {y - 4}h26"/>')
        lines.append(f'<text x="{LEFT + 34}" y="{y}">{escape(curve.label)}</text>')
    return "\n".join([*lines, "</svg>"]) + "\n"


def same_picture(one: str, other: str) -> bool:
    """Return whether two pictures look the same: the same words, and points that hardly differ."""
    if _PLACED.sub("", one) != _PLACED.sub("", other):
        return False
    placed, others = (" ".join(_PLACED.findall(text)) for text in (one, other))
    if _NUMBER.sub("", placed) != _NUMBER.sub("", others):
        return False
    at, at_other = (np.array(_NUMBER.findall(text), float) for text in (placed, others))
    return bool(np.all(np.abs(at - at_other) <= SAME_PIXELS))


def _look(k: int, curve: Curve) -> str:
    if curve.faint:
        return 'class="curve faint"'
    return f'class="curve" stroke="{colour(k)}"'


def _limits(values: Sequence[Array], *, tight: bool = False) -> tuple[float, float, float]:
    """Return lowest, highest and a round step between; a little room around unless `tight`."""
    low, high = float(min(map(np.min, values))), float(max(map(np.max, values)))
    if high <= low:
        low, high = min(low, 0.0) - 0.1, max(high, 0.0) + 0.1
    if not tight:
        low, high = low - 0.06 * (high - low), high + 0.06 * (high - low)
    rough = (high - low) / TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * part for part in (1.0, 2.0, 5.0, 10.0) if power * part >= rough)
    return low, high, step


def _ticks(low: float, high: float, step: float) -> list[float]:
    room = 1e-9 * (high - low)
    first, last = math.ceil((low - room) / step), math.floor((high + room) / step)
    return [k * step for k in range(first, last + 1)]


def _number(value: float) -> str:
    return f"{value:.4g}"


def _thinned(points: Array) -> Array:
    """Return points without those that a straight line goes through anyway, to a tenth pixel."""
    kept = [0]
    for k in range(1, len(points) - 1):
        begin, between = points[kept[-1]], points[kept[-1] + 1 : k + 1]
        along = points[k + 1] - begin
        length = float(np.hypot(*along))
        off = between - begin
        if length > TIE_PIXELS:
            away = np.abs(off[:, 0] * along[1] - off[:, 1] * along[0]) / length
            back = off @ along / length
            between_ends = back.min() >= -TIE_PIXELS and back.max() <= length + TIE_PIXELS
            straight = bool(away.max() < 0.1 and between_ends)
        else:
            straight = bool(np.hypot(off[:, 0], off[:, 1]).max() < 0.1)
        if not straight:
            kept.append(k)
    return points[[*kept, len(points) - 1]]
