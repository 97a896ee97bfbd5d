"""The path of two axes that follow one program, with its error to the side drawn large."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.compare.error_across import error_across
from motorctl.identify.compare.runs import ComparedRun, Comparison
from motorctl.picture_style import colour, panels_in_file

Array = NDArray[np.float64]

DRAWN_SHARE = 0.12
"""Of the path's size that the largest error is drawn as [1]. Only looks depend on it. Chosen by
hand."""
SLOW_SHARE = 0.02
"""Of the path's top speed, below which it has no direction that is sure [1]. Larger leaves corners
out; smaller takes the rounding of a rest for a direction. Chosen by hand."""
HEIGHT_INCHES = 3.6
"""Of a panel [inch]. Only looks depend on it. Chosen by hand."""


@dataclass(frozen=True)
class Contour:
    """The reference path of two axes, and how far the axes are off it.

    Arrays are of shape (n,), of the rows in which the reference moves.
    """

    path: tuple[Array, Array]
    """Reference positions of the two axes."""
    off: tuple[Array, Array]
    """Of each axis' error what is drawn: the part across the motion or, where the axes' units have
    no distance in common and so nothing is across, all."""
    error: Array
    """Distance of the measured position to the left of the path's tangent; of axes whose units
    differ empty."""

    @property
    def largest(self) -> float:
        """In the axes' unit."""
        return _largest(self.error)

    @property
    def rms(self) -> float:
        """In the axes' unit."""
        return float(np.sqrt(np.mean(self.error**2))) if len(self.error) else 0.0


def contour_of(run: ComparedRun, pair: tuple[str, str]) -> Contour:
    """Return the contour of a run: the error across the motion, not along it.

    Parameters
    ----------
    run
        In which both axes follow a reference.
    pair
        The two axes. Of a linear and a rotary one the whole error of each is taken.

    Returns
    -------
    Contour
        Of the rows that both axes were measured in, where the reference moves.
    """
    rows = _common(run, pair)
    records = [run.recording.axes[name] for name in pair]
    references = [record.reference for record in records]
    x, y = (np.asarray(r, dtype=np.float64)[rows] for r in references if r is not None)
    ex, ey = (record.position[rows] - r for record, r in zip(records, (x, y), strict=True))
    vx, vy = np.gradient(x, edge_order=2), np.gradient(y, edge_order=2)
    if records[0].position_unit != records[1].position_unit:
        kept = _moves(vx) | _moves(vy)
        return Contour((x[kept], y[kept]), (ex[kept], ey[kept]), np.empty(0))
    slowest = SLOW_SHARE * float(np.max(np.hypot(vx, vy), initial=0.0))
    across, nx, ny = error_across(vx, vy, ex, ey, slowest)
    kept = ((nx != 0.0) | (ny != 0.0)) & np.isfinite(across)
    off = across * nx, across * ny
    return Contour((x[kept], y[kept]), (off[0][kept], off[1][kept]), across[kept])


def _moves(velocity: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(velocity) > SLOW_SHARE * _largest(velocity))


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def pairs_of(comparison: Comparison) -> list[tuple[str, str]]:
    """Return the pairs of axes that follow one program of two axes in every run."""
    pairs = [set(_pairs(run)) for run in comparison.runs]
    both = set.intersection(*pairs) if pairs else set()
    return sorted((x, y) for x, y in both if {x, y} <= set(comparison.axes))


def plot_contour(comparison: Comparison, pair: tuple[str, str], path: Path) -> Path:
    """Draw each run's path beside its reference, the error off it as many times as told."""
    contours = [contour_of(run, pair) for run in comparison.runs]
    units = [comparison.units(name)[0] for name in pair]
    scales = [1e3 if unit == "m" else 1.0 for unit in units]
    alike = units[0] == units[1]
    times = _times(contours, alike=alike)
    columns = min(len(contours), 2)
    rows = -(-len(contours) // columns)
    with panels_in_file(rows, path, height=HEIGHT_INCHES, columns=columns) as (figure, panels):
        runs = zip(panels, comparison.runs, contours, strict=False)
        for k, (panel, run, contour) in enumerate(runs):
            reference = [part * scale for part, scale in zip(contour.path, scales, strict=True)]
            drawn = [
                (part + times * off) * scale
                for part, off, scale in zip(contour.path, contour.off, scales, strict=True)
            ]
            panel.plot(*reference, color="black", lw=0.7, label="reference")
            panel.plot(*drawn, color=colour(k), lw=0.7, label=f"{run.label}, error x {times:,}")
            if alike:
                panel.set_aspect("equal", adjustable="datalim")
            shown = ["mm" if unit == "m" else unit for unit in units]
            panel.set_xlabel(f"{pair[0]} [{shown[0]}]")
            panel.set_ylabel(f"{pair[1]} [{shown[1]}]")
            panel.legend(loc="upper left", frameon=False, fontsize=8)
            panel.set_title(_told(contour, pair, units), loc="right", fontsize=8)
        for panel in panels[len(contours) :]:
            panel.set_visible(False)
        figure.suptitle(f"Contour of {pair[0]} and {pair[1]}", x=0.01, ha="left")
    return path


def _told(contour: Contour, pair: tuple[str, str], units: Sequence[str]) -> str:
    if units[0] == units[1]:
        return (
            f"error to the side: worst {contour.largest * 1e6:.3g} µ{units[0]}, "
            f"rms {contour.rms * 1e6:.3g} µ{units[0]}"
        )
    worst = [
        f"{name} {_largest(off) * 1e6:.3g} µ{unit}"
        for name, off, unit in zip(pair, contour.off, units, strict=True)
    ]
    return f"each axis' own error: worst {', '.join(worst)}"


def _times(contours: Sequence[Contour], *, alike: bool) -> int:
    """Return how often the error is drawn, the same in all runs and in both directions."""
    sizes = [
        max(float(np.ptp(c.path[k])) if len(c.path[k]) else 0.0 for c in contours) for k in (0, 1)
    ]
    if alike:
        return _magnified(max(sizes), max(contour.largest for contour in contours))
    errors = [max(_largest(contour.off[k]) for contour in contours) for k in (0, 1)]
    return min(map(_magnified, sizes, errors))


def _magnified(size: float, largest: float) -> int:
    """Return 1, 2 or 5 times a power of ten: how often the error is drawn."""
    if not 0.0 < largest < size * DRAWN_SHARE:
        return 1
    wanted = DRAWN_SHARE * size / largest
    power = 10 ** math.floor(math.log10(wanted))
    return int(power * max(step for step in (1, 2, 5) if step * power <= wanted))


def _common(run: ComparedRun, pair: tuple[str, str]) -> slice:
    rows = [run.axes[name].rows for name in pair]
    return slice(max(r.start for r in rows), min(r.stop for r in rows))


def _pairs(run: ComparedRun) -> Iterator[tuple[str, str]]:
    """Yield the axes of each program of two that the run followed, as its log tells."""
    config = run.recording.metadata.get("config")
    if not isinstance(config, Mapping):
        return
    programs, axes = config.get("programs") or {}, config.get("axes") or {}
    followed = {axis.get("program") for axis in axes.values() if isinstance(axis, Mapping)}
    moved = [_names(motion) for motion in run.recording.metadata.get("motions") or ()]
    for name, program in programs.items():
        names = _names(program)
        if len(names) == 2 and (names in moved or (not moved and name in followed)):
            yield names[0], names[1]


def _names(described: Any) -> tuple[str, ...]:
    found = described.get("axes") if isinstance(described, Mapping) else None
    return tuple(str(name) for name in found) if isinstance(found, list | tuple) else ()
