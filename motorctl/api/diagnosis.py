"""Find out from a recording what the declared model lacks, and write it into a configuration."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from motorctl.api.recordings import AnyRecording, open_for_diagnosis

if TYPE_CHECKING:
    from motorctl.identify.diagnose.result import RecordingDiagnosis
    from motorctl.identify.refine.refinement import Refinement
    from motorctl.log import Recording
    from motorctl.long_logs.long_log import LongLog
    from motorctl.model import Effect, EffectList

Progress = Callable[[str, float], None]


def diagnose(
    recording: AnyRecording,
    *,
    model: str | None = None,
    axis: str | None = None,
    evaluate: AnyRecording | None = None,
    whole_run: bool = False,
    allow_code: Sequence[str] = (),
    progress: Progress | None = None,
) -> RecordingDiagnosis:
    """Trace what the declared model leaves to its cause.

    A recording of any other machine is described by a YAML file that names its columns and units;
    its path is then the recording.

    Of a long log, seven minutes at 5 kHz or more, no more is read of each axis than stretches in
    which the declared model leaves most, and others that tell most of its parameters;
    `axes[...].read` tells which. The verdict speaks of these.

    Parameters
    ----------
    recording
        A `Log`, a path, or the paths of several logs of one run.
    model
        C1, C2 or a configuration; None: what the log declares, or C1.
    axis
        This axis only; None: all.
    evaluate
        A second recording, on which the errors are measured.
    whole_run
        A log stands for all logs of its run in its folder.
    allow_code
        Modules that may be imported where the log's configuration names effects in them.
    progress
        Told what is being done, and the share that is done, 0 to 1.

    Returns
    -------
    RecordingDiagnosis
        In `axes` the diagnosis of each axis: `verdict`, `sentence`, `effects` (each with `name`,
        `confidence` from 0 to 1, `theta` (p,) and `std_error` (p,) in units of the command),
        `error` in units of the command. `to_pandas()`, `to_dict()`, `write_report(folder)`.

    Raises
    ------
    DataError
        With file, place and value, where the recording cannot be used or tells nothing.
    UsageError
        Where the axis or the model are not there.
    """
    from motorctl.config.chosen_code import allowed_by
    from motorctl.identify.fit.declared_models import (
        declared_models,
        is_file,
        machine_of,
        untried_effects,
    )
    from motorctl.identify.same_axis import check_belongs, declared_inertias
    from motorctl.model.catalog import failed_effects

    may_run = allowed_by(allow_code)
    _tell_reading(progress)
    read, long = open_for_diagnosis(recording, whole_run)
    machine = machine_of(read, model, may_run)
    models = declared_models(read, model, axis, may_run, machine)

    def check(looked_at: Recording, axes: Sequence[str]) -> None:
        if machine is not None:
            check_belongs(looked_at, machine, axes)

    further = [] if machine is None else list(machine.further_effects.values())
    inertia = declared_inertias(read, machine, models)
    found = _diagnosed(read, long, models, progress, evaluate, further, inertia, check)
    untried = [f"{name} was not tried: {why}" for name, why in failed_effects().items()]
    if not is_file(model):
        untried += [
            f"{name} was not tried, though the log's configuration names it: allow its module "
            "with --allow-code"
            for name in untried_effects(read, machine)
        ]
    return replace(found, notes=(*found.notes, *untried))


def _diagnosed(
    read: Recording,
    long: LongLog | None,
    models: Mapping[str, EffectList],
    progress: Progress | None,
    evaluate: AnyRecording | None,
    further: Sequence[type[Effect]],
    inertia: Mapping[str, tuple[float, float]],
    check: Callable[[Recording, Sequence[str]], None],
) -> RecordingDiagnosis:
    """Check and diagnose a recording, or what tells most of a long one."""
    from motorctl.identify.diagnose.recording import diagnose_recording
    from motorctl.long_logs.diagnosis import diagnose_long, read_to_evaluate

    test, notes = None, list[str]()
    if evaluate is not None:
        test, long_test = open_for_diagnosis(evaluate)
        if long_test is not None:
            test, told = read_to_evaluate(long_test, models)
            notes.append(told)
    if long is None:
        check(read, list(models))
        found = diagnose_recording(read, models, progress, test, further, inertia)
    else:
        found = diagnose_long(long, models, progress, test, further, inertia, check=check)
    return replace(found, notes=(*found.notes, *notes))


def refine(
    recording: AnyRecording,
    config: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    axis: str | None = None,
    whole_run: bool = False,
    progress: Progress | None = None,
) -> Refinement:
    """Diagnose a recording and write a configuration with the effects that its model lacks.

    The text of the configuration is kept but for the models of the axes concerned: effects are
    added, parameters, bounds and covariances come from the data. What is written is loaded before
    it is put in place. Where nothing is missing, parameters change only if that is an improvement.

    Parameters
    ----------
    recording
        A `Log`, a path, or the paths of several logs of one run.
    config
        The configuration to refine: a file, or a shipped one's name.
    out
        The new configuration's path, which ends in .yaml.
    axis
        This axis only; None: all.
    whole_run
        A log stands for all logs of its run in its folder.
    progress
        Told what is being done, and the share that is done, 0 to 1.

    Returns
    -------
    Refinement
        `out`, `changed`, `diff` from the old text to the new one, `diagnosis`, `axes`, `to_dict()`.

    Raises
    ------
    DataError
        Where the recording cannot be used, or is not of this machine.
    ConfigError
        Where the configuration is not valid.
    UsageError
        Where the text cannot be changed in place, or the new file cannot be written.
    """
    from motorctl.errors import UsageError
    from motorctl.identify.refine.refinement import load_machine, refine_config
    from motorctl.identify.same_axis import declared_inertias, require_same_machine

    new = Path(out)
    if not new.parent.is_dir():
        raise UsageError(f"{new}: there is no folder {new.parent}")
    if new.suffix.lower() not in (".yaml", ".yml"):
        raise UsageError(f"{new}: a configuration is a .yaml file")
    machine, _ = load_machine(os.fspath(config))
    _tell_reading(progress)
    read, long = open_for_diagnosis(recording, whole_run)
    names = list(read.axes) if axis is None else [axis]
    require_same_machine(read, machine, names)
    found = _diagnosed(
        read,
        long,
        {name: machine.axes[name].declared for name in names},
        progress,
        None,
        list(machine.further_effects.values()),
        declared_inertias(read, machine, names),
        lambda looked_at, axes: require_same_machine(looked_at, machine, axes),
    )
    if progress is not None:
        progress("refining", 1.0)
    refinement = refine_config(found, machine.source, new)
    refinement.write()
    return refinement


def _tell_reading(progress: Progress | None) -> None:
    if progress is not None:
        progress("reading", 0.0)
