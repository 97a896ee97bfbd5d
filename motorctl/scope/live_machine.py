"""A running machine as the page shows it: its rows as they come, and what is captured of them."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from motorctl.api.connection import connect
from motorctl.api.off_the_loop import keep_off_the_loop_of
from motorctl.api.samples import Samples, Subscription
from motorctl.api.saved_samples import save_columns
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.flight import find_record, list_records
from motorctl.log.partial import SUFFIX
from motorctl.scope.history import History
from motorctl.scope.shown import Shown
from motorctl.scope.trigger import LONGEST_S, Trigger, Watch

KEPT_S = 2 * LONGEST_S + 10.0
"""How many seconds are kept: what a capture may reach over, and the time until it is written. At
5 kHz and two axes 160 MB."""
LOOK_S = 0.05
"""Between two looks at the loop's memory, which holds 8 s or more. By hand; it is what the page
lags."""
BEGUN_WITH_S = 5.0
"""What the page begins with of what was before [s]."""
FIRST_ROWS_S = 120.0
"""How long a loop may compile before its first row comes [s], as other clients wait."""
LEAVES_S = 1.0
"""How long the end of the scope waits for the listening to end [s]: many looks."""


@dataclass(frozen=True)
class Capture:
    """Rows around a trigger."""

    time_s: float
    """Of the row that triggered, by the machine's clock."""
    begin_s: float
    end_s: float
    path: str | None
    """The log that they were written to."""
    failure: str | None
    """Why they were not."""


@dataclass
class _Due:
    """A trigger that was met, until the seconds after it are there."""

    time_s: float
    trigger: Trigger


