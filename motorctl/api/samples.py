"""Samples of a running machine, every row of its loop, as arrays."""

from __future__ import annotations

import asyncio
import os
import select
import socket
import time
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from motorctl.api.signals import Array, Signals
from motorctl.axis_units import units_of
from motorctl.daemon.client import NoDaemonError, connected, reply_to, request_line
from motorctl.daemon.conversation import answered
from motorctl.errors import RunError
from motorctl.log.columns import Column, LogAxis, log_columns
from motorctl.loop.layout import signature
from motorctl.loop.sample_ring import SampleRing

AGAIN_S = 0.5
"""Between two tries to reach a daemon that has ended [s]. Larger begins later with the next one's
samples, smaller asks more often in vain. By hand."""
RECEIVED_BYTES = 64 << 10


class Samples(Signals):
    """Rows of the loop, one after the other: what a log has of them, under the same names.

    ``samples["x.position_m"]`` has shape (N,). `lost` rows before the first were overwritten before
    they were read.
    """

    def __init__(
        self,
        ticks: NDArray[np.void],
        rows: NDArray[np.void],
        columns: Mapping[str, Column],
        lost: int,
        run: int,
        axes: Sequence[LogAxis] = (),
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        self.lost = lost
        self.run = run
        """0 until the daemon was started anew, then 1, …"""
        self.units = {name: column.unit for name, column in columns.items()}
        self.descriptions = {name: column.field.description for name, column in columns.items()}
        self.log_axes = tuple(axes)
        """What the columns are made of."""
        self.metadata: Mapping[str, Any] = metadata or {}
        """What a log of these rows says of its machine: name, rate, configuration."""
        self._ticks, self._rows, self._columns = ticks, rows, columns

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self._columns)

    @property
    def rows(self) -> int:
        """N."""
        return len(self._ticks)

    def _column(self, name: str) -> Array:
        column = self._columns[name]
        source = self._ticks if column.axis is None else self._rows[:, column.axis]
        values: Array = source[column.field.name]
        if column.entry is not None:
            values = values[:, column.entry]
        values = np.ascontiguousarray(values)
        values.flags.writeable = False
        return values

    def __repr__(self) -> str:
        lost = f", {self.lost} lost before" if self.lost else ""
        return f"<Samples {self.rows} rows of {', '.join(self.axes)}{lost}>"


