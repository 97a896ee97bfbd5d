"""One plant: the rich motion, cut ever shorter, and motions chosen one after the other."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from motorctl.close_loop.motion import Motions, machine_on
from motorctl.close_loop.rigs import SimulatedRig
from motorctl.close_loop.telling import record_telling
from motorctl.config import load
from motorctl.errors import DataError, MotorctlError
from motorctl.experiment.reach import reach_in_envelope
from motorctl.experiment.session import standing
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import AxisDiagnosis
from motorctl.identify.fit.declared_models import declared_models
from motorctl.log import Recording, read_recording
from motorctl.log.recording import AxisRecording
from motorctl.loop.simulation import simulate
from motorctl_benchmarks.diagnosis.answer import answer_of
from motorctl_benchmarks.diagnosis.cases import Case
from motorctl_benchmarks.diagnosis.score import exact_set, no_wrong_name

CUTS_S = (3.0, 6.0, 12.0)
"""Lengths to which the rich motion is cut, to see from when on it would have been enough."""
TIMED = ("input_lag", "input_delay")


@dataclass(frozen=True)
class Outcome:
    """How long a motion was, and what was known after it."""

    motion_s: float = math.nan
    settled: bool = False
    """By the rule by which chosen motions end: no name, no effect and no large error is open."""
    exact: bool = False
    """All that was put in is named, and nothing else."""
    no_wrong_name: bool = False
    time_error: float = math.nan
    """Of a lag or delay that is named rightly, in parts."""
    inseparable: tuple[str, ...] = ()
    still_open: tuple[str, ...] = ()
    answer: str = ""


@dataclass(frozen=True)
class Compared:
    """One plant."""

    key: str
    family: str
    truth: dict[str, Any]
    strength: float
    rich: Outcome = Outcome()
    """The whole of it."""
    rich_cut: Outcome = Outcome()
    """The shortest cut after which all was settled; the whole where none was."""
    chosen: Outcome = Outcome()
    motions: tuple[str, ...] = ()
    failed: str = ""

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def compare(case: Case, family: str, folder: Path) -> Compared:
    """Run both on a plant; a failure is its outcome, so that the others go on."""
    truth = {name: dict(options) for name, options in case.truth.items()}
    bare = Compared(case.name, family, truth, case.strength)
    try:
        return _compared(case, bare, folder)
    except MotorctlError as error:
        return dataclasses.replace(bare, failed=str(error).splitlines()[0])


def _compared(case: Case, bare: Compared, folder: Path) -> Compared:
    config = folder / "config.yaml"
    config.write_text(yaml.safe_dump(dict(case.config), sort_keys=False), encoding="utf-8")
    machine = load(config)
    motion = machine_on(machine, "rich", Motions())
    log = folder / "rich.parquet"
    simulate(motion, log)
    whole = read_recording(log, gaps="keep")
    lasts_s = motion.programs[f"rich_{case.axis}"].trajectories()[case.axis].duration_s
    rich = cut = _after(case, whole, config, lasts_s)
    if rich.settled:
        for length_s in CUTS_S:
            shorter = _after(case, _beginning(whole, length_s), config, length_s)
            if shorter.settled:
                cut = shorter
                break
    told = record_telling(
        config, folder, Motions(), SimulatedRig(), lambda _what, _share: None, [case.axis]
    )
    axis = told.diagnosis.axes.get(case.axis)
    chosen = _outcome(case, axis, told.duration_s)
    chosen = dataclasses.replace(
        chosen,
        settled=told.standing.settled,
        inseparable=tuple(each.words for each in told.standing.inseparable),
        still_open=told.standing.open_words,
    )
    motions = tuple(each.candidate.words for each in told.experiments)
    return dataclasses.replace(bare, rich=rich, rich_cut=cut, chosen=chosen, motions=motions)


def _after(case: Case, recording: Recording, config: Path, motion_s: float) -> Outcome:
    """Diagnose a recording, and ask the same questions as after a chosen motion."""
    machine = load(config)
    models = declared_models(recording, None, case.axis)
    try:
        found = diagnose_recording(recording, models)
    except DataError as error:
        return Outcome(motion_s, answer=str(error).splitlines()[0])
    reaches = {name: reach_in_envelope(machine, axis) for name, axis in machine.axes.items()}
    now = standing(found, reaches, (), [case.axis])
    return dataclasses.replace(
        _outcome(case, found.axes.get(case.axis), motion_s),
        settled=now.settled,
        inseparable=tuple(each.words for each in now.inseparable),
        still_open=now.open_words,
    )


def _outcome(case: Case, axis: AxisDiagnosis | None, motion_s: float) -> Outcome:
    if axis is None:
        return Outcome(motion_s, answer="not diagnosed")
    answer = answer_of(axis, math.nan, math.nan)
    error = math.nan
    for effect in axis.effects:
        if effect.name in TIMED and effect.name in case.truth:
            true_s = case.truth[effect.name]["time_s"]
            error = (effect.effect.lag_s + effect.effect.delay_s) / true_s - 1.0
    return Outcome(
        motion_s,
        exact=exact_set(case.truth, answer),
        no_wrong_name=no_wrong_name(case.truth, answer),
        time_error=error,
        answer=str(answer),
    )


def _beginning(recording: Recording, seconds: float) -> Recording:
    """Return the first seconds of a recording."""
    rows = round(seconds * recording.sample_rate_hz)

    def shortened(part: AxisRecording | Recording) -> dict[str, Any]:
        own = {each.name: getattr(part, each.name) for each in dataclasses.fields(part)}
        return {k: v[:rows].copy() for k, v in own.items() if isinstance(v, np.ndarray)}

    axes = {
        name: dataclasses.replace(axis, theta_hat={}, **shortened(axis))
        for name, axis in recording.axes.items()
    }
    return dataclasses.replace(recording, axes=axes, **shortened(recording))
