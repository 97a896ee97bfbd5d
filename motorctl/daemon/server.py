"""Serve the control socket: a bad client is told so or dropped, and nobody else notices."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from typing import Any

from motorctl.daemon.access import ControlSocket, Role, peer_of
from motorctl.daemon.protocol import (
    MAX_LINE_BYTES,
    Code,
    EmergencyStopCommand,
    RefusedError,
    Request,
    StatusCommand,
    answer,
    parse_request,
    refusal,
    request_id,
)
from motorctl.daemon.request_pace import RequestPace

Handler = Callable[[Request], Awaitable[dict[str, Any]]]

OBSERVERS_COMMANDS = (StatusCommand, EmergencyStopCommand)
MAX_CLIENTS_A_USER = 32
LINE_TIMEOUT_S = 10.0
"""A line that was begun must end within this time."""
WRITE_TIMEOUT_S = 5.0
"""A client that does not take its answers for so long is dropped."""

_log = logging.getLogger("motorctl")


class ControlServer:
    """Reads requests from admitted clients and has `handle` answer them, one after another."""

    def __init__(self, control: ControlSocket, handle: Handler) -> None:
        self._control = control
        self._handle = handle
        self._clients: Counter[int] = Counter()
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        """Begin to accept."""
        self._server = await asyncio.start_unix_server(
            self._accept, sock=self._control.socket, limit=MAX_LINE_BYTES
        )

    async def close(self) -> None:
        """Drop every client and stop accepting."""
        if self._server is not None:
            self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        try:
            await self._admit(reader, writer)
        except (OSError, TimeoutError, asyncio.CancelledError):
            pass  # the client's own trouble, or the server is closing
        finally:
            writer.transport.abort()

    async def _admit(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection: socket.socket = writer.get_extra_info("socket")
        peer = peer_of(connection)
        role = self._control.role_of(peer)
        if role is None:
            _log.warning("control socket: refused process %d of user %d", peer.pid, peer.uid)
            message = (
                f"user {peer.uid} is neither root nor a member of the socket's group "
                f"({self._control.group_id}): `usermod -aG` adds a user to a group"
            )
            await _send(writer, refusal(None, Code.FORBIDDEN, message))
            return
        if self._clients[peer.uid] >= MAX_CLIENTS_A_USER:
            message = f"user {peer.uid} already has {MAX_CLIENTS_A_USER} connections (the limit)"
            await _send(writer, refusal(None, Code.BAD_REQUEST, message))
            return
        self._clients[peer.uid] += 1
        try:
            await self._serve(reader, writer, role)
        finally:
            self._clients[peer.uid] -= 1

    async def _serve(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, role: Role
    ) -> None:
        pace = RequestPace(time.monotonic())
        while True:
            try:
                line = await _read_line(reader)
            except asyncio.LimitOverrunError:
                message = f"the request is longer than the limit of {MAX_LINE_BYTES} bytes"
                await _send(writer, refusal(None, Code.TOO_LARGE, message))
                return
            except asyncio.IncompleteReadError:
                return
            if line.strip():
                await _send(writer, await self._answer(line, role))
            # Lines that are already here are read without waiting: let the others have a turn.
            await asyncio.sleep(pace.wait_s(time.monotonic()))

    async def _answer(self, line: bytes, role: Role) -> bytes:
        try:
            request = parse_request(line)
        except RefusedError as no:
            return refusal(request_id(line), no.code, no.message)
        if role is Role.OBSERVE and not isinstance(request, OBSERVERS_COMMANDS):
            message = (
                f"{request.do}: only members of the group '{self._control.operators}' may command "
                "this machine; others may ask for its status, and for an emergency stop"
            )
            return refusal(request.id, Code.FORBIDDEN, message)
        try:
            return answer(request.id, await self._handle(request))
        except RefusedError as no:
            return refusal(request.id, no.code, no.message)
        except Exception as error:  # a mistake of ours must not end the daemon
            _log.exception("control socket: %s failed", request.do)
            message = f"{request.do} failed: {type(error).__name__}: {error}"
            return refusal(request.id, Code.INTERNAL, message)


async def _read_line(reader: asyncio.StreamReader) -> bytes:
    """Wait as long as it takes for a line to begin, then LINE_TIMEOUT_S for its end."""
    first = await reader.readexactly(1)
    if first == b"\n":
        return first
    async with asyncio.timeout(LINE_TIMEOUT_S):
        return first + await reader.readuntil(b"\n")


async def _send(writer: asyncio.StreamWriter, line: bytes) -> None:
    writer.write(line)
    async with asyncio.timeout(WRITE_TIMEOUT_S):
        await writer.drain()
