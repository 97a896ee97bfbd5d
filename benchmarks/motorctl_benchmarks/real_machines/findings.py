"""Machines that others recorded as a subject of the bench: what is missed, beside peers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motorctl.errors import UsageError
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.findings import Findings
from motorctl_benchmarks.real_machines.axes import AXES
from motorctl_benchmarks.real_machines.peer_models import PEERS
from motorctl_benchmarks.real_machines.repositories import (
    REPOSITORIES,
    folder_of,
)
from motorctl_benchmarks.real_machines.run_axis import AxisOutcome, AxisTask, run_axis
from motorctl_benchmarks.worker_pool import run_tasks

HOW_TO_FETCH = "python tools/fetch_recordings.py FOLDER"
HOW_TO_INSTALL = "pip install './benchmarks[peers]'"
NEVER = Target("value", "<=", 0.0)
WORSE = 1.02
"""Position missed over that of the declared model, from which a model counts as worse; that of the
diagnosis' own refutation."""
RUNS_AWAY = 1e6
"""Of any unit of a position. Convention."""
NAME_WIDTH, COLUMN_WIDTH = 36, 11


@dataclass(frozen=True)
class RecordingsOptions:
    """What is asked for."""

    recordings: Path | None = None
    """The folder of the public recordings."""
    workers: int | None = None
    out: Path | None = None
    only: tuple[str, ...] = ()
    """Names of axes; all by default."""


def recordings_findings(progress: Progress, options: RecordingsOptions) -> Findings:
    """Diagnose the public recordings on their first two thirds and judge on the rest.

    Raises UsageError where the recordings are missing or an axis is unknown.
    """
    folder = _folder(options.recordings)
    known = [axis.name for axis in AXES]
    for name in options.only:
        if name not in known:
            raise UsageError(f"there is no axis '{name}'; there are: {', '.join(known)}")
    tasks = [AxisTask(name, folder) for name in options.only or known]
    outcomes = run_tasks(run_axis, tasks, progress, options.workers, options.out)
    return Findings(
        figures=tuple(recordings_figures(outcomes)),
        notes=tuple(_notes(outcomes)),
        mistakes=tuple(
            {"case": o.axis, "truth": "what the machine has", "answer": o.said}
            for o in outcomes
            if o.false_names or o.crashed
        ),
        data={"axes": [outcome.document() for outcome in outcomes]},
    )


def _folder(recordings: Path | None) -> Path:
    if recordings is None:
        raise UsageError(f"--recordings names the folder of the recordings: {HOW_TO_FETCH}")
    missing = [name for name in REPOSITORIES if not folder_of(recordings, name).is_dir()]
    if missing:
        raise UsageError(f"{recordings} has no {', '.join(missing)}: {HOW_TO_FETCH}")
    return recordings


def recordings_figures(outcomes: Sequence[AxisOutcome]) -> list[Figure]:
    """Return how often names were false or positions worse, and how much each model misses."""
    judged = [o for o in outcomes if not math.isnan(o.ours)]
    false = sum(bool(o.false_names) for o in outcomes)
    worse = sum(o.ours > WORSE * o.declared for o in judged)
    crashed = sum(o.crashed for o in outcomes)
    figures = [
        Figure("false", f"false names (of {len(outcomes)})", false, "axes", target=NEVER),
        Figure(
            "worse",
            f"simulated position worse than the declared model's (of {len(judged)})",
            worse,
            "axes",
            target=NEVER,
        ),
        Figure("crashed", f"crashed (of {len(outcomes)})", crashed, "axes", target=NEVER),
    ]
    ours = _middle([o.ours / o.declared for o in judged])
    title = "position missed over that of the declared model, median"
    for name in PEERS:
        both = [o for o in judged if name in o.peers]
        if both:
            theirs = _middle([o.peers[name] / o.declared for o in both])
            figures.append(
                Figure(f"median_{name.split()[0].lower()}", title, ours, "", name, theirs)
            )
    if len(figures) == 3 and judged:
        figures.append(Figure("median", title, ours, ""))
    return figures


def _middle(ratios: Sequence[float]) -> float:
    """Return the median; what ran away to infinity counts as that."""
    finite = [ratio if math.isfinite(ratio) else math.inf for ratio in ratios]
    return float(np.median(finite)) if finite else math.nan


def _notes(outcomes: Sequence[AxisOutcome]) -> list[str]:
    present = [name for name in PEERS if any(name in o.peers for o in outcomes)]
    notes = [
        "Each model was fitted to the first two thirds of a recording and judged on the rest: the "
        "position [rms], predicted over windows from the measured state."
    ]
    if len(present) < len(PEERS):
        absent = ", ".join(name for name in PEERS if name not in present)
        notes.append(f"Not installed, so left out: {absent} ({HOW_TO_INSTALL}).")
    titles = ("window", "unit", "C1", "motorctl", *(name.split()[0] for name in present))
    notes.append(_row("axis", titles, "said"))
    for o in outcomes:
        numbers = (o.declared, o.ours, *(o.peers.get(name, math.nan) for name in present))
        cells = (o.unit, *map(_cell, numbers))
        window = "-" if math.isnan(o.window_s) else f"{1e3 * o.window_s:.3g} ms"
        notes.append(_row(o.axis, (window, *cells), o.said))
    return notes


def _cell(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.3g}" if value < RUNS_AWAY else "runs away"


def _row(name: str, cells: Sequence[str], said: str) -> str:
    return name.ljust(NAME_WIDTH) + "".join(c.rjust(COLUMN_WIDTH) for c in cells) + "  " + said
