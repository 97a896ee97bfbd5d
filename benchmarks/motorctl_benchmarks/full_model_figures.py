"""A whole tick where every axis has as many parameters as a model may have."""

from __future__ import annotations

import numpy as np

from motorctl.config.machine import MOST_PARAMETERS
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.gantries import gantry_with, gantry_with_full_models
from motorctl_benchmarks.interleave import interleaved
from motorctl_benchmarks.tick_probe import TickProbe

TICKS = 250
ROUNDS = 40
BUSY_SHARE = 0.9
"""Of the rounds, the one whose ticks are told: axes rest for two thirds of their program, and learn
nothing meanwhile. More tells of this computer's pauses. By hand."""
PERIOD_PART = 0.25
"""Of the period, that the ticks of the largest models may take: what is left is the buses' and the
pauses'. By hand."""


def full_model_figures(progress: Progress) -> tuple[list[Figure], list[str]]:
    """Measure the published gantry with its own models and with full ones, while they learn."""
    own, full = gantry_with(2), gantry_with_full_models()
    with TickProbe(own) as a, TickProbe(full) as b:
        progress(0.5)
        subjects = {
            "own": lambda: float(np.median(a.run(TICKS)[:, 0])),
            "full": lambda: float(np.median(b.run(TICKS)[:, 0])),
        }
        times = interleaved(subjects, ROUNDS, lambda share: progress(0.5 + 0.5 * share))
    busy = {name: float(np.quantile(taken, BUSY_SHARE)) for name, taken in times.items()}
    figure = Figure(
        name="tick_full_models",
        title=f"learning tick of 2 axes with {MOST_PARAMETERS} parameters each",
        value=busy["full"] * 1e6,
        unit="us",
        peer="their own models",
        peer_value=busy["own"] * 1e6,
        ratio=busy["own"] / busy["full"],
        target=Target("value", "<", PERIOD_PART * full.period_s * 1e6),
    )
    return [figure], []
