"""Talk to a daemon over its control socket."""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from motorctl.daemon.access import insist_on_own_server
from motorctl.daemon.paths import SYSTEM_FOLDER, client_socket
from motorctl.daemon.protocol import FAILURES, Code
from motorctl.errors import MotorctlError, RunError, UsageError

ANSWER_TIMEOUT_S = 30.0
SLOW_TIMEOUT_S = 600.0
SLOW = ("apply", "revert")
"""Commands that compile before they do anything: minutes on a slow computer."""
CONNECT_TIMEOUT_S = 5.0
PATIENCE_S: dict[str, float] = {Code.NOT_READY: 120.0, Code.STILL_MOVING: 5.0}
"""How long a loop may compile, and an unpowered axis come to rest, until a client gives up."""
READY_POLL_S = 0.1
POLL_S = 0.02


class DaemonRefusedError(MotorctlError):
    """The daemon said no; exit status 2 where the request was wrong, 1 where the daemon failed."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.exit_status = 1 if code in FAILURES else 2


class Client:
    """One connection to a daemon; use as a context manager.

    Raises RunError where no daemon answers or it stops answering, DaemonRefusedError where it
    says no, UsageError where the one on a socket that nobody named is another user's: it could
    say that the machine was stopped, and do nothing. Below SYSTEM_FOLDER root lets services be.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = client_socket() if path is None else path
        self._count = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(ANSWER_TIMEOUT_S)
        try:
            self._connect()
            if path is None and not self.path.is_relative_to(SYSTEM_FOLDER):
                insist_on_own_server(self._socket, self.path)
        except OSError as error:
            self._socket.close()
            raise _unreachable(self.path, error) from error
        except UsageError:
            self._socket.close()
            raise
        self._lines = self._socket.makefile("rb")

    def _connect(self) -> None:
        """Connect; while too many others wait to be accepted, try again."""
        deadline = time.monotonic() + CONNECT_TIMEOUT_S
        while True:
            try:
                self._socket.connect(str(self.path))
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(POLL_S)
            else:
                return

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
            SLOW_TIMEOUT_S), or closes the connection.
        DaemonRefusedError
            Where the daemon refuses the request.
        """
        self._count += 1
        given = {key: value for key, value in arguments.items() if value is not None}
        line = json.dumps({"id": self._count, "do": do, **given}) + "\n"
        timeout_s = SLOW_TIMEOUT_S if do in SLOW else ANSWER_TIMEOUT_S
        self._socket.settimeout(timeout_s)
        try:
            # A daemon that refuses the client, or finds the request too long, answers unread.
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                self._socket.sendall(line.encode())
            reply = self._lines.readline()
        except TimeoutError:
            message = f"the daemon on {self.path} did not answer within {timeout_s:g} s"
            raise RunError(message) from None
        except OSError as error:
            message = f"the daemon on {self.path} closed the connection: {error.strerror}"
            raise RunError(message) from error
        if not reply:
            raise RunError(f"the daemon on {self.path} closed the connection without an answer")
        return _content(json.loads(reply))

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
        began = time.monotonic()
        waits = False
        while True:
            try:
                return self.ask(do, **arguments)
            except DaemonRefusedError as no:
                if time.monotonic() - began > PATIENCE_S.get(no.code, 0.0):
                    raise
                why = str(no)
            if not waits:
                waits = True
                on_wait(why)
            time.sleep(READY_POLL_S)

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
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not reached(status := self.axis(axis)):
            if status["state"] == "fault":
                raise RunError(f"axis {axis}: fault: {status['fault']['message']}")
            if deadline is not None and time.monotonic() > deadline:
                message = f"axis {axis} is still {status['state']} after {timeout_s:g} s"
                raise RunError(message)
            time.sleep(POLL_S)
        return status


def _content(document: dict[str, Any]) -> dict[str, Any]:
    document.pop("id")
    if document.pop("ok"):
        return document
    error = document["error"]
    raise DaemonRefusedError(error["code"], error["message"])


def _unreachable(path: Path, error: OSError) -> MotorctlError:
    if isinstance(error, FileNotFoundError | ConnectionRefusedError):
        return RunError(
            f"no daemon answers on {path}: start one with 'motorctl run CONFIG', "
            "or name its socket with --socket"
        )
    if isinstance(error, PermissionError):
        return RunError(f"{path}: permission denied: only root and the socket's group may connect")
    if isinstance(error, BlockingIOError):
        return RunError(f"the daemon on {path} accepts nobody for {CONNECT_TIMEOUT_S:g} s")
    return UsageError(f"{path}: {error.strerror or error}")
