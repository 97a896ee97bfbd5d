"""What a client asks and waits for, without the connection: the same for one that blocks or not.

A conversation is a generator. It yields an `Ask` and is sent the answer, or thrown the refusal; or
it yields a `Pause` and goes on after it. Who carries it out has the connection and the clock.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from motorctl.daemon.protocol import FAILURES, Code
from motorctl.errors import MotorctlError, RunError

PATIENCE_S: dict[str, float] = {Code.NOT_READY: 120.0, Code.STILL_MOVING: 5.0}
"""How long a loop may compile, and an unpowered axis come to rest, until a client gives up."""
READY_POLL_S = 0.1
POLL_S = 0.02

T = TypeVar("T")


class DaemonRefusedError(MotorctlError):
    """The daemon said no; exit status 2 where the request was wrong, 1 where the daemon failed."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        """As the control socket has it: `wrong_state`, `out_of_limits`, …"""
        self.exit_status = 1 if code in FAILURES else 2


class AxisFaultError(RunError):
    """An axis tripped while it was waited for; the message tells why, and what to do."""

    def __init__(self, axis: str, cause: str, message: str) -> None:
        super().__init__(f"axis {axis}: fault: {message}")
        self.axis = axis
        self.cause = cause
        """As in logs, in small letters: `following_error`, `estop`, …"""


class NotReachedError(RunError, TimeoutError):
    """What was waited for did not come in time."""


@dataclass(frozen=True)
class Ask:
    """One request; None as an argument leaves it out."""

    do: str
    arguments: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Pause:
    """Wait for so long."""

    seconds: float


Conversation = Generator[Ask | Pause, dict[str, Any], T]


def when_ready(
    do: str, arguments: Mapping[str, Any], on_wait: Callable[[str], None] | None = None
) -> Conversation[dict[str, Any]]:
    """Ask, again and again while it is too early, and return the answer.

    Too early: the loop is not ready yet, or the axis still moves. When the patience for the reason
    is over (PATIENCE_S), the refusal is raised as it came. `on_wait` is told the reason once.
    """
    began = time.monotonic()
    waits = False
    while True:
        try:
            return (yield Ask(do, arguments))
        except DaemonRefusedError as no:
            if time.monotonic() - began > PATIENCE_S.get(no.code, 0.0):
                raise
            why = str(no)
        if not waits and on_wait is not None:
            on_wait(why)
        waits = True
        yield Pause(READY_POLL_S)


def until(
    axis: str, reached: Callable[[dict[str, Any]], bool], timeout_s: float | None
) -> Conversation[dict[str, Any]]:
    """Ask until the status of an axis satisfies a condition, and return that status.

    Raises AxisFaultError where the axis is in a fault meanwhile, NotReachedError when `timeout_s`
    is over; None: never.
    """
    began = time.monotonic()
    while True:
        status: dict[str, Any] = (yield Ask("status", {"axis": axis}))["axes"][axis]
        if reached(status):
            return status
        if status["state"] == "fault":
            raise AxisFaultError(axis, status["fault"]["cause"], status["fault"]["message"])
        if timeout_s is not None and time.monotonic() - began > timeout_s:
            message = f"axis {axis} is still {status['state']} after {timeout_s:g} s"
            raise NotReachedError(message)
        yield Pause(POLL_S)


def answered(document: dict[str, Any]) -> dict[str, Any]:
    """Return the content of an answer. Raises DaemonRefusedError where it is a refusal."""
    document.pop("id")
    if document.pop("ok"):
        return document
    error = document["error"]
    raise DaemonRefusedError(error["code"], error["message"])
