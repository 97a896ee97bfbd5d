"""Set runs beside each other by the published measures."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from motorctl.api.recordings import AnyRecording, paths_of

if TYPE_CHECKING:
    from motorctl.identify.compare.runs import Comparison


def compare(
    *recordings: AnyRecording,
    period_s: float | None = None,
    whole_run: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Measure recordings: eM, eF, L2[e], uM, and the first one's ratio to each other.

    Parameters
    ----------
    *recordings
        Each a `Log`, a path, or the paths of several logs of one run; the first is the one before.
    period_s
        The motion's period [s], where neither log nor motion shows it.
    whole_run
        A log stands for all logs of its run in its folder.
    progress
        Told the share of the recordings that is read, 0 to 1.

    Returns
    -------
    Comparison
        `measures(axis)` by run, in m (or rad) and the command's unit; `ratios(axis)`;
        `to_pandas()`, `to_dict()`.

    Raises
    ------
    DataError
        Where a recording has no reference, or the recordings have no axis in common.
    UsageError
        Where there is no recording, or the period is no time.
    """
    from motorctl.errors import UsageError
    from motorctl.identify.compare.runs import compare as compared
    from motorctl.log import read_recording

    if not recordings:
        raise UsageError("compare: name at least one recording")
    read = []
    for done, recording in enumerate(recordings, 1):
        paths, whole = paths_of(recording, whole_run)
        read.append(read_recording(paths, gaps="keep", whole_run=whole))
        if progress is not None:
            progress(done / len(recordings))
    return compared(read, period_s)
