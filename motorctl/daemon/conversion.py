"""Make logs of closed recordings beside the daemon, one at a time, at idle priority."""

from __future__ import annotations

import json
import logging
import subprocess
import time
from collections import deque
from pathlib import Path

from motorctl.daemon.error_text import in_words
from motorctl.errors import MotorctlError
from motorctl.log import background, recover
from motorctl.log.folder import in_use, stored_logs

TRY_AGAIN_S = 600.0

_log = logging.getLogger("motorctl")


class Conversion:
    """A queue of partial files, and the process that works on the first of them.

    Nothing here waits but `finish`: whoever looks after it calls `look` every now and then.
    """

    def __init__(self) -> None:
        self.recorded_bytes = 0
        """Of what was made logs of by this daemon, as it was while it was recorded."""
        self.closed_bytes = 0
        """And as it is in the logs."""
        self.keep_off: frozenset[int] = frozenset()
        """CPUs that logs are not made on."""
        self.failure: str | None = None
        """Why the last one that failed did; its partial file stays."""
        self._waiting: deque[Path] = deque()
        self._failed: dict[Path, float] = {}
        """When each was tried last, by the monotonic clock."""
        self._leftovers: set[Path] = set()
        self._current: Path | None = None
        self._size = 0
        self._process: subprocess.Popen[str] | None = None

    @property
    def current(self) -> Path | None:
        """The partial file that a log is being made of."""
        return self._current

    @property
    def waiting(self) -> list[Path]:
        """Those that come after it."""
        return list(self._waiting)

    @property
    def failed(self) -> list[Path]:
        """Those that could not be made logs; they are tried again, as a full disk becomes free."""
        return list(self._failed)

    def add(self, partial: Path) -> None:
        """Put a closed recording into the queue; may be called by any thread."""
        self._waiting.append(partial)

    def add_leftovers(self, folder: Path, machine: str) -> list[Path]:
        """Put what earlier runs left unfinished into the queue, and return it, the oldest first."""
        left = [
            log.partial_path
            for log in stored_logs(folder, machine)
            if log.partial and not in_use(log)
        ]
        self._waiting.extend(left)
        self._leftovers = set(left)
        return left

    def look(self) -> None:
        """See whether a log is done, and begin with the next."""
        if self._works():
            return
        if self._waiting:
            self._begin(self._waiting.popleft())
            return
        now = time.monotonic()
        for partial, tried_at in self._failed.items():
            if now - tried_at >= TRY_AGAIN_S:
                self._begin(partial)
                return

    def finish(self) -> list[str]:
        """Make logs of all that is left, at the daemon's own priority; return what went wrong.

        What earlier runs left and cannot be made a log is no failure of this one: it is told, and
        stays.
        """
        if self._works() and self._process is not None and self._current is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None
            self._waiting.appendleft(self._current)  # a log appears complete or not at all
        wrong = []
        self._waiting.extend(path for path in self._failed if path not in self._waiting)
        while self._waiting:
            partial = self._waiting.popleft()
            if not partial.exists():
                continue
            self._current = partial
            try:
                self._size = partial.stat().st_size
                done = recover(partial)
            except (MotorctlError, OSError) as error:
                problem = self._fail(in_words(error))
                wrong += [] if partial in self._leftovers else [problem]
            else:
                self._succeed(done.path, done.rows)
        return wrong

    def _works(self) -> bool:
        """Tell whether the process works on a log; take note of one that is done."""
        process = self._process
        if process is None or process.poll() is None:
            return process is not None
        self._process = None
        told, error = process.communicate()
        self._end(process.returncode, told, error)
        return False

    def _begin(self, partial: Path) -> None:
        if not partial.exists():  # retention was faster, or somebody else
            self._failed.pop(partial, None)
            return
        self._current = partial
        try:
            self._size = partial.stat().st_size
            # A session of its own: Ctrl-C is for the daemon, which then finishes this itself.
            self._process = subprocess.Popen(
                background.command(partial, self.keep_off),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
            )
        except OSError as error:
            self._fail(f"{partial}: {in_words(error)}")

    def _end(self, status: int, told: str, error: str) -> None:
        if status == 0:
            done = json.loads(told)
            self._succeed(Path(done["path"]), done["rows"])
            return
        why = error.strip().splitlines()[-1:] or [f"the process ended with status {status}"]
        self._fail(f"{self._current}: cannot be made a log: {why[0]}")

    def _succeed(self, log: Path, rows: int) -> None:
        size = log.stat().st_size
        self.recorded_bytes += self._size
        self.closed_bytes += size
        if self._current is not None:
            self._failed.pop(self._current, None)
        self._current, self.failure = None, None
        _log.info("log %s: %d ticks, %.3g MB", log, rows, size / 1e6)

    def _fail(self, problem: str) -> str:
        partial, self._current, self.failure = self._current, None, problem
        if partial is not None:
            if partial not in self._failed:
                _log.error("logs: %s; it is tried again later", problem)
            self._failed[partial] = time.monotonic()
        return problem
