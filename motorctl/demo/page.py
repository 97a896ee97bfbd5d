"""The demonstration as one self-contained page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from motorctl.close_loop.rounds import ClosedLoop
from motorctl.close_loop.tables import error_row
from motorctl.demo.experiment import Experiment
from motorctl.demo.tables import (
    before_and_after,
    first_sentence,
    found_beside_plant,
    gains,
    kept_effects,
    published_beside_ours,
    verdict,
)
from motorctl.errors import UsageError
from motorctl.html_pages import Figure, figure, write_page
from motorctl.identify.compare.measures import EXPLAINED, table_headings
from motorctl.identify.compare.published import PAPER, TURNAROUND_S
from motorctl.identify.compare.runs import Comparison
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
        "something that the model lacks."
    ),
}

WORTH_A_PICTURE = 0.1
"""Part of the explainable error."""


def write_demo(
    path: Path,
    experiment: Experiment,
    loop: ClosedLoop,
    report: Path,
    outcome: Sequence[Path],
) -> tuple[Path, list[Path]]:
    """Write the page with its pictures inside; return it and the pictures it shows.

    `report` is the closed loop's own page, `outcome` the tracking errors of C1, C2 and the refined
    model. Raises UsageError where it cannot be written.
    """
    comparison = experiment.comparison
    shown: list[Path] = []

    def picture(file: Path, title: str, text: str = "") -> Figure:
        shown.append(file)
        return figure(file, text, title)

    def experiment_pictures(*kinds: str) -> list[Figure]:
        split = [(p, *_kind(p)) for p in experiment.pictures]
        return [
            picture(p, TITLES[kind].format(axis=axis), _text(kind, experiment.simulations))
            for p, kind, axis in split
            if kind in kinds
        ]

    seeds = comparison.runs[0].recording.metadata["seed"]
    try:
        write_page(
            path,
            "motorctl.demo",
            "page.html",
            paper=PAPER,
            seed=", ".join(str(seed) for seed in seeds.values()),
            headings=table_headings(),
            measures=EXPLAINED,
            verdict=verdict(comparison),
            gains=gains(loop),
            tables=_published_tables(comparison),
            tracking=experiment_pictures("tracking_error"),
            axes=[_axis(loop, name, picture) for name in comparison.axes],
            recorded_s=f"{loop.rounds[0].diagnosis.duration_s:.0f}",
            changed=loop.first is not loop.last,
            left_out=[
                (name, words)
                for part in loop.rounds
                for name, dropped in part.attempts.dropped.items()
                for words in dropped
            ],
            after=[
                (axis, motion, *cells.values()) for axis, motion, cells in before_and_after(loop)
            ],
            outcome=[
                picture(p, f"Axis {name}", "As published, then step by step; published trajectory.")
                for p, name in zip(outcome, comparison.axes, strict=True)
            ],
            unused=[
                picture(p, f"Axis {name}", "C2 before and after, on moves that no fit has used.")
                for name in comparison.axes
                if (p := loop.folder / f"tracking_error_{name}_unused.png").is_file()
            ],
            more=experiment_pictures("command", "estimates", "turnaround"),
            ended=loop.ended,
            diffs=[part.accepted.refinement.diff for part in loop.rounds if part.accepted],
            report=report.relative_to(path.parent).as_posix(),
            refined=loop.refined.relative_to(path.parent).as_posix(),
        )
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    return path, shown


def _published_tables(comparison: Comparison) -> list[dict[str, Any]]:
    tables = []
    for axis in comparison.axes:
        rows = [[name, *cells] for name, cells in published_beside_ours(comparison, axis)]
        ends = [k + 1 for k, row in enumerate(rows) if "/" in row[0]]
        groups = [rows[begin:end] for begin, end in pairwise((0, *ends))]
        tables.append({"axis": axis, "groups": groups})
    return tables


def _axis(loop: ClosedLoop, name: str, picture: Any) -> dict[str, Any]:
    """Return what the first diagnosis says of an axis, and what all of them found and kept."""
    told = "What the declared model leaves of the command; below, what is left with what was found."
    wanted = [("residual", f"Residual of axis {name}", told)]
    for effect, found in kept_effects(loop, name).items():
        if found.explained_fraction >= WORTH_A_PICTURE:
            caption = found.effect.picture.caption
            wanted.append((effect, f"{found.effect.title}, axis {name}", caption))
    pictures = []
    for what, title, caption in wanted:
        files = (part.folder / f"{name}_{what}.png" for part in loop.rounds)
        if file := next((f for f in files if f.is_file()), None):
            pictures.append(picture(file, title, caption))
    return {
        "name": name,
        "declared": ", ".join(loop.first.machine.axes[name].declared.names),
        "sentence": first_sentence(loop, name),
        "found": found_beside_plant(loop, name),
        "pictures": pictures,
        "error": error_row(loop.overall[name]),
    }


def _kind(path: Path) -> tuple[str, str]:
    if path.stem in TITLES:
        return path.stem, ""
    kind, _, axis = path.stem.rpartition("_")
    return kind, axis


def _text(kind: str, simulations: Mapping[str, Simulation]) -> str:
    if kind != "turnaround":
        return TEXTS.get(kind, "")
    ours = ", ".join(
        f"{name} {1e6 * run.turnaround['p50_s']:.1f} µs (published "
        f"{1e6 * TURNAROUND_S[name]:.0f} µs)"
        for name, run in simulations.items()
    )
    return (
        f"Both axes, read to end of write, while time is virtual. Median: {ours}. "
        f"For this machine's wall-clock behaviour run motorctl latency."
    )
