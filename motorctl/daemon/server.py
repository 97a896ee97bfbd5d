"""Serve the control socket: a bad client is told so or dropped, and nobody else notices.

Requests are answered in turns, one of each client, for some milliseconds at a time. An emergency
stop has no turn: it is carried out when its bytes come. So what it waits for is one such while and
the reading of what came with it, however many others ask.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any

from motorctl.daemon.access import ControlSocket, Peer, Role, peer_of
from motorctl.daemon.connection import Connection
from motorctl.daemon.places import Place, Places
from motorctl.daemon.protocol import (
    ApplyCommand,
    AxisCommand,
    Code,
    EmergencyStopCommand,
    ExciteCommand,
    ModelsCommand,
    RefusedError,
    Request,
    RevertCommand,
    SamplesCommand,
    StatusCommand,
    answer,
    parse_request,
    refusal,
    request_id,
)

Handler = Callable[[Request], Awaitable[dict[str, Any]]]
Leave = Callable[[ExciteCommand], Awaitable[None]]

OBSERVERS_COMMANDS = (StatusCommand, SamplesCommand, ModelsCommand, EmergencyStopCommand)
CONFIGURATORS_COMMANDS = (ApplyCommand, RevertCommand)
BACKLOG = 1024
"""Connections that wait to be accepted; a client that comes later is turned away by the kernel."""
ACCEPTED_AT_ONCE = 16
ACCEPT_AGAIN_S = 1.0
SLICE_S = 0.005
"""For so long requests are answered before whoever came meanwhile is heard; as long a pause
follows, so that a flood takes half of the supervisor's time at most."""
LONGEST_PAUSE_S = 0.02
STOP_AGAIN_S = 1.0
"""An emergency stop of a client that called one less than this ago waits for its turn."""
STOP_CALLER_S = 1.0
"""So long a connection beyond the limits may wait before it says what it wants."""
OVERTAKEN = "{} was overtaken by an emergency stop, and not begun: ask again if it is still meant"

_log = logging.getLogger("motorctl")


