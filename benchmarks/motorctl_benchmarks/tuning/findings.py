"""`motorctl bench tuning`: tuned gains beside the best of a grid that is run by brute force.

They are tuned to the measured response of each axis, and to the log of its program alone."""

from __future__ import annotations

import math
import tempfile
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from motorctl.config.analysis import LoopMargins
from motorctl.errors import MotorctlError
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl.response.measurement import Measurement, measure_response
from motorctl.response.plan import plan_response
from motorctl.response.rigs import record_simulated
from motorctl.tune.candidates import MarginsWanted
from motorctl.tune.tuning import record_program, tune
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.tuning.grid import best_of_grid, run_with
from motorctl_benchmarks.tuning.machines import TunedMachine, drawn_machine, shipped_machines
from motorctl_benchmarks.worker_pool import run_tasks

WANTED = MarginsWanted(30.0, 10.0 ** (6.0 / 20.0), command_noise_v=10.0)
"""As much noise as there is voltage: no gains of the grid are left out for theirs."""
NEAR = 1.1
"""The tuned error may be so many times the best of the grid."""


@dataclass(frozen=True)
class TuningOptions:
    """What is asked for."""

    plants: int = 20
    first_seed: int = 970_000
    workers: int | None = None
    out: Path | None = None


@dataclass(frozen=True)
class Tuned:
    """What came of one machine; NaN where it was refused."""

    name: str
    before_m: float = math.nan
    tuned_m: float = math.nan
    predicted_m: float = math.nan
    best_m: float = math.nan
    runs: int = 0
    phase_deg: float = math.nan
    gain_db: float = math.nan
    """Around the true plant, as the phase margin."""
    unstable_corners: int = 0
    refused: str = ""
    by_log_m: float = math.nan
    """The error where a log of the program alone was tuned to, without a response."""
    by_log_phase_deg: float = math.nan
    filter_kind: str = ""
    """Of the filter of the command that was chosen with the gains; the grid has none."""

    @property
    def by_log_ratio(self) -> float:
        """That error over the best of the grid."""
        return self.by_log_m / self.best_m

    @property
    def ratio(self) -> float:
        """The tuned error over the best of the grid."""
        return self.tuned_m / self.best_m

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self) | {"ratio": self.ratio, "by_log_ratio": self.by_log_ratio}


def tuning_findings(progress: Progress, options: TuningOptions) -> Findings:
    """Tune the shipped gantry's axes and plants that are drawn, and run a grid of each."""
    with tempfile.TemporaryDirectory(prefix="motorctl-") as folder:
        tasks: list[int | str] = ["x", "y"]
        tasks += range(options.first_seed, options.first_seed + options.plants)
        run = partial(tune_one, Path(folder))
        rows = run_tasks(run, tasks, progress, options.workers, options.out)
    judged = [row for row in rows if not row.refused]
    near = sum(row.ratio <= NEAR for row in judged)
    figures = (
        Figure("near", f"tuned within {NEAR:g} of the best of a grid", 100.0 * near / len(rows),
               "%", target=Target("value", ">=", 100.0)),
        Figure("worst", "largest ratio to the best of the grid",
               max((row.ratio for row in judged), default=math.nan), "x",
               target=Target("value", "<=", NEAR)),
        Figure("phase", "smallest phase margin around the true plant",
               min((row.phase_deg for row in judged), default=math.nan), "deg",
               target=Target("value", ">=", WANTED.phase_deg)),
        Figure("unstable", "unstable corners of the bounds",
               float(sum(row.unstable_corners for row in judged)), "",
               target=Target("value", "<=", 0.0)),
    )  # fmt: skip
    table = TextTable(
        "eF in µm at 30 degrees and 6 dB",
        (
            "machine",
            "before",
            "tuned",
            "predicted",
            "best of grid",
            "ratio",
            "true margins",
            "by a log alone",
        ),
        tuple(_cells(row) for row in rows),
    )
    notes = (
        f"{sum(row.runs for row in rows)} runs of grids",
        *(f"{row.name}: refused: {row.refused}" for row in rows if row.refused),
    )
    return Findings(
        figures, notes, data={"machines": [row.document() for row in rows]}, tables=(table,)
    )


def tune_one(folder: Path, task: int | str) -> Tuned:
    """Tune one machine, run what came out, and run the grid."""
    place = Path(tempfile.mkdtemp(dir=folder))
    machine = (
        next(m for m in shipped_machines(place) if m.axis == task)
        if isinstance(task, str)
        else drawn_machine(place, task)
    )
    ready, axis = machine.machine, machine.axis
    try:
        log = record_program(ready, axis, place / "before.parquet", _quiet)
        tuning = tune(log, ready, axis, WANTED, _quiet, _response(machine, place))
    except MotorctlError as error:
        return Tuned(machine.name, refused=str(error))
    best_m, runs = best_of_grid(machine, WANTED, place)
    if not runs:
        return Tuned(machine.name, refused="no gains of the grid keep the margins")
    true = machine.margins(tuning.gains)
    by_log_m, by_log_phase_deg = math.nan, math.nan
    with suppress(MotorctlError):
        by_log = tune(log, ready, axis, WANTED, _quiet).gains
        by_log_m = run_with(machine, by_log, place)
        by_log_phase_deg = _phase(machine.margins(by_log))
    return Tuned(
        name=machine.name,
        before_m=tuning.loop.eF_m,
        tuned_m=run_with(machine, tuning.gains, place),
        predicted_m=tuning.chosen.prediction.eF_m,
        best_m=best_m,
        runs=runs,
        phase_deg=_phase(true),
        gain_db=20.0 * math.log10(true.gain_margin or math.inf),
        unstable_corners=machine.unstable_corners(tuning.gains),
        by_log_m=by_log_m,
        by_log_phase_deg=by_log_phase_deg,
        filter_kind=own.kind if (own := tuning.gains.command_filter) else "",
    )


def _response(machine: TunedMachine, folder: Path) -> Measurement:
    """Measure the axis' response, as `motorctl response` does by itself."""
    ready, axis = machine.machine, machine.axis
    plan = plan_response(ready.axes[axis], ready.period_of(axis))
    log = record_simulated(ready, plan, folder / "response.parquet", _quiet)
    return measure_response([log], axis)


def _phase(told: LoopMargins) -> float:
    """Return the phase margin [degrees]; 0 where the loop is unstable."""
    return (told.phase_margin_deg or 0.0) if told.stable else 0.0


def _quiet(_what: str, _share: float) -> None:
    """Tell nobody: a worker has no terminal."""


def _cells(row: Tuned) -> tuple[str, ...]:
    errors = (row.before_m, row.tuned_m, row.predicted_m, row.best_m)
    behind = f" ({row.filter_kind})" if row.filter_kind else ""
    return (
        row.name,
        *(f"{value * 1e6:.3g}" for value in errors),
        f"{row.ratio:.2f}{behind}",
        f"{row.phase_deg:.1f} deg, {row.gain_db:.1f} dB",
        f"{row.by_log_ratio:.2f}, {row.by_log_phase_deg:.1f} deg",
    )
