"""`motorctl bench experiments`: motion time to certainty, rich against chosen motions."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from motorctl.errors import UsageError
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.experiments.plants import FAMILIES, draw_plant
from motorctl_benchmarks.experiments.run_plant import TIMED, Compared, Outcome, compare
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.worker_pool import run_tasks

HALF = 0.5
"""Of the rich motion's time that chosen motions may take."""
WITHIN = 0.1
"""Of a lag or delay, in parts."""


@dataclass(frozen=True)
class ExperimentsOptions:
    """What is asked for."""

    plants: int = 60
    first_seed: int = 980_000
    workers: int | None = None
    out: Path | None = None
    families: tuple[str, ...] = FAMILIES
    """In turn; raises UsageError of one that is none."""

    def __post_init__(self) -> None:
        """Look at the families."""
        for family in self.families:
            if family not in FAMILIES:
                known = ", ".join(f'"{each}"' for each in FAMILIES)
                raise UsageError(f"--only {family}: plants are of these kinds: {known}")


def experiments_findings(progress: Progress, options: ExperimentsOptions) -> Findings:
    """Run every plant."""
    with tempfile.TemporaryDirectory(prefix="motorctl-") as folder:
        tasks = list(range(options.plants))
        run = partial(run_one, Path(folder), options.first_seed, options.families)
        rows = run_tasks(run, tasks, progress, options.workers, options.out)
    return found_of(rows)


def run_one(folder: Path, first_seed: int, families: tuple[str, ...], k: int) -> Compared:
    """Run the k-th plant."""
    family = families[k % len(families)]
    place = Path(tempfile.mkdtemp(dir=folder))
    return compare(draw_plant(first_seed + k, family), family, place)


def found_of(rows: Sequence[Compared]) -> Findings:
    """Return figures and tables of plants that were run."""
    ran = [row for row in rows if not row.failed]
    times = [row.chosen.motion_s / row.rich.motion_s for row in ran]
    median = float(np.median(times)) if times else math.nan
    timed = [row for row in ran if set(row.truth) & set(TIMED)]
    alike = sum(bool(row.chosen.inseparable) for row in timed)
    told = [row for row in timed if row.chosen.settled and not row.chosen.inseparable]
    errors = [100.0 * abs(row.chosen.time_error) for row in told]
    within = sum(error <= 100.0 * WITHIN for error in errors)
    apart = sum(row.chosen.exact for row in told)
    figures = (
        Figure("time", "motion time of chosen motions over that of the rich motion, median",
               median, "", target=Target("value", "<=", HALF)),
        Figure("as_certain", "plants settled by chosen motions", _share(ran, "chosen", "settled"),
               "%", "the whole rich motion", _share(ran, "rich", "settled")),
        Figure("named", "plants whose effects are named, and no other",
               _share(ran, "chosen", "exact"), "%", "the whole rich motion",
               _share(ran, "rich", "exact")),
        Figure("within", f"lags and delays told apart that are within {100 * WITHIN:g} %",
               100.0 * within / len(told) if told else math.nan, "%",
               target=Target("value", ">=", 100.0)),
        Figure("apart", "lags and delays told apart that are named rightly",
               100.0 * apart / len(told) if told else math.nan, "%"),
    )  # fmt: skip
    notes = [
        f"{len(told)} of {len(timed)} lags and delays told apart, {alike} said to be inseparable "
        f"within the envelope, {len(timed) - len(told) - alike} still open",
        *(f"{row.key}: failed: {row.failed}" for row in rows if row.failed),
    ]
    mistakes = [
        {"case": row.key, "truth": ", ".join(row.truth), "answer": row.chosen.answer}
        for row in ran
        if not row.chosen.no_wrong_name
    ]
    tables = (_by_family(ran), _each(ran))
    data = {"plants": [row.document() for row in rows]}
    return Findings(figures, tuple(notes), tuple(mistakes), data, tables)


def _share(rows: Sequence[Compared], which: str, what: str) -> float:
    if not rows:
        return math.nan
    return 100.0 * sum(bool(getattr(getattr(row, which), what)) for row in rows) / len(rows)


def _by_family(rows: Sequence[Compared]) -> TextTable:
    lines = []
    for family in (*FAMILIES, "all"):
        own = [row for row in rows if family in (row.family, "all")]
        if not own:
            continue
        columns: list[list[Outcome]] = [
            [row.rich for row in own],
            [row.rich_cut for row in own],
            [row.chosen for row in own],
        ]
        cells = [family, str(len(own))]
        for outcomes in columns:
            settled = sum(each.settled for each in outcomes)
            exact = sum(each.exact for each in outcomes)
            median_s = float(np.median([each.motion_s for each in outcomes]))
            cells.append(f"{median_s:.1f} s, {settled}, {exact}")
        lines.append(tuple(cells))
    return TextTable(
        "median time in motion, how many settled, how many exact",
        ("plants with", "number", "rich, whole", "rich, cut when settled", "chosen"),
        tuple(lines),
    )


def _each(rows: Sequence[Compared]) -> TextTable:
    lines = tuple(
        (
            " + ".join(row.truth),
            f"{row.strength:.2f}",
            f"{row.rich.motion_s:.1f}",
            f"{row.rich_cut.motion_s:.1f}" if row.rich_cut.settled else "-",
            f"{row.chosen.motion_s:.1f}" if row.chosen.settled else "-",
            str(len(row.motions)),
            "inseparable" if row.chosen.inseparable else ("exact" if row.chosen.exact else "not"),
            "" if math.isnan(row.chosen.time_error) else f"{100 * row.chosen.time_error:+.1f} %",
        )
        for row in rows
    )
    return TextTable(
        "each plant; times in s until all was settled",
        ("truth", "strength", "rich", "rich cut", "chosen", "motions", "named", "time error"),
        lines,
    )