class ControlServer:
    """Reads requests from admitted clients and has `handle` answer them.

    `open_samples` opens what is handed over beside the answer to a request for samples. `leave` is
    told of an excitation whose client is gone, however that came about.
    """

    def __init__(
        self,
        control: ControlSocket,
        handle: Handler,
        open_samples: Callable[[], int] | None = None,
        leave: Leave | None = None,
    ) -> None:
        self._control = control
        self._handle = handle
        self._open_samples = open_samples
        self._leave = leave
        self._lasting: dict[Connection, dict[str, ExciteCommand]] = {}
        """The last excitation of each axis that a client has begun: it lasts as long as they do."""
        self._places = Places()
        self._connections: set[Connection] = set()
        self._turns: deque[Connection] = deque()
        """Each has a line that waits."""
        self._urgent: deque[Connection] = deque()
        """The same, of those that ask for an axis to stop."""
        self._waiting = asyncio.Event()
        self._stopped_s: dict[Connection, float] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._coming: set[socket.socket] = set()
        """Accepted, and not admitted yet."""
        self._trying_again: asyncio.TimerHandle | None = None

    async def start(self) -> None:
        """Begin to accept."""
        self._control.socket.listen(BACKLOG)
        self._listen()
        self._begin(self._take_turns())

    async def close(self) -> None:
        """Drop every client and stop accepting."""
        if self._trying_again is not None:
            self._trying_again.cancel()
        asyncio.get_running_loop().remove_reader(self._control.socket)
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for connected in self._coming:
            connected.close()
        self._leave = None  # the daemon ends, and every axis with it
        for connection in tuple(self._connections):
            connection.drop()
        await asyncio.sleep(0)  # in which they are told

    def _begin(self, doing: Any) -> None:
        task = asyncio.get_running_loop().create_task(doing)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _accept(self) -> None:
        for _ in range(ACCEPTED_AT_ONCE):
            try:
                connected, _address = self._control.socket.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:  # no descriptors left: those who are here go on
                _log.warning("control socket: nobody can be accepted: %s", error.strerror)
                events = asyncio.get_running_loop()
                events.remove_reader(self._control.socket)
                self._trying_again = events.call_later(ACCEPT_AGAIN_S, self._listen)
                return
            connected.setblocking(False)
            self._coming.add(connected)
            self._begin(self._admit(connected))

    def _listen(self) -> None:
        asyncio.get_running_loop().add_reader(self._control.socket, self._accept)

    async def _admit(self, connected: socket.socket) -> None:
        self._coming.discard(connected)
        try:
            peer = peer_of(connected)
        except OSError:
            connected.close()
            return
        role = self._control.role_of(peer)
        if role is None:
            _log.warning("control socket: refused process %d of user %d", peer.pid, peer.uid)
            message = (
                f"user {peer.uid} is neither root nor a member of the socket's group "
                f"({self._control.group_id}): `usermod -aG` adds a user to a group"
            )
            _turn_away(connected, Code.FORBIDDEN, message)
            return
        place, why = self._places.take(peer.uid)
        if place is Place.NONE:
            _turn_away(connected, Code.BAD_REQUEST, why)
            return
        try:
            await self._listen_to(connected, peer, role, place, why)
        except BaseException as error:
            connected.close()
            self._places.give_back(peer.uid, place)
            if not isinstance(error, OSError):
                raise

    async def _listen_to(
        self, connected: socket.socket, peer: Peer, role: Role, place: Place, why: str
    ) -> None:
        events = asyncio.get_running_loop()
        full = place is Place.FULL
        refused = refusal(None, Code.BAD_REQUEST, why)
        connection = Connection(
            role,
            self._wait_for_turn if full else partial(_refuse, refused),
            partial(self._stop_at_once, place),
            partial(self._end, peer.uid, place),
        )
        await events.connect_accepted_socket(lambda: connection, connected)
        self._connections.add(connection)
        if not full:
            events.call_later(STOP_CALLER_S, connection.hang_up_if_silent, refused)

    def _end(self, uid: int, place: Place, connection: Connection) -> None:
        self._places.give_back(uid, place)
        self._connections.discard(connection)
        self._stopped_s.pop(connection, None)
        for request in self._lasting.pop(connection, {}).values():
            self._let_go(request)

    def _let_go(self, request: ExciteCommand) -> None:
        if self._leave is not None:
            self._begin(self._leave(request))

    def _wait_for_turn(self, connection: Connection) -> None:
        urgent = connection.role.commands and _stops(connection.waiting_line())
        (self._urgent if urgent else self._turns).append(connection)
        self._waiting.set()

    async def _take_turns(self) -> None:
        while True:
            await self._waiting.wait()
            began = time.monotonic()
            while (self._urgent or self._turns) and time.monotonic() - began < SLICE_S:
                connection = (self._urgent or self._turns).popleft()
                try:
                    if not connection.ended:
                        await self._take_turn(connection)
                except Exception:  # a mistake of ours must not silence the others
                    _log.exception("control socket: a request failed")
                    connection.drop()
            if self._urgent or self._turns:
                await asyncio.sleep(min(time.monotonic() - began, LONGEST_PAUSE_S))
            else:
                self._waiting.clear()

    async def _take_turn(self, connection: Connection) -> None:
        line, overtaken = connection.next_line()
        if not line.strip():
            connection.pass_over()
            return
        try:
            request = parse_request(line)
        except RefusedError as no:
            connection.answer(refusal(request_id(line), no.code, no.message))
            return
        try:
            self._must_be_allowed(request, connection.role, overtaken)
        except RefusedError as no:
            connection.answer(refusal(request.id, no.code, no.message))
            return
        if isinstance(request, StatusCommand):
            await self._answer(connection, connection.answer, request)
            return
        if isinstance(request, EmergencyStopCommand):
            self._overtake_all_but(connection)
        tell = connection.answer
        if isinstance(request, SamplesCommand) and self._open_samples is not None:
            tell = partial(connection.answer_with_descriptor, self._open_samples)
        self._begin(self._answer(connection, tell, request))
        await asyncio.sleep(0)  # it may take a while to begin, and counts

    def _stop_at_once(self, place: Place, connection: Connection, line: bytes) -> bool:
        """Carry out an emergency stop before whatever waits; tell whether the line is one."""
        now_s = time.monotonic()
        if now_s - self._stopped_s.get(connection, -STOP_AGAIN_S) < STOP_AGAIN_S:
            return False
        try:
            request = parse_request(line)
        except RefusedError:
            return False
        if not isinstance(request, EmergencyStopCommand):
            return False
        self._stopped_s[connection] = now_s
        self._overtake_all_but(connection)
        tell = connection.answer_stop if place is Place.FULL else connection.answer_stop_and_end
        self._begin(self._answer(connection, tell, request))
        return True

    def _overtake_all_but(self, stopping: Connection) -> None:
        """See to it that nothing begins after an emergency stop that was asked for before it."""
        for connection in self._connections:
            if connection is not stopping:
                connection.overtake()

    def _must_be_allowed(self, request: Request, role: Role, overtaken: bool) -> None:
        if isinstance(request, OBSERVERS_COMMANDS):
            return
        if overtaken:
            raise RefusedError(Code.OVERTAKEN, OVERTAKEN.format(request.do))
        if role is Role.OBSERVE:
            raise RefusedError(
                Code.FORBIDDEN,
                f"{request.do}: only members of the group '{self._control.operators}' may command "
                "this machine: have root add you to it, and log in anew; others may ask for its "
                "status, and for an emergency stop",
            )
        if isinstance(request, CONFIGURATORS_COMMANDS) and role is not Role.CONFIGURE:
            raise RefusedError(
                Code.FORBIDDEN,
                f"{request.do}: only who may write {self._control.configuration}, root and the "
                "daemon's user may change the models of this machine: ask one of them",
            )

    async def _answer(
        self, connection: Connection, tell: Callable[[bytes], None], request: Request
    ) -> None:
        try:
            line = answer(request.id, await self._handle(request))
            if isinstance(request, ExciteCommand):
                self._note_lasting(connection, request)
        except RefusedError as no:
            line = refusal(request.id, no.code, no.message)
        except Exception as error:  # a mistake of ours must not end the daemon
            _log.exception("control socket: %s failed", request.do)
            message = f"{request.do} failed: {type(error).__name__}: {error}"
            line = refusal(request.id, Code.INTERNAL, message)
        tell(line)

    def _note_lasting(self, connection: Connection, request: ExciteCommand) -> None:
        if connection.ended:  # while it was being begun
            self._let_go(request)
        else:
            self._lasting.setdefault(connection, {})[request.axis] = request


def _turn_away(connected: socket.socket, code: Code, message: str) -> None:
    """Say no to whoever has just connected, if it listens."""
    with connected, suppress(OSError):
        connected.send(refusal(None, code, message))


def _stops(line: bytes) -> bool:
    """Tell whether a line, or its beginning, asks for an axis to stop."""
    if b"stop" not in line:  # nearly all
        return False
    try:
        request = parse_request(line)
    except RefusedError:
        return False
    return isinstance(request, AxisCommand) and request.do == "stop"


def _refuse(refused: bytes, connection: Connection) -> None:
    connection.hang_up(refused)
