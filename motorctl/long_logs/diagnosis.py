"""Diagnose a long log: scan all of it, then look at the stretches that tell most of each axis."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from motorctl.errors import DataError
from motorctl.identify.columns.measured import counterpart
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis
from motorctl.log import Recording
from motorctl.long_logs.clearest import clearest_of
from motorctl.long_logs.long_log import LongLog
from motorctl.long_logs.windows import MOST_ROWS
from motorctl.model import Effect, EffectList

Progress = Callable[[str, float], None]
SCANNING = 0.5
"""Share of the whole that the scan is: of ten hours it takes as long as the diagnosis. For progress
alone."""


def read_to_evaluate(log: LongLog, models: Mapping[str, EffectList]) -> tuple[Recording, str]:
    """Return what tells most of the axes in a long log, to measure errors on, and say so.

    Chosen by motion alone: errors of where the model leaves most would be those of no usual day.
    Raises DataError where none of them moved enough.
    """
    own = {counterpart(log.head, axis): model for axis, model in models.items()}
    groups: dict[int, set[int]] = defaultdict(set)
    most_rows = MOST_ROWS // len(own)
    for clearest in clearest_of(log, own, most_rows, by_motion_alone=True).values():
        if clearest is not None and clearest.read.candidates:
            for k, chosen in clearest.groups.items():
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
                f"{log.source}: axis {axis}: no motion in its {log.rows} rows: "
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
        axes[axis] = replace(
            found.axes[axis],
            read=clearest.read,
            notes=(*found.axes[axis].notes, *clearest.notes),
        )
    if not axes:
        raise DataError("\n".join(refused.values()))
    if progress is not None:
        progress("done", 1.0)
    rate_hz = log.head.sample_rate_hz
    return RecordingDiagnosis(log.source, rate_hz, log.rows / rate_hz, axes, refused, tuple(notes))
