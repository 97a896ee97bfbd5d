"""Rows of a running machine, or of a log in its own time, thinned and sent on."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.api.log import Log
from motorctl.api.samples import Samples
from motorctl.errors import UsageError
from motorctl.neighbours.plotjuggler import Destination, datagrams
from motorctl.neighbours.thinning import TIME, stretch_rows, thinned

Columns = Mapping[str, NDArray[Any]]
READ_S = 1.0
"""How much of a log is read at once [s]: bounded memory, however long it is."""


def chosen(names: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """Return the columns that patterns such as ``x.*`` name, `time_s` always; none: all.

    Raises UsageError where a pattern names none.
    """
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise UsageError(f"--column {pattern}: no such column; there are: {', '.join(names)}")
    return [
        name
        for name in names
        if name == TIME or not patterns or any(fnmatchcase(name, each) for each in patterns)
    ]


def send_samples(
    heard: Iterable[Samples],
    destination: Destination,
    row_rate_hz: float,
    message_rate_hz: float,
    patterns: Sequence[str] = (),
) -> None:
    """Send what is heard of a running machine, until that ends.

    Parameters
    ----------
    heard
        Rows as they come, each with the columns of the models that it is of.
    destination
        Where to.
    row_rate_hz, message_rate_hz
        Of the loop, and at most of the messages.
    patterns
        Which columns; none: all.
    """
    rows = stretch_rows(row_rate_hz, message_rate_hz)
    for part in _whole_stretches(_columns_of(heard, patterns), rows):
        for _, datagram in datagrams(part):
            destination.send(datagram)


def replay(
    log: Log,
    destination: Destination,
    message_rate_hz: float,
    speed: float = 1.0,
    patterns: Sequence[str] = (),
) -> None:
    """Send a log as if it came now.

    Parameters
    ----------
    log
        What was recorded.
    destination
        Where to.
    message_rate_hz
        Of the messages at most, by the log's own time.
    speed
        How many of its seconds pass in one.
    patterns
        Which columns; none: all.
    """
    names = chosen(log.columns, patterns)
    rows = stretch_rows(log.sample_rate_hz, message_rate_hz)
    read = max(rows, round(READ_S * log.sample_rate_hz))
    parts = (
        {name: log.part(name, first, min(first + read, log.rows)) for name in names}
        for first in range(0, log.rows, read)
    )
    began = first_s = None
    for part in _whole_stretches(parts, rows):
        for t, datagram in datagrams(part):
            if began is None or first_s is None:
                began, first_s = time.monotonic(), t
            wait_s = began + (t - first_s) / speed - time.monotonic()
            if wait_s > 0.0:
                time.sleep(wait_s)
            destination.send(datagram)


def _columns_of(heard: Iterable[Samples], patterns: Sequence[str]) -> Iterator[Columns]:
    for samples in heard:
        yield {name: samples[name] for name in chosen(samples.columns, patterns)}


def _whole_stretches(parts: Iterable[Columns], rows: int) -> Iterator[Columns]:
    """Thin parts of any length; the rows of a stretch that is not whole wait for the next part."""
    left: dict[str, NDArray[Any]] = {}
    for part in parts:
        if left and left.keys() != part.keys():  # of other models: what is left is never whole
            yield _rest(left)
            left = {}
        joined = (
            {name: np.concatenate([left[name], values]) for name, values in part.items()}
            if left
            else part
        )
        if thin := thinned(joined, rows):
            yield thin
        begin = len(joined[TIME]) // rows * rows
        left = {name: values[begin:] for name, values in joined.items()}
    if left:
        yield _rest(left)


def _rest(left: Columns) -> Columns:
    """Return what is left at the end: two rows of it, as of a whole stretch."""
    rows = len(left[TIME])
    return thinned(left, rows) if rows > 1 else left