class LiveMachine(Shown):
    """Reads every row of a daemon's loop, through a descriptor that cannot write.

    Parameters
    ----------
    socket
        The daemon's control socket; None: as `motorctl.connect` finds it.
    captures
        Where captures are written.

    Raises
    ------
    MotorctlError
        Where no daemon answers, or its loop writes no row.
    """

    live = True

    def __init__(self, socket: Path | None, captures: Path) -> None:
        super().__init__()
        self._folder = captures
        with connect(socket) as machine:
            status = machine.status()
            self._heard: Subscription = machine.subscribe(
                period_s=LOOK_S, history_s=BEGUN_WITH_S, restarts=True
            )
        self.name = status.machine
        self._watch: Watch | None = None
        self._due: _Due | None = None
        self._writing = threading.Lock()
        """One capture after the other, so that no two of a second take one name."""
        self.captured: list[Capture] = []
        self._failure: str | None = None
        first = self._first_rows()
        keep_off_the_loop_of(self._heard.path)
        self._begin(first)
        self._hear(first)
        self._version, self._shown_version = 0, -1
        self.refresh()
        self._leaves = threading.Event()
        self._listening = threading.Thread(target=self._listen, name="scope-listens", daemon=True)
        self._listening.start()

    def close(self) -> None:
        """Leave the machine; a capture whose seconds are not all there is written as it is."""
        self._leaves.set()
        self._listening.join(LEAVES_S)

    def refresh(self) -> None:
        """Show the rows that came since."""
        with self.lock:
            if self._version != self._shown_version:
                self._shown_version = self._version
                self._take(self._history)

    def arm(self, trigger: Trigger | None) -> None:
        """Wait for a trigger from now on; None: for none. Raises UsageError where it fits not."""
        with self.lock:
            self._due = None
            self._watch = None if trigger is None else Watch(trigger, self._last)

    def state(self) -> dict[str, Any]:
        """Return what the page asks for all the time, for JSON."""
        with self.lock:
            self.refresh()
            watch = self._watch
            return {
                "begin_s": self.begin_s(),
                "end_s": self.end_s(),
                "run": self._history.run,
                "columns": len(self._history.columns),
                "lost": self._heard.lost,
                "gone": self._heard.ended or self._failure is not None,
                "failure": self._failure,
                "armed": watch.trigger.model_dump() if watch else None,
                "captures": [capture.__dict__ for capture in self.captured[-5:]],
                "captured": len(self.captured),
            }

    def newest_flight_record(self) -> Path:
        """Return the newest flight record, as `motorctl fault show` finds it.

        Raises MotorctlError where there is none, or the daemon does not tell where they are.
        """
        with connect(self._heard.path) as machine:
            told = machine.status().document["recording"].get("flight_records")
        try:
            if told is None or not Path(told["folder"]).is_dir():
                raise UsageError(f"{self.name}: there is no flight record: no axis has tripped")
            return find_record(list_records(Path(told["folder"])), None).path
        except OSError as error:
            why = f"{error.strerror}: start the scope as a user who may read it"
            raise UsageError(f"{told['folder']}: flight records cannot be read: {why}") from error

    def _first_rows(self) -> Samples:
        first = self._heard.read()
        deadline = time.monotonic() + FIRST_ROWS_S
        while not first.rows:
            if self._heard.ended or time.monotonic() > deadline:
                gone = "its daemon has ended" if self._heard.ended else f"in {FIRST_ROWS_S:g} s"
                self._heard.close()
                raise RunError(
                    f"{self.name}: its loop has written no row, {gone}: `motorctl status` tells "
                    "whether it ticks"
                )
            time.sleep(LOOK_S)
            first = self._heard.read()
        return first

    def _listen(self) -> None:
        try:
            while not self._leaves.is_set():
                samples = self._heard.read()
                if not samples.rows and self._heard.ended:
                    with self.lock:  # the seconds after it never come
                        self._write_due()
                    samples = next(iter(self._heard))  # of the next daemon, once there is one
                    keep_off_the_loop_of(self._heard.path)
                if samples.rows:
                    with self.lock:
                        self._hear(samples)
                        self._version += 1
                else:
                    self._leaves.wait(LOOK_S)
        except MotorctlError as error:  # as of a daemon of another version: the page tells it
            self._failure = str(error)
        except Exception as error:  # a mistake of ours is no machine that stands still
            self._failure = f"{type(error).__name__}: {error}"
        finally:
            with self.lock:
                self._write_due()
            self._heard.close()

    def _begin(self, samples: Samples) -> None:
        self._history = History(samples, KEPT_S)

    def _hear(self, samples: Samples) -> None:
        if not self._history.takes(samples):
            self._write_due()
            self._begin(samples)
            self._follow_on(samples)
        self._last = samples
        self._history.add(samples)
        for row in () if self._watch is None else self._watch.find(samples):
            self._meet(float(samples["time_s"][row]))
        if self._due is not None and samples["time_s"][-1] >= self._ends_s(self._due):
            self._write(self._due)

    def _meet(self, time_s: float) -> None:
        """Take note of a trigger that was met, unless its seconds are in a capture that is due."""
        if self._due is not None and time_s > self._ends_s(self._due):  # many rows came at once
            self._write(self._due)
        if self._due is None and self._watch is not None:
            self._due = _Due(time_s, self._watch.trigger)

    def _ends_s(self, due: _Due) -> float:
        """Return from when on a capture is whole; times that are sums are a little off."""
        return due.time_s + due.trigger.post_s - 0.5 / self._history.sample_rate_hz

    def _follow_on(self, samples: Samples) -> None:
        """Go on to wait for the same after a restart, or with other models."""
        if self._watch is not None:
            try:
                self._watch = Watch(self._watch.trigger, samples, begins=True)
            except MotorctlError:  # what it waited for is not there any more
                self._watch = None

    def _write_due(self) -> None:
        """Write what waits for rows that will not come any more, as far as it is there."""
        if self._due is not None:
            self._write(self._due)

    def _write(self, due: _Due) -> None:
        self._due = None
        trigger = due.trigger
        if trigger.mode == "single":
            self._watch = None
        history = self._history
        time_s = history.part("time_s", 0, history.rows)
        half_s = 0.5 / history.sample_rate_hz  # times that are sums are a little off
        first = int(time_s.searchsorted(due.time_s - trigger.pre_s - half_s))
        last = int(time_s.searchsorted(due.time_s + trigger.post_s + half_s))
        columns = {name: history.part(name, first, last).copy() for name in history.columns}
        begin_s, end_s = float(time_s[first]), float(time_s[last - 1])
        told = {
            "trigger": trigger.model_dump(),
            "time_s": due.time_s,
            "written_utc": datetime.now(UTC).isoformat(timespec="milliseconds"),
        }
        metadata = {**history.metadata, "clock": "wall", "capture": told}
        axes = history.log_axes

        def write() -> None:
            path, failure = None, None
            try:
                with self._writing:
                    path = str(save_columns(self._free_path(trigger), columns, axes, metadata))
            except (MotorctlError, OSError) as error:
                failure = str(error)
            self.captured.append(Capture(due.time_s, begin_s, end_s, path, failure))

        # Beside the reading: a disk may hang, and rows do not wait.
        threading.Thread(target=write, name="scope-writes").start()

    def _free_path(self, trigger: Trigger) -> Path:
        stem = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{self.name}-{trigger.kind}"
        path, count = self._folder / f"{stem}.parquet", 1
        while path.exists() or path.with_name(path.name + SUFFIX).exists():
            count += 1
            path = self._folder / f"{stem}-{count}.parquet"
        return path
