"""Bring every tick from the ring to the disk, in a thread of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from motorctl.daemon.error_text import in_words
from motorctl.log.timing import TimingSummary
from motorctl.loop import LoopMemory

PERIOD_S = 0.25
"""Data reaches the disk at least once a second; a quarter leaves room for a slow disk."""
ROWS_AT_ONCE = 4096


class Log(Protocol):
    """Where rows go: a `LogWriter`, or a `RotatingLog` of many."""

    rows: int
    rows_lost: int

    @property
    def path(self) -> Path:
        """Where it will stand when it is closed."""

    def append(self, ticks: NDArray[np.void], samples: NDArray[np.void]) -> None:
        """Take rows; raises where some are lost."""

    def flush(self) -> None:
        """Bring all of them onto the disk."""

    def close(self, extra: Mapping[str, Any]) -> Path:
        """Finish it."""


class Recorder:
    """Drains the ring into a log.

    One thread drains and writes: while a disk is slow, the ring holds the rows. A disk that
    refuses rows stops no machine: they are counted as lost, and the next ones are tried again.
    """

    def __init__(self, memory: LoopMemory, log: Log) -> None:
        self.rows_written = 0
        self.rows_lost = 0
        """Ticks that are not in the log: overwritten in the ring, or refused by the disk."""
        self.rows_overwritten = 0
        """Of those that are lost, the ones that were overwritten in the ring."""
        self.progress = 0
        """Grows with every look into the ring and all rows that the log took or refused: it stands
        still where a write does not come back."""
        self.failure: str | None = None
        """Why the last rows were not written, or None."""
        self.thread_ended = False
        """Whether its thread ended, and no new one has looked into the ring since."""
        self.lost_because: str | None = None
        """Why rows of this recording were lost, also where later ones could be written again."""
        self.timing = TimingSummary()
        self.begin_other_models: Callable[[], None] | None = None
        """Called before the first row of other models comes, which has other columns."""
        self.models_row = 0
        """The first row of the models whose log is being recorded."""
        self._memory = memory
        self._log = log
        self._drained_s: float | None = None
        """When the ring was drained the last time."""
        self._wrote_s = 0.0
        """How long it took to write what came then."""
        self._ending = threading.Event()
        self._thread = self._new_thread()

    @property
    def runs(self) -> bool:
        """Whether its thread is alive."""
        return self._thread.is_alive()

    @property
    def path(self) -> Path:
        """Where the log will stand when it is closed."""
        return self._log.path

    def start(self) -> None:
        """Begin to record."""
        self._thread.start()

    def insist(self) -> None:
        """Begin anew where the thread has died; the rows are in the ring, and `failure` tells."""
        if self.runs:
            return
        self.thread_ended = True
        ended = "the recorder's thread ended unexpectedly and"
        self._thread = self._new_thread()
        try:
            self._thread.start()
        except RuntimeError as error:  # no more threads: until the next time
            self.failure = f"{ended} cannot be started again: {error}"
        else:
            self.failure = f"{ended} was started again"

    def finish(self, extra: Callable[[], dict[str, Any]]) -> Path:
        """Record what is left in the ring and close the log; call when the loop has ended.

        `extra` is asked for the closing metadata once the last row is in. Raises RunError where
        the log cannot be closed; what is on disk is then kept.
        """
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join()
        self._take()
        return self._log.close(extra())

    def _change_models(self, row: int) -> None:
        assert self.begin_other_models is not None  # announced before the loop is told
        self.begin_other_models()
        self.models_row = row

    def _new_thread(self) -> threading.Thread:
        return threading.Thread(target=self._run, name="recorder", daemon=True)

    def _run(self) -> None:
        while not self._ending.wait(PERIOD_S):
            self._take()

    def _take(self) -> None:
        try:
            self._drain()
        except Exception as error:  # whatever it was: the next rows are tried again
            self.failure = self.lost_because = in_words(error)
        self.thread_ended = False
        self.progress += 1

    def _drain(self) -> None:
        ticks, samples, lost = self._memory.drain()
        began_s = time.monotonic()
        if lost:
            held_s = float(ticks["time_s"][-1] - ticks["time_s"][0]) if len(ticks) else 0.0
            self.lost_because = self._why_overwritten(began_s, held_s)  # before it is looked for
            self.rows_lost += lost
            self.rows_overwritten += lost
        self._drained_s, self._wrote_s = began_s, 0.0
        if len(ticks):
            try:
                self._write(ticks, samples)
            finally:
                self._wrote_s = time.monotonic() - began_s

    def _why_overwritten(self, now_s: float, held_s: float) -> str:
        holds = f"memory holds the rows of {held_s:.1f} s"
        if self._drained_s is None:
            return f"they came before the log was begun, and {holds}"
        apart_s = now_s - self._drained_s
        if self._wrote_s < apart_s / 2:
            return (
                f"{holds}, and the supervisor fetched none for {apart_s:.1f} s: it stood still, or "
                "got no processor"
            )
        return (
            f"{holds}, and the disk took {self._wrote_s:.1f} s over those before; `dmesg` may tell "
            "why it hung"
        )

    def _write(self, ticks: NDArray[np.void], samples: NDArray[np.void]) -> None:
        failure = None
        ends = [*range(ROWS_AT_ONCE, len(ticks), ROWS_AT_ONCE), len(ticks)]
        changed = self._memory.models_row
        change = changed - (self._memory.drained - len(ticks))
        if changed > self.models_row and change < len(ticks):
            change = max(change, 0)  # the ring may have lost the first rows of the models
            ends = sorted({*ends, change} - {0})
        else:
            change = -1
        begin = 0
        for end in ends:
            if begin == change:
                self._change_models(changed)
            rows, begin = slice(begin, end), end
            written, refused = self._log.rows, self._log.rows_lost
            try:
                self._log.append(ticks[rows], samples[rows])
                self._log.flush()
            except Exception as error:
                # What was written and only not synchronised is not lost: the log knows.
                failure = in_words(error)
            self.rows_written += self._log.rows - written
            self.rows_lost += self._log.rows_lost - refused
            self.progress += 1
        self.failure = failure
        self.lost_because = failure or self.lost_because
        self.timing.add(ticks["tick"], ticks["time_s"], ticks["lateness_s"], ticks["turnaround_s"])