class Subscription:
    """Reads the rows of a daemon's loop as they come; iterate over it, or call `read`.

    It looks into the memory that the loop writes, through a descriptor that cannot write: neither
    loop nor daemon notices. Rows stay there for about 8 s; who looks less often loses some, and is
    told how many. It ends when the daemon does; with `restarts` it waits for the next one and goes
    on with it, or raises MotorctlError where that one does not let it. Whoever leaves off before
    closes it, or uses it as a context manager.
    """

    def __init__(self, path: Path, *, period_s: float, history_s: float, restarts: bool) -> None:
        self.path = path
        self.period_s = period_s
        """Between two looks [s]."""
        self.lost = 0
        """Rows that were overwritten before they were read, so far."""
        self.ended = False
        """Whether the daemon is gone."""
        self._restarts = restarts
        self._run = 0
        self._kept_out = False
        """Whether the next daemon's socket was there, and not to be connected to."""
        self._connection: socket.socket | None = None
        self._held: tuple[NDArray[np.void], NDArray[np.void]] | None = None
        """Rows that were read and not handed on."""
        self._lost_before = 0
        """How many were lost since the last that were handed on."""
        self._open(history_s)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(axis.name for axis in self._axes)

    def read(self) -> Samples:
        """Return the rows since the last call, at once; all are of the same models.

        Where there are none, `ended` tells whether more may come.

        Raises RunError where the subscription is closed.
        """
        if self._connection is None:
            raise RunError("the subscription is closed")
        self._look_for_end(0.0)  # before the rows: what comes before the end is read, too
        ticks, rows, change = self._unread()
        first, cut = self._ring.drained - len(ticks), len(ticks)
        if change > self._models_row:
            if change > first:
                cut = min(change - first, cut)
            elif not self._learn_models(change):
                cut = 0
        self._held = (ticks[cut:], rows[cut:]) if cut < len(ticks) else None
        lost = self._lost_before if cut else 0
        self._lost_before -= lost
        return self._samples(ticks[:cut], rows[:cut], lost)

    def _samples(self, ticks: NDArray[np.void], rows: NDArray[np.void], lost: int) -> Samples:
        return Samples(ticks, rows, self._columns, lost, self._run, self._axes, self._metadata)

    def _unread(self) -> tuple[NDArray[np.void], NDArray[np.void], int]:
        """Return the rows that were held or else came, and which is the first of other models.

        The daemon tells of the last models alone, and the ring where those before them began: where
        others came and went since those that were told, the rows before the last are lost.
        """
        if self._held is None:
            self._held = self._drain()
        ticks, rows = self._held
        while True:
            before, change = self._ring.last_models_rows
            if min(before, change) <= self._models_row:
                return ticks, rows, change
            unknown = min(max(change - (self._ring.drained - len(ticks)), 0), len(ticks))
            if not unknown:
                return ticks, rows, change
            self._lose(unknown)
            ticks, rows = ticks[unknown:], rows[unknown:]
            if not len(ticks):
                ticks, rows = self._drain()

    def _drain(self) -> tuple[NDArray[np.void], NDArray[np.void]]:
        ticks, rows, lost = self._ring.drain()
        self._lose(lost)
        return ticks, rows

    def _lose(self, rows: int) -> None:
        self.lost += rows
        self._lost_before += rows

    def __iter__(self) -> Iterator[Samples]:
        while True:
            self._look_for_end(self.period_s if self._held is None else 0.0)
            if (samples := self.read()).rows:
                yield samples
            elif self.ended:
                if not self._restarts:
                    self.close()
                    return
                while not self._open_again():
                    time.sleep(AGAIN_S)

    async def __aiter__(self) -> AsyncIterator[Samples]:
        while True:
            await asyncio.sleep(self.period_s if self._held is None else 0.0)
            if (samples := self.read()).rows:
                yield samples
            elif self.ended:
                if not self._restarts:
                    self.close()
                    return
                while not await asyncio.to_thread(self._open_again):
                    await asyncio.sleep(AGAIN_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the daemon's memory."""
        if self._connection is not None:
            self._connection.close()
            self._ring.close()
            self._connection = None

    def _open(self, history_s: float) -> None:
        self._connection, _ = connected(self.path)
        self._count = 0
        descriptor = None
        try:
            told, descriptor = self._ask()
            self._must_mean_the_same(told, descriptor)
        except BaseException:
            self._connection.close()
            self._connection = None
            if descriptor is not None:
                os.close(descriptor)
            raise
        assert descriptor is not None
        self._ring = SampleRing(descriptor, told["layout"])
        self._ring.skip(round(history_s * told["rate_hz"]))
        if self._held is not None:  # of models that the last daemon did not tell any more
            self._lose(len(self._held[0]))
        self._held = None
        self.ended = False
        self._take_models(told)

    def _must_mean_the_same(self, told: Mapping[str, Any], descriptor: int | None) -> None:
        if descriptor is None:
            raise RunError(f"the daemon on {self.path} hands over no samples")
        try:
            same = told["signature"] == signature(told["layout"])
        except (KeyError, TypeError):  # it tells other things of it
            same = False
        if not same:
            raise RunError(
                f"the daemon on {self.path} runs another version of motorctl, whose memory is laid "
                "out otherwise: read its samples with the version that it runs"
            )

    def _open_again(self) -> bool:
        """Try to go on with the next daemon, and return whether it is there.

        Raises MotorctlError where one is there that does not let go on.
        """
        self.close()
        kept_out, self._kept_out = self._kept_out, False
        try:
            self._open(0.0)
        except NoDaemonError:
            return False
        except RunError as error:
            self._kept_out = isinstance(error.__cause__, PermissionError)
            if self._kept_out and not kept_out:  # for a moment it is, until its group is set
                return False
            raise
        self._run += 1
        return True

    def _ask(self) -> tuple[dict[str, Any], int | None]:
        """Return how the memory is laid out, and its descriptor where one came."""
        assert self._connection is not None
        self._count += 1
        descriptors: list[int] = []
        try:
            self._connection.sendall(request_line(self._count, "samples", {}))
            line = _line(self._connection, descriptors)
            told = answered(reply_to(self._count, line, self.path))
        except BaseException as error:
            for descriptor in descriptors:
                os.close(descriptor)
            if isinstance(error, OSError):
                message = f"the daemon on {self.path} does not answer: {error}"
                raise NoDaemonError(message) from error
            raise
        return told, descriptors[0] if descriptors else None

    def _learn_models(self, change: int) -> bool:
        """Ask what the rows of other models are like, and return whether the daemon knows it."""
        try:
            told, _ = self._ask()
        except NoDaemonError:
            self.ended = True
            return False
        except BaseException:  # Ctrl-C, too: the answer would be taken for the next one's
            self.close()
            raise
        if told["models_row"] != change:
            return False
        self._take_models(told)
        return True

    def _take_models(self, told: Mapping[str, Any]) -> None:
        self._models_row = int(told["models_row"])
        self._axes: Sequence[LogAxis] = [
            LogAxis(
                name,
                tuple(axis["theta_names"]),
                axis["dual_drive"],
                units=units_of(axis.get("position_unit")),  # an older daemon tells none
                theta_units=tuple(axis.get("theta_units", ())),
            )
            for name, axis in told["axes"].items()
        ]
        self._columns = {column.name: column for column in log_columns(self._axes)}
        self._metadata: Mapping[str, Any] = told.get("metadata", {})

    def _look_for_end(self, wait_s: float) -> None:
        """Wait for so long, or until the daemon hangs up."""
        if self.ended or self._connection is None:
            time.sleep(wait_s)
            return
        readable, _, _ = select.select([self._connection], [], [], wait_s)
        if readable:
            try:
                self.ended = not self._connection.recv(RECEIVED_BYTES)
            except OSError:
                self.ended = True


def _line(connection: socket.socket, descriptors: list[int]) -> bytes:
    """Return a line, and add the descriptors beside it; ConnectionError where none comes."""
    received = b""
    while not received.endswith(b"\n"):
        part, came, *_ = socket.recv_fds(connection, RECEIVED_BYTES, 1)
        descriptors += came
        received += part
        if not part:
            raise ConnectionError("it hung up")
    return received
