"""The logs of one machine in a folder: what they are called, which there are, which may go."""

from __future__ import annotations

import fcntl
import math
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from motorctl.errors import UsageError
from motorctl.log.partial import SUFFIX

LOG_SUFFIX = ".parquet"
EXPORT_SUFFIX = ".export.parquet"
"""Of a log that was written anew for other programs."""
DRAFT_SUFFIX = ".tmp"
"""Of a log that is being made of its partial file."""
_STAMP = "%Y%m%dT%H%M%SZ"

Reason = Literal["age", "total size", "free space"]


@dataclass(frozen=True)
class StoredLog:
    """A log that stands in the folder, finished or not."""

    path: Path
    """Where it stands, or will stand, when it is finished."""
    size_bytes: int
    """Of all its files: the log, the partial file, the draft."""
    changed_s: float
    """When the newest of them was last written, in seconds since 1970."""
    partial: bool
    """There is a partial file: it is recorded, or waits to be made a log."""

    @property
    def partial_path(self) -> Path:
        """The partial file, whether there is one or not."""
        return self.path.with_name(self.path.name + SUFFIX)


@dataclass(frozen=True)
class Removed:
    """A log that was removed, and what for."""

    path: Path
    size_bytes: int
    reason: Reason


@dataclass(frozen=True)
class Retention:
    """How much is kept; None: no limit."""

    max_age_s: float | None = None
    max_total_bytes: float | None = None
    min_free_bytes: float | None = None


def must_be_writable(folder: Path, role: str = "folder") -> None:
    """Make the folder where it is missing.

    Parameters
    ----------
    folder
        Where files are to be written.
    role
        What a message calls it.

    Raises
    ------
    UsageError
        Where it cannot be made, or not be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{role} {folder}: cannot be made: {error.strerror}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"{role} {folder}: no permission to write there")


def free_log_path(folder: Path, machine: str, when: datetime | None = None) -> Path:
    """Return the name of a log that begins: no file has it, and it comes after all there are.

    A clock that was set back changes nothing of that: then the name has the time of the newest log
    and a further number. Retention would else remove the new before the old.

    Parameters
    ----------
    folder
        Of the logs.
    machine
        Name of the machine.
    when
        The beginning; None: now.
    """
    stamp = f"{when or datetime.now(UTC):{_STAMP}}"
    name = _name_of(machine)
    names = [path.name for path in folder.iterdir()] if folder.is_dir() else []
    matches = [match for match in map(name.fullmatch, names) if match and is_time(match[2])]
    stamp = max([stamp, *(match[2] for match in matches)])
    # A number that became free again would put the log before those that it follows.
    last = max((_number(match) for match in matches if match[2] == stamp), default=0)
    number = f"-{last + 1}" if last else ""
    return folder / f"{machine}-{stamp}{number}{LOG_SUFFIX}"


def time_in_name(path: Path) -> datetime:
    """Return the time in a log's name, in UTC, as `free_log_path` wrote it."""
    stamps = re.findall(r"\d{8}T\d{6}Z", path.name)
    return datetime.strptime(stamps[-1], _STAMP).replace(tzinfo=UTC)


def is_time(stamp: str) -> bool:
    """Tell whether digits in a file's name are a time: others may call files as they like."""
    try:
        datetime.strptime(stamp, _STAMP)
    except ValueError:
        return False
    return True


def _name_of(machine: str) -> re.Pattern[str]:
    """Return what a log of a machine is called: the log, its time, its number, a further ending."""
    return re.compile(rf"({re.escape(machine)}-(\d{{8}}T\d{{6}}Z)(?:-(\d+))?\.parquet)(\.\w+)?")


def _number(match: re.Match[str]) -> int:
    """Return which of the logs that began within a second it is."""
    return int(match[3] or 1)


