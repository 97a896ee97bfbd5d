"""Speed of the law, the tick, virtual time and the first start, as ratios to peers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from motorctl.latency.figure import Figure
from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.findings import Findings
from motorctl_benchmarks.full_model_figures import full_model_figures
from motorctl_benchmarks.law_figures import law_figures
from motorctl_benchmarks.start_figures import start_figures
from motorctl_benchmarks.tick_figures import tick_figures
from motorctl_benchmarks.virtual_figures import virtual_figures

Part = Callable[[Progress], tuple[list[Figure], list[str]]]

SPEED: Sequence[Part] = (
    law_figures,
    tick_figures,
    virtual_figures,
    start_figures,
    full_model_figures,
)
"""Measured one after the other."""


def speed_findings(progress: Progress) -> Findings:
    """Return the figures of every part, measured one after the other."""
    figures: list[Figure] = []
    notes: list[str] = []
    for k, part in enumerate(SPEED):
        more, remarks = part(part_of(progress, k / len(SPEED), (k + 1) / len(SPEED)))
        figures += more
        notes += remarks
    return Findings(tuple(figures), tuple(notes))
