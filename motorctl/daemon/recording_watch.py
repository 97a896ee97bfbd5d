"""See from beside the recorder's thread whether rows reach the disk, and tell it.

A write to a disk that hangs does not come back, so its own thread can tell nothing of it.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from motorctl.daemon.recorder import Recorder
from motorctl.daemon.spell import Spell
from motorctl.loop import LoopMemory

STANDS_S = 2.0
"""How long the recorder may make no progress before that is told [s]. Shorter: disks that clean up
now and then, as flash does, are told for nothing. Longer: less is left of what memory holds (8 s)
for whoever may do something. It looks four times a second. By hand."""
NOT_LOOKED_S = 1.0
"""Between two looks [s]: after more, this process stood still itself, and so did the recorder. It
looks twenty times a second. By hand."""

_log = logging.getLogger("motorctl")


class RecordingWatch:
    """Follows a recorder's counters, and the ring's.

    Parameters
    ----------
    recorder
        That is followed.
    memory
        Whose ring it drains.
    rate_hz
        Of the loop.
    clock
        Asked for the time [s].
    """

    def __init__(
        self,
        recorder: Recorder,
        memory: LoopMemory,
        rate_hz: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._recorder = recorder
        self._memory = memory
        self._rate_hz = rate_hz
        self._clock = clock
        self._progress = recorder.progress
        self._moved_s = self._looked_s = clock()
        self._spell = Spell()
        self._lost = self._lost_told = self._overwritten_seen = 0

    @property
    def rows_lost(self) -> int:
        """Those of the recorder, and those that are overwritten while it stands still."""
        # In this order: rows that it counts meanwhile are missed by one look, not counted twice.
        lost = self._recorder.rows_lost
        self._lost = max(self._lost, lost + self._memory.overwritten)
        return self._lost

    @property
    def failure(self) -> str | None:
        """Why rows are not written now, or None."""
        stood_s = self._looked_s - self._moved_s
        if stood_s < STANDS_S or self._progress != self._recorder.progress:
            return self._recorder.failure
        if not self._recorder.thread_ended:
            stands = f"the disk has taken nothing for {stood_s:.1f} s"
            where = "; `dmesg` may tell why the disk hangs"
        else:
            stands = f"nothing was recorded for {stood_s:.1f} s ({self._recorder.failure})"
            where = "; it is tried again all the time"
        if self._memory.overwritten:
            return (
                f"{stands} and memory is full: rows are being lost, {self.rows_lost} so far; the "
                f"axes go on{where}"
            )
        return (
            f"{stands}; memory holds the rows of {self._memory.room / self._rate_hz:.1f} s more, "
            f"then they are lost; the axes go on{where}"
        )

    def look(self) -> None:
        """Look whether the recorder goes on, and tell what is new."""
        now_s = self._clock()
        if now_s - self._looked_s > NOT_LOOKED_S:
            self._moved_s += now_s - self._looked_s
        self._looked_s = now_s
        if self._recorder.progress != self._progress:
            self._progress, self._moved_s = self._recorder.progress, now_s
        failure, overwritten = self.failure, self._recorder.rows_overwritten
        if (new := overwritten - self._overwritten_seen) > 0:
            self._overwritten_seen = overwritten
            if self._spell.is_news(why := self._recorder.lost_because):
                _log.error("recording: %d rows were lost: %s", new, why)
        if self._spell.is_news(failure):
            if failure is None:
                self._tell_the_end()
            else:
                level = logging.WARNING if self.rows_lost == self._lost_told else logging.ERROR
                _log.log(level, "recording: %s", failure)

    def _tell_the_end(self) -> None:
        lost, before = self._recorder.rows_lost, self._lost_told
        if lost == before:
            _log.warning("recording resumed; no row was lost")
        else:
            in_all = f", {lost} in this run" if before else ""
            _log.warning("recording resumed; %d rows were lost%s", lost - before, in_all)
        self._lost_told = lost
