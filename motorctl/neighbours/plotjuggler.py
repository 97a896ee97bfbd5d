"""Rows as PlotJuggler's UDP server takes them: one JSON object with its time a datagram."""

from __future__ import annotations

import json
import math
import socket
from collections.abc import Iterator, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Self
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import RunError, UsageError
from motorctl.neighbours.thinning import TIME

STAMP = "timestamp"
"""The key that PlotJuggler is told to take as the time."""
USUAL_PORT = 9870
"""Of PlotJuggler's UDP server."""
LARGEST_BYTES = 65_507
"""Of a datagram over IPv4."""


class Destination:
    """Where datagrams go; nobody has to listen there: `unheard` counts what came back.

    Raises UsageError where the address is none, RunError where there is no such host.
    """

    def __init__(self, url: str) -> None:
        host, port = _place(url)
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        except OSError as error:
            raise RunError(f"{url}: no such host: {error.strerror or error}") from error
        family, kind, protocol, _, address = found[0]
        self._socket = socket.socket(family, kind, protocol)
        self.sent = 0
        self.unheard = 0
        """Of them, how many were refused there, as far as the network tells."""
        try:
            self._socket.connect(address)
        except OSError as error:
            self._socket.close()
            raise RunError(f"{url}: cannot be reached: {error.strerror or error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._socket.close()

    def send(self, datagram: bytes) -> None:
        """Send one. Raises UsageError where it is too large, RunError where it cannot be sent."""
        if len(datagram) > LARGEST_BYTES:
            raise UsageError(
                f"a row takes {len(datagram)} bytes, more than a datagram has ({LARGEST_BYTES}): "
                "name the columns that you want with --column"
            )
        try:
            try:
                self._socket.send(datagram)
            except ConnectionRefusedError:  # of one before: this one was not tried
                self.unheard += 1
                with suppress(ConnectionRefusedError):
                    self._socket.send(datagram)
        except OSError as error:
            raise RunError(f"nothing more can be sent: {error.strerror or error}") from error
        self.sent += 1


def datagrams(columns: Mapping[str, NDArray[Any]]) -> Iterator[tuple[float, bytes]]:
    """Yield each row's time [s] and its datagram.

    ``x.position_m`` becomes ``{"x": {"position_m": …}}``, which PlotJuggler shows as
    ``/x/position_m``. What is no finite number is left out, as JSON knows none.

    Parameters
    ----------
    columns
        Shape (N,) each, `time_s` among them.
    """
    time_s = columns[TIME].tolist()
    values = {name: column.tolist() for name, column in columns.items() if name != TIME}
    doubtful = {name for name in values if not np.all(np.isfinite(columns[name]))}
    for i, t in enumerate(time_s):
        row: dict[str, Any] = {STAMP: t}
        for name, column in values.items():
            if name in doubtful and not math.isfinite(column[i]):
                continue
            axis, dot, signal = name.rpartition(".")
            (row.setdefault(axis, {}) if dot else row)[signal] = column[i]
        yield t, json.dumps(row, separators=(",", ":")).encode()


def _place(url: str) -> tuple[str, int]:
    wanted = f"udp://HOST or udp://HOST:PORT (usual: {USUAL_PORT})"
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError as error:
        raise UsageError(f"{url}: {error}; should be {wanted}") from error
    if parts.scheme != "udp" or not parts.hostname or parts.path.strip("/") or parts.query:
        raise UsageError(f"{url}: should be {wanted}")
    if port == 0:
        raise UsageError(f"{url}: port 0 is none; should be {wanted}")
    return parts.hostname, port or USUAL_PORT
