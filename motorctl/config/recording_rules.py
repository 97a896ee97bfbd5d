"""What the numbers of `recording` must be to each other and to what the machine records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from motorctl.config.recording_keys import RecordingKeys
from motorctl.config.validation import Finding, read_keys
from motorctl.errors import Problem
from motorctl.located_yaml import Document
from motorctl.log.sample import row_bytes

MEGABYTE = 1e6
CLOSED_SHARE = 0.25
"""What a row takes in a closed log, of what it takes while it is recorded: measured with two axes
in motion (docs/recording.md). At rest it is less."""
SHORTEST_S = 60.0
"""A log or a store that holds less than a minute is a slip of the pen."""
CLOSED_LOGS = 2
"""So many of the largest logs must fit into the total: one that is recorded, and one to keep."""

_NEVER = (
    "but nothing could be removed: without rotate (max_size_mb or max_duration_h) a run is one "
    "log, and the one that is recorded is never removed"
)


@dataclass(frozen=True)
class RecordingRate:
    """How much a machine records."""

    row_bytes: int
    """While it is recorded."""
    rate_hz: float

    @property
    def recorded_mb_h(self) -> float:
        """An hour while it is recorded."""
        return self.row_bytes * self.rate_hz * 3600.0 / MEGABYTE

    @property
    def closed_mb_h(self) -> float:
        """An hour in closed logs, about."""
        return self.recorded_mb_h * CLOSED_SHARE


def recording_rate(axes: Iterable[tuple[int, bool, bool]], rate_hz: float) -> RecordingRate:
    """Return how much is recorded.

    Parameters
    ----------
    axes
        Of each axis, how many parameters its model has, whether two motors drive it, and whether it
        learns for programs that repeat.
    rate_hz
        Rows a second.
    """
    return RecordingRate(row_bytes(axes), rate_hz)


def largest_log_mb(recording: RecordingKeys, rate: RecordingRate) -> float | None:
    """Return how large a log becomes while it is recorded; None: without limit."""
    by_time = recording.rotate.max_duration_h
    limits = [
        recording.rotate.max_size_mb,
        None if by_time is None else by_time * rate.recorded_mb_h,
    ]
    return min((limit for limit in limits if limit is not None), default=None)


def check_recording(document: Document, rate: RecordingRate | None) -> list[Problem]:
    """Check the part `recording` of a file; `rate` is None where something of it is not known."""
    recording = read_keys(RecordingKeys, document.part(("recording",)))
    if recording is None:
        return []
    findings = [*_rotation(recording, rate), *_retention(recording, rate)]
    return [document.problem(("recording", *where), message) for where, message in findings]


def _rotation(recording: RecordingKeys, rate: RecordingRate | None) -> Iterator[Finding]:
    size = recording.rotate.max_size_mb
    if size is not None and rate is not None and size < _minute_mb(rate):
        yield ("rotate", "max_size_mb"), _too_small(size, rate, "a log")


def _retention(recording: RecordingKeys, rate: RecordingRate | None) -> Iterator[Finding]:
    kept, rotate = recording.retention, recording.rotate
    if rotate.max_size_mb is None and rotate.max_duration_h is None:
        for key, value in kept:
            if value is not None:
                yield ("retention", key), f"found {value:g}, {_NEVER}"
    total, free, age = kept.max_total_size_mb, kept.min_free_mb, kept.max_age_days
    largest = None if rate is None else largest_log_mb(recording, rate)
    if total is not None and rate is not None and total < _minute_mb(rate):
        yield ("retention", "max_total_size_mb"), _too_small(total, rate, "all logs")
    elif total is not None and largest is not None and total < CLOSED_LOGS * largest:
        message = (
            f"found {total:g}, should be at least {CLOSED_LOGS * largest:.0f}: {CLOSED_LOGS} times "
            f"the largest log, which is {largest:.0f} MB while it is recorded (rotate); else logs "
            "would be removed as soon as they are closed"
        )
        yield ("retention", "max_total_size_mb"), message
    longest = rotate.max_duration_h
    if age is not None and longest is not None and age * 24.0 < longest:
        limit = f"should be at least rotate.max_duration_h: {longest:g}"
        yield ("retention", "max_age_days"), f"found {age:g} ({age * 24:g} h), {limit}"
    stop = recording.disk.stop_below_mb
    if free is not None and stop is not None and free <= stop:
        limit = f"should be more than disk.stop_below_mb: {stop:g}"
        message = f"found {free:g}, {limit}: recording would stop before anything is removed"
        yield ("retention", "min_free_mb"), message


def _minute_mb(rate: RecordingRate) -> float:
    return rate.recorded_mb_h * SHORTEST_S / 3600.0


def _too_small(found: float, rate: RecordingRate, what: str) -> str:
    seconds = found / rate.recorded_mb_h * 3600.0
    return (
        f"found {found:g}: {what} would hold {seconds:.0f} s ({rate.row_bytes} bytes a row at "
        f"{rate.rate_hz:g} Hz are {rate.recorded_mb_h / 60:.0f} MB a minute), should be at least "
        f"{_minute_mb(rate):.0f}"
    )
