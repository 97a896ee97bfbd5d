"""What the next start tells of this run: whether it ended in order, and what it was configured as.

A process that is killed writes nothing any more, so a file says from the first tick on that a run
is under way, and at its end how it ended.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from motorctl.config.machine import Machine
from motorctl.daemon.error_text import in_words
from motorctl.loop import EndNote

_FORMAT = "motorctl-run-1"
_BOOT = Path("/proc/sys/kernel/random/boot_id")
IN_ORDER = "in order"
CHANGES_TOLD = 5


class _Run(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    format: str
    started: str
    process: str
    """Which one: its number, when it began, and in which life of the computer."""
    source: str
    config: dict[str, Any]
    ended: str | None
    """How; None: it is under way, or was killed."""
    loop_tells: bool = False
    """Whether its loop process leaves a note where it ends without a supervisor."""


class LastRun:
    """The file that says what became of a machine's last run.

    Parameters
    ----------
    machine
        That runs.
    path
        The file.
    """

    def __init__(self, machine: Machine, path: Path) -> None:
        self._machine = machine
        self._path = path
        self._run: _Run | None = None

    @property
    def loop_note(self) -> EndNote | None:
        """What the loop process leaves where it ends without a supervisor; None before `begin`."""
        return EndNote(self._note_path, self._run.process) if self._run else None

    @property
    def _note_path(self) -> Path:
        return self._path.with_name(f"{self._path.name}.loop")

    def begin(self) -> list[str]:
        """Note that a run is under way.

        Returns
        -------
        list of str
            A sentence each: how the run before ended, unless in order; what has changed since in
            the configuration; why the file cannot be read or kept.
        """
        told = self._of_the_run_before()
        self._run = _Run(
            format=_FORMAT,
            started=datetime.now(UTC).isoformat(timespec="seconds"),
            process=_process(os.getpid()),
            source=str(self._machine.source),
            config=dict(self._machine.resolved),
            ended=None,
            loop_tells=True,
        )
        with contextlib.suppress(OSError):  # one that stays names another run
            self._note_path.unlink()
        return told + self._keep()

    def end(self, problems: str) -> list[str]:
        """Note how the run ended; return why that could not be kept, in a list, or an empty one.

        Parameters
        ----------
        problems
            In words; "": it ended in order.
        """
        if self._run is None:
            return []
        self._run = self._run.model_copy(update={"ended": problems or IN_ORDER})
        return self._keep()

    def _of_the_run_before(self) -> list[str]:
        try:
            before = _Run.model_validate_json(self._path.read_bytes())
        except FileNotFoundError:
            return []
        except (OSError, ValidationError) as error:
            why = error.strerror if isinstance(error, OSError) else "it is damaged"
            return [f"{self._path}: how the last run ended is not known: {why}"]
        if before.format != _FORMAT:
            return []
        told = []
        since = f"the last run (since {before.started})"
        if before.ended is None and not _lives(before.process):
            told.append(f"{since} did not end in order: {self._how_it_was_cut_short(before)}")
        elif before.ended not in (None, IN_ORDER):
            told.append(f"{since} ended with: {before.ended}")
        changes = list(_changes(before.config, self._machine.resolved))
        if changes:
            more = len(changes) - CHANGES_TOLD
            named = "; ".join(changes[:CHANGES_TOLD]) + (f"; and {more} more" if more > 0 else "")
            told.append(f"the configuration has changed since {since}: {named}")
        return told

    def _how_it_was_cut_short(self, run: _Run) -> str:
        try:
            same = run.process.endswith(_BOOT.read_text().strip())
        except OSError:
            same = False
        if not same:
            return "the computer went down, or was restarted"
        if not run.loop_tells:
            return "its supervisor was killed"
        try:
            stopped = self._note_path.read_bytes() == run.process.encode()
        except OSError:
            stopped = False
        if stopped:
            return "its supervisor was killed; its loop process then stopped every axis and ended"
        return (
            "its supervisor and its loop process were killed, so nothing but the devices' own "
            "watchdogs disabled the outputs"
        )

    def _keep(self) -> list[str]:
        assert self._run is not None
        draft = self._path.with_name(f"{self._path.name}.{os.getpid()}.tmp")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with draft.open("w") as file:
                file.write(self._run.model_dump_json() + "\n")
                file.flush()
                os.fsync(file.fileno())
            draft.replace(self._path)
        except OSError as error:
            with contextlib.suppress(OSError):
                draft.unlink()
            why = "the next start cannot tell how this run ended"
            return [f"{self._path}: {why}: {in_words(error)}"]
        return []


def _process(pid: int) -> str:
    """Return what no other process is called, in this life of the computer or another."""
    try:
        began = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[19]
        return f"{pid} {began} {_BOOT.read_text().strip()}"
    except (OSError, IndexError):
        return f"{pid}"


def _lives(process: str) -> bool:
    pid = process.partition(" ")[0]
    return pid.isdecimal() and _process(int(pid)) == process


def _changes(before: Any, now: Any, key: str = "") -> Iterator[str]:
    """Yield "key: old -> new" of every value that differs."""
    if not (isinstance(before, Mapping) and isinstance(now, Mapping)):
        if before != now:
            yield f"{key}: {_shown(before)} -> {_shown(now)}"
        return
    for name in {**before, **now}:
        place = f"{key}.{name}" if key else str(name)
        if name not in now:
            yield f"{place} is gone"
        elif name not in before:
            yield f"{place} is new"
        else:
            yield from _changes(before[name], now[name], place)


def _shown(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 60 else text[:57] + "..."
