"""What can be asked of a running machine, whether the connection blocks or not."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motorctl.api.status import AxisStatus, MachineStatus
from motorctl.daemon.conversation import (
    Ask,
    AxisFaultError,
    Conversation,
    DaemonRefusedError,
    NotReachedError,
    until,
    when_ready,
)
from motorctl.errors import MotorctlError, RunError

REACHED_TIMEOUT_S = 5.0
"""How long an axis may take to hold after the daemon said that it was enabled [s]."""
STOP_TIMEOUT_S = 60.0
"""How long a ramp down may take [s]: longer than any that a configuration allows."""
PROGRAM_FILES = {".yaml", ".yml", ".csv"}
AT_REST = ("idle", "off")

OnWait = Callable[[str], None]


@dataclass(frozen=True)
class Motion:
    """A motion that was begun."""

    axes: tuple[str, ...]
    duration_s: float
    """With the way to where it begins."""
    approach_s: float = 0.0
    """Of that way."""
    program: str | None = None
    """None: a move."""
    target_m: float | None = None
    """Where a move ends [m]; None: a program."""
    notes: tuple[str, ...] = ()
    """Why what an axis learned for it is not used, a sentence each."""


@dataclass(frozen=True)
class Started:
    """An axis that was enabled."""

    axis: str
    motion: Motion | None = None
    """The program that it begins; None: it holds."""
    program: str | None = None
    """The program that it has, if it has one and is to follow it."""
    waits_for: tuple[str, ...] = ()
    """Axes that have to be started, too, before the program begins."""


@dataclass(frozen=True)
class Reset:
    """An axis whose fault was cleared."""

    axis: str
    homed: bool
    """Otherwise `home` comes next."""
    opened: str | None
    """The driver that was closed and opened anew, where its bus or device had been lost."""
    cleared: bool
    """Whether a fault of its drive was cleared, too."""


def status() -> Conversation[MachineStatus]:
    """Ask for the status of all."""
    return MachineStatus.of((yield Ask("status")))


def axis_status(axis: str) -> Conversation[AxisStatus]:
    """Ask for the status of one axis."""
    return AxisStatus.of(axis, (yield Ask("status", {"axis": axis}))["axes"][axis])


def start(axis: str, hold: bool, on_wait: OnWait | None) -> Conversation[Started]:
    """Enable an axis, and wait until it holds where it follows no program."""
    answer = yield from when_ready("start", {"axis": axis, "hold": hold or None}, on_wait)
    if missing := answer.get("waits_for"):
        return Started(axis, None, answer["program"], tuple(missing))
    if "program" in answer:
        return Started(axis, _motion(answer), answer["program"])
    yield from until(axis, _in(("idle", "running")), REACHED_TIMEOUT_S)
    return Started(axis)


def stop(axis: str, timeout_s: float, on_wait: OnWait | None) -> Conversation[AxisStatus]:
    """Ramp an axis down, and wait until it is off."""
    yield from when_ready("stop", {"axis": axis}, on_wait)
    return AxisStatus.of(axis, (yield from until(axis, _in(("off",)), timeout_s)))


def stop_all(timeout_s: float, on_wait: OnWait | None) -> Conversation[tuple[str, ...]]:
    """Ramp every enabled axis down, all at once, and wait until each is off.

    One that trips meanwhile takes no order to stop: it is told once the others are off.
    """
    axes = (yield Ask("status"))["axes"]
    enabled = tuple(name for name, told in axes.items() if told["state"] not in ("off", "fault"))
    failures: list[MotorctlError] = []
    stopping = []
    for axis in enabled:
        try:
            yield from when_ready("stop", {"axis": axis}, on_wait)
            stopping.append(axis)
        except DaemonRefusedError as no:
            failures.append(no)
    for axis in stopping:
        try:
            yield from until(axis, _in(("off",)), timeout_s)
        except (AxisFaultError, NotReachedError) as failure:
            failures.append(failure)
    if failures:
        raise failures[0]
    return enabled


def home(axis: str, timeout_s: float | None, on_wait: OnWait | None) -> Conversation[AxisStatus]:
    """Look for an axis' zero, and wait until it is found."""
    yield from when_ready("home", {"axis": axis}, on_wait)
    told = yield from until(axis, _in(("idle", "off", "stopping")), timeout_s)
    if not told["homed"] or told["state"] != "idle":
        raise RunError(f"axis {axis}: homing was stopped")
    return AxisStatus.of(axis, told)


def move(
    axis: str,
    position_m: float | None,
    by_m: float | None,
    velocity_m_s: float | None,
    acceleration_m_s2: float | None,
    on_wait: OnWait | None,
) -> Conversation[Motion]:
    """Begin a move."""
    given = {
        "axis": axis,
        "position_m": position_m,
        "by_m": by_m,
        "velocity_m_s": velocity_m_s,
        "acceleration_m_s2": acceleration_m_s2,
    }
    answer = yield from when_ready("move", given, on_wait)
    return Motion((axis,), answer["duration_s"], target_m=answer["target_m"])


def program(
    axis: str, name_or_file: str | os.PathLike[str], on_wait: OnWait | None
) -> Conversation[Motion]:
    """Begin a program of the configuration, or of a file."""
    request: dict[str, Any] = {"name": os.fspath(name_or_file)}
    path = Path(name_or_file)
    if path.suffix.lower() in PROGRAM_FILES or len(path.parts) > 1:
        from motorctl.daemon.program_transfer import packed

        request = packed(path, list((yield Ask("status"))["axes"]))
    return _motion((yield from when_ready("program", {"axis": axis, **request}, on_wait)))


def wait(
    axis: str, states: str | Collection[str], timeout_s: float | None
) -> Conversation[AxisStatus]:
    """Wait until an axis is in a state, or in one of several."""
    wanted = (states,) if isinstance(states, str) else states
    return AxisStatus.of(axis, (yield from until(axis, _in(wanted), timeout_s)))


def reset(axis: str, on_wait: OnWait | None) -> Conversation[Reset]:
    """Clear an axis' fault."""
    answer = yield from when_ready("reset", {"axis": axis}, on_wait)
    cleared = bool(answer.get("cleared"))
    return Reset(axis, answer["homed"], answer.get("opened"), cleared)


def reset_all(on_wait: OnWait | None) -> Conversation[tuple[Reset, ...]]:
    """Clear the fault of every axis that has one; what is refused is told once all were asked."""
    axes = (yield Ask("status"))["axes"]
    refused: list[DaemonRefusedError] = []
    done = []
    for axis in (name for name, told in axes.items() if told["state"] == "fault"):
        try:
            done.append((yield from reset(axis, on_wait)))
        except DaemonRefusedError as no:
            refused.append(no)
    if refused:
        off = "".join(f"; axis {each.axis} was reset" for each in done)
        raise DaemonRefusedError(refused[0].code, "; ".join(map(str, refused)) + off)
    return tuple(done)


def estop() -> Conversation[tuple[str, ...]]:
    """Zero and disable every axis at once."""
    return tuple((yield Ask("estop"))["axes"])


def _motion(answer: dict[str, Any]) -> Motion:
    axes, name = tuple(answer["axes"]), answer["program"]
    notes = tuple(answer.get("notes", ()))
    return Motion(axes, answer["duration_s"], answer["approach_s"], name, notes=notes)


def _in(states: Collection[str]) -> Callable[[dict[str, Any]], bool]:
    return lambda told: told["state"] in states
