"""What a worker does: read a footer, scan a part of a long log, fit and diagnose a window."""

from __future__ import annotations

from collections.abc import Sequence

from motorctl.config import Machine
from motorctl.errors import DataError, MotorctlError
from motorctl.fleet.findings import Refusal, Row, diagnosis_rows, fit_rows, nothing_row
from motorctl.fleet.head import ConfigurationError, Declared, LogHead, damaged_id, read_head
from motorctl.fleet.paths import is_there, opened
from motorctl.identify.columns.measured import SIGNALS, with_others
from motorctl.identify.diagnose.freed_memory import give_freed_memory_back
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.fit.declared_models import declared_models
from motorctl.identify.fit.recording import fit_axis
from motorctl.identify.same_axis import check_belongs, declared_inertias
from motorctl.log import Recording
from motorctl.log.read import recording_of
from motorctl.log.row_groups import RowGroupTable
from motorctl.long_logs.excitation import Excitation, Scanned
from motorctl.long_logs.scan import scanned
from motorctl.long_logs.windows import Window


def look_at_head(source: str, declared: Declared) -> LogHead | tuple[Refusal, str | None]:
    """Return what a log says of itself; else why not, and the identity of the file."""
    try:
        return read_head(source, declared)
    except ConfigurationError as error:
        return Refusal(source, str(error), lasting=False), None
    except MotorctlError as error:
        try:
            return Refusal(source, str(error)), damaged_id(source)
        except MotorctlError:
            return Refusal(source, str(error), lasting=False), None


def scan(head: LogHead, declared: Declared, groups: Sequence[int]) -> Scanned | Refusal:
    """Return what the motion in some row groups of a log tells, of each axis.

    Row groups in which the file itself says that an axis did not move are not read for it.
    """
    told: dict[str, list[Excitation | None]] = {axis: [] for axis in head.moved}
    try:
        with opened(head.source) as file:
            for of_group in scanned(
                head.source,
                file,
                head.moved,
                groups,
                lambda first: declared_models(
                    first, declared.model, machine=_machine(declared, first)
                ),
            ):
                for axis, found in of_group.items():
                    told[axis].append(found)
    except DataError as error:
        return Refusal(head.source, str(error), is_there(head.source))
    finally:
        give_freed_memory_back()
    return told


def look_at_window(
    head: LogHead, declared: Declared, window: Window, diagnose: bool
) -> list[Row] | Refusal:
    """Fit a window of an axis, and diagnose it where that is wanted.

    Parameters
    ----------
    head
        The log.
    declared
        Which model is meant.
    window
        Its rows.
    diagnose
        Whether it is searched for what the model lacks, besides.

    Returns
    -------
    list of Row or Refusal
        What is kept of it; why the log cannot be of the machine that it names, or be read.
    """
    axis = window.axis
    try:
        recording = _read(head, window.groups)
        machine = _machine(declared, recording)
        models = declared_models(recording, declared.model, axis, machine=machine)
        check_belongs(recording, machine, models)
    except MotorctlError as error:
        return Refusal(head.source, str(error), is_there(head.source))
    span_s = (
        float(recording.time_s[0]) - head.first_s,
        float(recording.time_s[-1]) - head.first_s,
    )
    rows: list[Row] = []
    try:
        fit = fit_axis(with_others(recording, axis), models[axis])
        rows += fit_rows(head, window, span_s, fit)
        if diagnose:
            found = diagnose_recording(
                recording,
                models,
                further=list(machine.further_effects.values()),
                inertia=declared_inertias(recording, machine, models),
            )
            rows += diagnosis_rows(head, window, span_s, found.axes[axis])
    except DataError as error:
        rows.append(nothing_row(head, axis, str(error), window))
    finally:
        give_freed_memory_back()
    return rows


def _read(head: LogHead, groups: Sequence[int]) -> Recording:
    """Read what is looked at of some row groups. Raises DataError."""
    with opened(head.source) as file:
        return recording_of(RowGroupTable(head.source, file, groups), "keep", SIGNALS)


def _machine(declared: Declared, recording: Recording) -> Machine:
    return declared.machine(recording.metadata["config"], recording.source)
