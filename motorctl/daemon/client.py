"""Talk to a daemon over its control socket."""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from motorctl.daemon.access import insist_on_own_server
from motorctl.daemon.conversation import (
    POLL_S,
    Ask,
    Conversation,
    DaemonRefusedError,
    Pause,
    T,
    answered,
    until,
    when_ready,
)
from motorctl.daemon.paths import SYSTEM_FOLDER, client_socket
from motorctl.errors import MotorctlError, RunError, UsageError

ANSWER_TIMEOUT_S = 30.0
SLOW_TIMEOUT_S = 600.0
SLOW = ("apply", "revert")
"""Commands that compile before they do anything: minutes on a slow computer."""
CONNECT_TIMEOUT_S = 5.0

__all__ = [
    "Client",
    "DaemonRefusedError",
    "NoDaemonError",
    "allowed_s",
    "connected",
    "reply_to",
    "request_line",
]


class NoDaemonError(RunError):
    """Nobody answers on a socket, so far."""


class Client:
    """One connection to a daemon; use as a context manager.

    Raises RunError where no daemon answers or it stops answering, DaemonRefusedError where it
    says no, UsageError where the one on a socket that nobody named is another user's: it could
    say that the machine was stopped, and do nothing. Below SYSTEM_FOLDER root lets services be.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._socket, self.path = connected(path)
        self._count = 0
        self._gone: str | None = None
        """Why nothing more can be asked, or None."""
        self._lines = self._socket.makefile("rb")

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
        """Hang up."""
        self._hang_up(f"the connection to the daemon on {self.path} was closed here")

    def _hang_up(self, why: str) -> None:
        self._gone = self._gone or why
        self._lines.close()
        self._socket.close()

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Send one request and wait for its answer.

        Parameters
        ----------
        do
            Name of the command.
        **arguments
            Keys of the request; None leaves one out.

        Returns
        -------
        dict
            The answer without `id` and `ok`.

        Raises
        ------
        RunError
            Where the daemon does not answer within ANSWER_TIMEOUT_S (of a slow command
            SLOW_TIMEOUT_S), or closes the connection. It may still carry the request out. After
            that, and after an exception that broke the wait off, nothing more is sent.
        DaemonRefusedError
            Where the daemon refuses the request.
        """
        if self._gone is not None:
            raise RunError(f"{self._gone}: nothing was sent; connect anew")
        self._count += 1
        line = request_line(self._count, do, arguments)
        try:
            reply = self._reply_to(self._count, line, allowed_s(do))
        except BaseException as error:  # Ctrl-C, too: the answer would be taken for the next one's
            why = "a request was broken off before its answer came"
            self._hang_up(str(error) if isinstance(error, MotorctlError) else why)
            raise
        return answered(reply)

    def _reply_to(self, number: int, line: bytes, timeout_s: float) -> dict[str, Any]:
        """Send a request and return the reply; raises MotorctlError where none to it comes."""
        self._socket.settimeout(timeout_s)
        try:
            # A daemon that refuses the client, or finds the request too long, answers unread.
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                self._socket.sendall(line)
            told = self._lines.readline()
        except TimeoutError:
            message = f"the daemon on {self.path} did not answer within {timeout_s:g} s"
            raise RunError(message) from None
        except OSError as error:
            message = f"the daemon on {self.path} closed the connection: {error.strerror}"
            raise RunError(message) from error
        if not told:
            raise RunError(f"the daemon on {self.path} closed the connection without an answer")
        return reply_to(number, told, self.path)

    def ask_when_ready(
        self, do: str, on_wait: Callable[[str], None], **arguments: Any
    ) -> dict[str, Any]:
        """Send one request, again and again while it is too early for it.

        Too early: the loop is not ready yet, or the axis still moves. When the patience for the
        reason is over (PATIENCE_S), the refusal is raised as it came.

        Parameters
        ----------
        do, **arguments
            As of `ask`.
        on_wait
            Called once where the request has to wait, with the reason.
        """
        return self.carry_out(when_ready(do, arguments, on_wait))

    def axis(self, axis: str) -> dict[str, Any]:
        """Return the status of one axis."""
        status: dict[str, Any] = self.ask("status", axis=axis)["axes"][axis]
        return status

    def wait_for(
        self, axis: str, reached: Callable[[dict[str, Any]], bool], timeout_s: float | None
    ) -> dict[str, Any]:
        """Ask until the status of an axis satisfies a condition; return that status.

        Parameters
        ----------
        axis
            Name of the axis.
        reached
            The condition, on the axis' part of the status document.
        timeout_s
            How long to wait [s]; None: for ever.

        Raises
        ------
        RunError
            Where the axis falls into a fault meanwhile, or the time is over.
        """
        return self.carry_out(until(axis, reached, timeout_s))

    def carry_out(self, conversation: Conversation[T]) -> T:
        """Carry a conversation out to its end, and return what comes of it."""
        try:
            step = next(conversation)
            while True:
                try:
                    answer = self._take(step)
                except MotorctlError as error:
                    step = conversation.throw(error)
                else:
                    step = conversation.send(answer)
        except StopIteration as end:
            result: T = end.value
            return result

    def _take(self, step: Ask | Pause) -> dict[str, Any]:
        if isinstance(step, Ask):
            return self.ask(step.do, **step.arguments)
        time.sleep(step.seconds)
        return {}


