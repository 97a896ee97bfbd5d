"""How a recording is named: by a log that is open, by a path, or by the logs of a run."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from motorctl.api.log import Log, RecordingPath

if TYPE_CHECKING:
    from motorctl.log import Recording
    from motorctl.long_logs.long_log import LongLog

AnyRecording = Log | RecordingPath | Sequence[RecordingPath]
"""A `Log`; or a log, a CSV, Parquet, MAT or HDF5 file or its YAML description; or several logs of a
run, their folder, or the run's name."""


def paths_of(recording: AnyRecording, whole_run: bool) -> tuple[list[RecordingPath], bool]:
    """Return the paths of a recording, and whether a log stands for all of its run."""
    if isinstance(recording, Log):
        return list(recording.paths), recording.whole_run or whole_run
    if isinstance(recording, str | os.PathLike):
        return [recording], whole_run
    return list(recording), whole_run


def open_for_diagnosis(
    recording: AnyRecording, whole_run: bool = False
) -> tuple[Recording, LongLog | None]:
    """Return a recording as `read_for_analysis`; of a long log a few rows, and the log."""
    from motorctl.long_logs.long_log import long_log

    paths, whole = paths_of(recording, whole_run)
    log = long_log(paths, whole)
    return (log.head, log) if log else (read_for_analysis(recording, whole_run), None)


def read_for_analysis(recording: AnyRecording, whole_run: bool = False) -> Recording:
    """Return what the analysis looks at, every row as it was recorded."""
    from motorctl.identify.columns.measured import read_measured

    paths, whole = paths_of(recording, whole_run)
    return read_measured(paths, whole_run=whole)
