"""The demonstration as one self-contained page."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from motorctl import __version__
from motorctl.demo.tables import published_beside_ours, verdict
from motorctl.insight.compare import Comparison
from motorctl.insight.published import PAPER, TURNAROUND_S
from motorctl.loop.simulation import Simulation

TITLES = {
    "tracking_error": "Tracking error, axis {axis}",
    "command": "Control input, axis {axis}",
    "estimates": "Parameter estimates, axis {axis}",
    "turnaround": "Turnaround",
}
TEXTS = {
    "estimates": (
        "Dashed lines are the bounds. An estimate that runs into one says that the plant has "
        "something that the model lacks: here actuator lag and delay, and cogging."
    ),
}


def write_page(
    path: Path,
    comparison: Comparison,
    simulations: Mapping[str, Simulation],
    pictures: Sequence[Path],
) -> Path:
    """Write the page, pictures inside it; gives its path."""
    environment = Environment(
        loader=PackageLoader("motorctl.demo", "."),
        autoescape=select_autoescape(),
        undefined=StrictUndefined,
    )
    tables = [
        {
            "axis": axis,
            "rows": [
                {"name": name, "cells": cells, "ratio": "/" in name}
                for name, cells in published_beside_ours(comparison, axis)
            ],
        }
        for axis in comparison.axes
    ]
    seeds = comparison.runs[0].recording.metadata["seed"]
    html = environment.get_template("page.html").render(
        paper=PAPER,
        version=__version__,
        seed=", ".join(str(seed) for seed in seeds.values()),
        verdict=verdict(comparison),
        tables=tables,
        pictures=[_picture(p, simulations) for p in pictures],
    )
    path.write_text(html, encoding="utf-8")
    return path


def _picture(path: Path, simulations: Mapping[str, Simulation]) -> dict[str, Any]:
    kind, _, axis = path.stem.rpartition("_") if path.stem not in TITLES else (path.stem, "", "")
    text = TEXTS.get(kind, "")
    if kind == "turnaround":
        ours = ", ".join(
            f"{name} {1e6 * run.turnaround['p50_s']:.1f} µs (published "
            f"{1e6 * TURNAROUND_S[name]:.0f} µs)"
            for name, run in simulations.items()
        )
        text = (
            f"Both axes, read to end of write, while time is virtual. Median: {ours}. "
            f"For this machine's wall-clock behaviour run motorctl latency."
        )
    data = base64.b64encode(path.read_bytes()).decode()
    return {"title": TITLES[kind].format(axis=axis), "text": text, "data": data}
