"""The whole story: the published experiment, then what the model lacks, found and compensated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.close_loop.report import write_reports
from motorctl.close_loop.rounds import ClosedLoop, close_loop
from motorctl.demo.experiment import Experiment, run_experiment
from motorctl.demo.page import write_demo
from motorctl.errors import UsageError
from motorctl.identify.compare.pictures import plot_tracking_error
from motorctl.identify.compare.runs import Comparison, compare

CONFIG = "published_gantry"
ROUNDS = 1
REFINED = "C2 refined"
MATCHED = "C2 refined, velocity matched"


@dataclass(frozen=True)
class Story:
    """What the demonstration found."""

    experiment: Experiment
    loop: ClosedLoop
    outcome: Comparison
    """C1, C2 and the refined model on the published trajectory."""
    pictures: list[Path]
    """Every picture on the page."""
    page: Path


def tell(out: Path, progress: Callable[[str, float], None], config: str = CONFIG) -> Story:
    """Run the demonstration on a simulated machine; everything that it makes goes into `out`.

    progress(what, share) is told what is being done, and how much of it is. Raises UsageError
    where `out` cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror}") from error
    experiment = run_experiment(config, out, progress)
    loop = close_loop(config, out / "closed_loop", rounds=ROUNDS, progress=progress)
    progress("writing reports", 0.0)
    report = write_reports(loop)
    outcome = _outcome(experiment, loop)
    shown = [
        plot_tracking_error(outcome, axis, out / f"outcome_{axis}.png") for axis in outcome.axes
    ]
    page, pictures = write_demo(out / "index.html", experiment, loop, report, shown)
    progress("done", 1.0)
    return Story(experiment, loop, outcome, pictures, page)


def _outcome(experiment: Experiment, loop: ClosedLoop) -> Comparison:
    """Set the refined model's run beside those of C1 and C2, on the same trajectory."""
    runs = experiment.comparison.runs
    stages = {REFINED: loop.by_effects}
    if loop.last is not loop.by_effects:
        stages[MATCHED] = loop.last
    later = [
        replace(compare([trial.recordings["own"]]).runs[0], label=label)
        for label, trial in stages.items()
    ]
    return Comparison((*runs, *later), experiment.comparison.axes)
