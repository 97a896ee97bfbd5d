"""Diagnose a long log: scan all of it, then look at the stretches that tell most of each axis."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from motorctl.errors import DataError
from motorctl.identify.columns.measured import counterpart
from motorctl.identify.diagnose.read_stretches import ReadStretches, Stretch
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis
from motorctl.log import Recording
from motorctl.long_logs.excitation import Excitation
from motorctl.long_logs.long_log import LongLog
from motorctl.long_logs.windows import MOST_ROWS, Window, clearest_within, windows_of
from motorctl.model import Effect, EffectList

Progress = Callable[[str, float], None]
SCANNING = 0.5
"""Share of the whole that the scan is: of ten hours it takes as long as the diagnosis. For progress
alone."""


@dataclass(frozen=True)
class Clearest:
    """What is read of an axis: windows by part, and what is told of them."""

    groups: Mapping[int, Sequence[int]]
    read: ReadStretches


def clearest_of(
    log: LongLog,
    models: Mapping[str, EffectList],
    most_rows: int,
    progress: Progress | None = None,
) -> dict[str, Clearest | None]:
    """Scan a long log, and choose of each axis the windows whose motion tells most.

    Parameters
    ----------
    log
        What is scanned.
    models
        What is declared of each axis that is asked for.
    most_rows
        Of an axis.
    progress
        Told the share of rows that was scanned.

    Returns
    -------
    dict
        By axis; None where it never moved enough to tell a parameter.
    """
    told: dict[str, list[list[Excitation | None]]] = {
        axis: [[] for _ in log.parts] for axis in models
    }
    done = 0
    for part, group, found in log.scanned(list(models), lambda _: models):
        for axis, excitation in found.items():
            told[axis][part].append(excitation)
        done += log.parts[part].group_rows[group]
        if progress is not None:
            progress(f"scanning {log.source}", done / log.rows)
    return {axis: _chosen(log, axis, models[axis], told[axis], most_rows) for axis in models}


def read_to_evaluate(log: LongLog, models: Mapping[str, EffectList]) -> tuple[Recording, str]:
    """Return what tells most of the axes in a long log, to measure errors on, and say so.

    Raises DataError where none of them moved enough.
    """
    own = {counterpart(log.head, axis): model for axis, model in models.items()}
    groups: dict[int, set[int]] = defaultdict(set)
    for clearest in clearest_of(log, own, MOST_ROWS // len(own)).values():
        for k, chosen in (clearest.groups if clearest else {}).items():
            groups[k] |= set(chosen)
    if not groups:
        raise DataError(f"{log.source}: no motion in its {log.rows} rows tells a parameter")
    read = log.read({k: sorted(chosen) for k, chosen in groups.items()})
    told = (
        f"errors were measured on {len(read.time_s)} of the {log.rows} rows of {log.source}, "
        "those whose motion tells most"
    )
    return read, told


def diagnose_long(
    log: LongLog,
    models: Mapping[str, EffectList],
    progress: Progress | None = None,
    evaluate_on: Recording | None = None,
    further: Sequence[type[Effect]] = (),
    inertia: Mapping[str, tuple[float, float]] | None = None,
    *,
    check: Callable[[Recording, Sequence[str]], None] | None = None,
) -> RecordingDiagnosis:
    """Diagnose a long log as `diagnose_recording` does a short one, each axis on its own stretches.

    Parameters
    ----------
    log
        What is diagnosed.
    models, progress, evaluate_on, further, inertia
        As `diagnose_recording` takes them.
    check
        Called with what was read of an axis, and its name; raises where that cannot be used.

    Returns
    -------
    RecordingDiagnosis
        Each axis' `read` tells its stretches.

    Raises
    ------
    DataError
        No axis can be diagnosed.
    """

    def scan_progress(what: str, share: float) -> None:
        if progress is not None:
            progress(what, SCANNING * share)

    axes: dict[str, AxisDiagnosis] = {}
    refused: dict[str, str] = {}
    notes: dict[str, None] = dict.fromkeys(log.table.notes)
    for k, (axis, clearest) in enumerate(
        clearest_of(log, models, MOST_ROWS, scan_progress).items()
    ):

        def tell(what: str, share: float, k: int = k) -> None:
            if progress is not None and share < 1.0:
                progress(what, SCANNING + (1.0 - SCANNING) * (k + share) / len(models))

        if clearest is None:
            refused[axis] = (
                f"{log.source}: axis {axis}: no motion in its {log.rows} rows tells a parameter: "
                "record a motion, or check which column is the position"
            )
            continue
        recording = log.read(clearest.groups)
        if check is not None:
            check(recording, [axis])
        try:
            found = diagnose_recording(
                recording, {axis: models[axis]}, tell, evaluate_on, further, inertia
            )
        except DataError as error:
            refused[axis] = str(error)
            continue
        notes |= dict.fromkeys(recording.notes)
        axes[axis] = replace(found.axes[axis], read=clearest.read)
    if not axes:
        raise DataError("\n".join(refused.values()))
    if progress is not None:
        progress("done", 1.0)
    rate_hz = log.head.sample_rate_hz
    return RecordingDiagnosis(log.source, rate_hz, log.rows / rate_hz, axes, refused, tuple(notes))


def _chosen(
    log: LongLog,
    axis: str,
    model: EffectList,
    told: Sequence[Sequence[Excitation | None]],
    most_rows: int,
) -> Clearest | None:
    windows: list[tuple[int, Window]] = []
    period_s = log.head.period_s
    for k, part in enumerate(log.parts):
        found = windows_of(axis, part.group_rows, told[k], period_s, len(windows))
        windows += [(k, window) for window in found]
    if not windows:
        return None
    taken = clearest_within([window for _, window in windows], most_rows)
    groups: dict[int, list[int]] = defaultdict(list)
    stretches = []
    for window in taken:
        k, _ = windows[window.number]
        groups[k] += window.groups
        stretches.append(_stretch(log, k, window, model))
    return Clearest(groups, ReadStretches(tuple(stretches), log.rows, len(windows)))


def _stretch(log: LongLog, k: int, window: Window, model: EffectList) -> Stretch:
    part, worst = log.parts[k], int(np.argmax(window.vagueness))
    return Stretch(
        log=str(part.path),
        begin_s=float(part.begins_s[window.groups[0]]),
        end_s=float(part.ends_s[window.groups[-1]]),
        rows=window.rows,
        vaguest=model.parameter_names[worst],
        vagueness=window.vagueness[worst],
    )