def stored_logs(folder: Path, machine: str) -> list[StoredLog]:
    """Return a machine's logs in a folder, the oldest first.

    Parameters
    ----------
    folder
        Of the logs; folders in it are not looked at.
    machine
        Name of the machine: what is called otherwise is not its log.
    """
    name = _name_of(machine)
    found: dict[str, tuple[tuple[str, int], StoredLog]] = {}
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            match = name.fullmatch(entry.name)
            if match is None or match[4] not in (None, SUFFIX, DRAFT_SUFFIX):
                continue
            if not is_time(match[2]):
                continue
            try:
                if not entry.is_file(follow_symlinks=False):
                    continue
                stat = entry.stat()
            except OSError:  # gone meanwhile: a draft that became a log
                continue
            log, place = match[1], (match[2], _number(match))
            before = found[log][1] if log in found else StoredLog(folder / log, 0, 0.0, False)
            found[log] = (
                place,
                StoredLog(
                    before.path,
                    before.size_bytes + stat.st_size,
                    max(before.changed_s, stat.st_mtime),
                    before.partial or match[4] == SUFFIX,
                ),
            )
    return [log for _, log in sorted(found.values(), key=lambda item: item[0])]


def remove_outdated(
    folder: Path,
    machine: str,
    retention: Retention,
    now_s: float,
    free_bytes: Callable[[], float],
) -> list[Removed]:
    """Remove the oldest logs of a machine until what is left keeps to the limits.

    What is being recorded, or made a log of, is never removed, nor is any file that is not called
    like a log of this machine; nor, for free space, the newest log. A disk may free what was
    removed only later (btrfs, a reader that has the file open): within one call it counts as free.

    Parameters
    ----------
    folder, machine
        Whose logs.
    retention
        The limits.
    now_s
        Seconds since 1970.
    free_bytes
        Asked for the free space of the disk, anew before each removal.

    Returns
    -------
    list of Removed
        The oldest first.

    Raises
    ------
    OSError
        Where a log cannot be removed; those before it are.
    """
    logs = stored_logs(folder, machine)
    changed_s = _believable_times(logs, now_s)
    total = sum(log.size_bytes for log in logs)
    newest = next((log.path for log in reversed(logs) if not log.partial), None)
    removed: list[Removed] = []
    gone_bytes, free_at_first = 0.0, free_bytes() if retention.min_free_bytes is not None else 0.0
    for log in logs:
        free = math.inf
        if retention.min_free_bytes is not None and log.path != newest:
            free = max(free_bytes(), free_at_first + gone_bytes)
        reason = _outdated(now_s - changed_s[log.path], retention, total, free)
        if reason is None:
            break  # those after it are younger
        if _remove(log):
            removed.append(Removed(log.path, log.size_bytes, reason))
            total -= log.size_bytes
            gone_bytes += log.size_bytes
    return removed


def _believable_times(logs: list[StoredLog], now_s: float) -> dict[Path, float]:
    """Return when each log was last written, as far as that can be.

    One of a time that is yet to come, from before the clock was set back, was written no later than
    the next one: else its age would keep it, and all after it, for ever.
    """
    times, later_s = {}, math.inf
    for log in reversed(logs):
        if log.changed_s <= now_s:
            later_s = log.changed_s
        times[log.path] = later_s
    return times


def _outdated(age_s: float, retention: Retention, total: float, free_bytes: float) -> Reason | None:
    if retention.max_age_s is not None and age_s > retention.max_age_s:
        return "age"
    if retention.max_total_bytes is not None and total > retention.max_total_bytes:
        return "total size"
    if retention.min_free_bytes is not None and free_bytes < retention.min_free_bytes:
        return "free space"
    return None


def _remove(log: StoredLog) -> bool:
    """Remove all files of a log; False where it is in use."""
    with _unless_in_use(log) as mine:
        if mine:
            for path in (log.path, log.path.with_name(log.path.name + DRAFT_SUFFIX)):
                path.unlink(missing_ok=True)
            log.partial_path.unlink(missing_ok=True)
    return mine


@contextmanager
def _unless_in_use(log: StoredLog) -> Iterator[bool]:
    """Hold the lock of a partial file; yields False where a recorder or a converter holds it."""
    if not log.partial:
        yield True
        return
    try:
        handle = os.open(log.partial_path, os.O_RDONLY)
    except FileNotFoundError:  # it became a log meanwhile
        yield True
        return
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        except OSError:  # some file systems know no locks: rather kept than lost
            yield False
        else:
            yield True
    finally:
        os.close(handle)


def in_use(log: StoredLog) -> bool:
    """Tell whether a log is being recorded, or made of its partial file."""
    with _unless_in_use(log) as mine:
        return not mine
