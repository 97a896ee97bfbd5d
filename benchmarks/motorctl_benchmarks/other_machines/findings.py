"""Machines of other hands as a subject of the bench: figures, notes and mistakes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from motorctl.latency.progress import Progress
from motorctl_benchmarks.diagnosis.groups import HELD_OUT_SEED
from motorctl_benchmarks.diagnosis.outcome_report import calibration_document, calibration_lines
from motorctl_benchmarks.diagnosis.reliability_picture import draw_reliability
from motorctl_benchmarks.findings import Findings
from motorctl_benchmarks.other_machines.figures import (
    judgements,
    lines_by_generator,
    machine_figures,
)
from motorctl_benchmarks.other_machines.generators import (
    HOW_TO_INSTALL,
    LOADERS,
    MachineKey,
    clean_keys,
    machine_keys,
    usable_generators,
)
from motorctl_benchmarks.other_machines.run_machine import MachineOutcome, run_machine
from motorctl_benchmarks.worker_pool import run_tasks


@dataclass(frozen=True)
class MachinesOptions:
    """What is asked for."""

    cases: int = 1
    """Seeds of each kind of each generator."""
    first_seed: int = HELD_OUT_SEED
    workers: int | None = None
    """As many as there are CPUs for this process, if not given."""
    out: Path | None = None
    """A file to which every case is written as a line of JSON."""
    plot: Path | None = None
    """A picture of how often names were right over their confidence."""
    clean: int | None = None
    """So many clean machines alone, each friction with each noise in turn."""
    only: tuple[MachineKey, ...] = ()
    """Nothing but these machines."""


def machine_findings(progress: Progress, options: MachinesOptions) -> Findings:
    """Diagnose the machines and score what is said of them.

    Raises UsageError where the file cannot be written, RunError where a worker dies.
    """
    keys = options.only or _keys(options)
    outcomes = run_tasks(run_machine, keys, progress, options.workers, options.out)
    scored = [outcome for outcome in outcomes if outcome.result != "not recorded"]
    sound = [outcome for outcome in scored if not outcome.kind.mistake]
    if options.plot is not None:
        authors = dict.fromkeys(outcome.key.generator for outcome in sound)
        draw_reliability(
            options.plot, {name: [o for o in sound if o.key.generator == name] for name in authors}
        )
    answers = [f"{o.key}: {o.story}: {o}" for o in outcomes] if options.only else []
    return Findings(
        figures=tuple(machine_figures(scored)),
        notes=(
            *_notes(outcomes, scored),
            *lines_by_generator(scored),
            *calibration_lines(sound),
            *answers,
        ),
        mistakes=tuple(machine_mistakes(scored)),
        data={
            "cases": [str(outcome.key) for outcome in outcomes],
            "judged": judgements(scored),
            "calibration": calibration_document(sound),
        },
    )


def _keys(options: MachinesOptions) -> list[MachineKey]:
    if options.clean is not None:
        return clean_keys(options.clean, options.first_seed)
    return machine_keys(options.cases, options.first_seed)


def machine_mistakes(outcomes: Sequence[MachineOutcome]) -> list[dict[str, str]]:
    """Return every answer that is not right enough, with the key that draws its machine again."""
    return [
        {"case": str(outcome.key), "truth": outcome.key.kind, "answer": str(outcome)}
        for outcome in outcomes
        if not outcome.right
    ]


def _notes(outcomes: Sequence[MachineOutcome], scored: Sequence[MachineOutcome]) -> list[str]:
    notes = [
        f"Cases: {len(scored)} machines of generators that were written apart from motorctl and "
        "share no code with it; the diagnosis gets their columns alone, and C1 is declared. A "
        "mistake is one that is made with a clean machine's columns."
    ]
    absent = [name for name in LOADERS if name not in usable_generators()]
    if absent:
        notes.append(
            f"{' and '.join(absent)}: what it needs is not installed, so its machines are left "
            f"out ({HOW_TO_INSTALL})."
        )
    for outcome in outcomes:
        if outcome.result == "not recorded":
            notes.append(f"{outcome.key}: left out, {outcome}")
    count = Counter(outcome.judged for outcome in scored)
    words = ", ".join(f"{word} {number}" for word, number in count.most_common())
    return [*notes, f"Answers: {words or 'none'}."]