def connected(path: Path | None) -> tuple[socket.socket, Path]:
    """Return a connection to a daemon, and the path of its socket; errors as of `Client`.

    While too many others wait to be accepted, it is tried again.
    """
    place = client_socket() if path is None else path
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(ANSWER_TIMEOUT_S)
    deadline = time.monotonic() + CONNECT_TIMEOUT_S
    try:
        while True:
            try:
                connection.connect(str(place))
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(POLL_S)
            else:
                break
        if path is None and not place.is_relative_to(SYSTEM_FOLDER):
            insist_on_own_server(connection, place)
    except OSError as error:
        connection.close()
        raise _unreachable(place, error) from error
    except UsageError:
        connection.close()
        raise
    return connection, place


def request_line(number: int, do: str, arguments: Mapping[str, Any]) -> bytes:
    """Return the line of a request; arguments that are None are left out."""
    given = {key: value for key, value in arguments.items() if value is not None}
    return json.dumps({"id": number, "do": do, **given}).encode() + b"\n"


def reply_to(number: int, line: bytes, path: Path) -> dict[str, Any]:
    """Return the reply in a line, for `answered`.

    Raises RunError where it is none to the request of that number, DaemonRefusedError where nobody
    is heard on this connection.
    """
    try:
        reply: dict[str, Any] = json.loads(line)
        answers = reply["id"]
    except (ValueError, KeyError, TypeError) as error:
        message = f"what answers on {path} is no daemon: its answers make no sense"
        raise RunError(message) from error
    if answers is None:
        answered(reply)
    if answers != number:
        raise RunError(f"the daemon on {path} answered another request than the last one")
    return reply


def allowed_s(do: str) -> float:
    """Return how long the answer to a request may take [s]."""
    return SLOW_TIMEOUT_S if do in SLOW else ANSWER_TIMEOUT_S


def _unreachable(path: Path, error: OSError) -> MotorctlError:
    if isinstance(error, FileNotFoundError | ConnectionRefusedError):
        return NoDaemonError(
            f"no daemon answers on {path}: start one with 'motorctl run CONFIG', "
            "or name its socket with --socket"
        )
    if isinstance(error, PermissionError):
        return RunError(f"{path}: permission denied: only root and the socket's group may connect")
    if isinstance(error, BlockingIOError):
        return NoDaemonError(f"the daemon on {path} accepts nobody for {CONNECT_TIMEOUT_S:g} s")
    return UsageError(f"{path}: {error.strerror or error}")
