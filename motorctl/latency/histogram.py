"""Histograms as text: logarithmic bins and bars, and end bins for what is off the chart."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from motorctl.latency.durations import Array, Durations

EDGES_US = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000)
EDGES_S: Array = np.array(EDGES_US) * 1e-6
BAR = 20


def bin_names() -> list[str]:
    """Name the bins, the two end bins included."""
    names = [_us(edge) for edge in EDGES_US]
    inner = [f"{low} – {high}" for low, high in itertools.pairwise(names)]
    return [f"< {names[0]}", *inner, f">= {names[-1]}"]


def histogram_document(durations: Durations) -> dict[str, Any]:
    """Return edges [us] and counts; the first is below the first edge, the last beyond the last."""
    return {"edges_us": list(EDGES_US), "counts": durations.between(EDGES_S).tolist()}


def histogram_lines(subjects: Mapping[str, Durations]) -> list[str]:
    """Draw histograms beside each other, without bins that are empty in all of them."""
    counts = {name: d.between(EDGES_S) for name, d in subjects.items()}
    decades = max((math.log10(1.0 + c.max()) for c in counts.values()), default=1.0) or 1.0
    used = np.flatnonzero(sum(counts.values()))
    names = bin_names()
    label = max(len(name) for name in names)
    heads = "".join(f"  {name:<{BAR + 11}}" for name in subjects)
    lines = [f"{'us':>{label}}{heads}".rstrip()]
    for k in range(used[0], used[-1] + 1) if used.size else ():
        cells = ""
        for column in counts.values():
            count = int(column[k])
            length = math.ceil(BAR * math.log10(1.0 + count) / decades)
            bar = "█" * length
            cells += f"  {bar:<{BAR}} {count:>10}"
        lines.append(f"{names[k]:>{label}}{cells}")
    return lines


def _us(edge: float) -> str:
    return f"{edge:g}" if edge < 1000 else f"{edge / 1000:g} ms"
