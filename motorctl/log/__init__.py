"""Logs and recordings: the sample, the writer, recovery after a crash, foreign recordings.

The loop process needs the sample only. So what reads and writes files is imported when it is
asked for: pyarrow and scipy stay out of a process whose memory is locked.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motorctl.log.columns import LogAxis
    from motorctl.log.read import read_recording
    from motorctl.log.recording import AxisRecording, Recording
    from motorctl.log.recovery import Recovery, recover
    from motorctl.log.writer import LogWriter

__all__ = [
    "AxisRecording",
    "LogAxis",
    "LogWriter",
    "Recording",
    "Recovery",
    "read_recording",
    "recover",
]

_HOMES = {
    "AxisRecording": "recording",
    "LogAxis": "columns",
    "LogWriter": "writer",
    "Recording": "recording",
    "Recovery": "recovery",
    "read_recording": "read",
    "recover": "recovery",
}


def __getattr__(name: str) -> object:
    """Import a public name from the module where it lives."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
