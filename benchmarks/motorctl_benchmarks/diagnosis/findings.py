"""The campaign as a subject of the bench: its figures, notes and mistakes."""

from __future__ import annotations

from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.diagnosis.campaign import CampaignOptions, run_campaign, tasks_of
from motorctl_benchmarks.diagnosis.figures import by_group, campaign_figures
from motorctl_benchmarks.diagnosis.outcome_report import (
    calibration_document,
    calibration_lines,
    mistakes,
)
from motorctl_benchmarks.diagnosis.peers import MODULES, installed_peers
from motorctl_benchmarks.diagnosis.reliability_picture import draw_reliability
from motorctl_benchmarks.diagnosis.speed import speed_figures
from motorctl_benchmarks.findings import Findings

SPEED_CASES = 12
"""What measuring the time of a diagnosis takes, in cases of the campaign."""


def diagnosis_findings(progress: Progress, options: CampaignOptions) -> Findings:
    """Run the campaign, then measure time and memory with nothing else running."""
    count = len(tasks_of(options))
    share = 1.0 if options.only else count / (count + SPEED_CASES)
    outcomes = run_campaign(options, part_of(progress, 0.0, share))
    figures = campaign_figures(outcomes)
    notes = [
        f"Cases: {len(outcomes)} simulated machines with known causes, drawn by seed; the logs "
        "tell neither plant nor cause.",
    ]
    absent = [name for name in MODULES if name not in installed_peers()]
    if absent:
        notes.append(
            f"{' and '.join(absent)}: not installed, so not compared "
            "(pip install './benchmarks[peers]')."
        )
    if any(outcome.closed_loop is not None for outcome in outcomes):
        notes.append(
            "Refined / oracle: true error (the simulated plant's position minus the reference, "
            "rms) of the refined controller on a motion that no diagnosis has seen, over that of "
            "the machine without the effect under a declared model with the plant's parameters. "
            "Excess left: the same beyond the oracle, over what it is without compensation."
        )
    if not options.only:
        more, remarks = speed_figures(options.first_seed, part_of(progress, share, 1.0))
        figures += more
        notes += remarks
    groups = {name: [str(o.key) for o in cases] for name, cases in by_group(outcomes).items()}
    if options.plot is not None:
        draw_reliability(options.plot, by_group(outcomes))
    answers = [f"{o.key}: {o.title}: {o.answer}" for o in outcomes] if options.only else []
    return Findings(
        figures=tuple(figures),
        notes=(*notes, *calibration_lines(outcomes), *answers),
        mistakes=tuple(mistakes(outcomes)),
        data={"cases": groups, "calibration": calibration_document(outcomes)},
    )
