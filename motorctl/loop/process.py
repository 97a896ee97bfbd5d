"""The loop process: everything prepared, then nothing but ticks."""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import signal
import subprocess
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from motorctl.config.machine import Machine
from motorctl.errors import MotorctlError, RunError
from motorctl.garbage import SELDOM
from motorctl.loop.clock import WallClock
from motorctl.loop.model_thread import ModelThread
from motorctl.loop.realtime import (
    NEEDED,
    enter_beside,
    enter_realtime,
    leave_priority,
    reasons,
    usual_priority,
)
from motorctl.loop.reopening import ReopeningThread
from motorctl.loop.runner import run_wall
from motorctl.loop.shared import LoopMemory
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import Degraded, Phase
from motorctl.loop.warm_up import warm_up

SWITCH_INTERVAL_S = 20e-6
"""How long a tick waits at most until a driver that is opened anew gives Python's lock back; its
usual 5 ms are 25 periods of 5 kHz."""


@dataclass(frozen=True)
class EndNote:
    """What the loop process leaves where it ends in order, but without its supervisor."""

    path: Path
    words: str

    def leave(self) -> None:
        """Write it; where that fails, the next start takes the process for killed."""
        with contextlib.suppress(OSError):
            self.path.write_text(self.words)


@dataclass(frozen=True)
class Orders:
    """What the supervisor hands to the loop process on its standard input."""

    machine: Machine
    memory_fd: int
    learned: Mapping[str, Sequence[float]]
    """theta_hat to start from, by axis; axes that are missing start from their configuration."""
    bell_fd: int | None = None
    """An eventfd that is rung for each driver to open anew; None: drivers are opened once."""
    end_note: EndNote | None = None
    models_fd: int | None = None
    """A pipe from which orders for other models come; None: the models stay."""


def spawn(
    machine: Machine,
    memory: LoopMemory,
    *,
    learned: Mapping[str, Sequence[float]] | None = None,
    keep_open: Sequence[int] = (),
    bell_fd: int | None = None,
    end_note: EndNote | None = None,
    models_fd: int | None = None,
) -> subprocess.Popen[bytes]:
    """Start the loop process on this memory.

    Parameters
    ----------
    machine
        What it runs.
    memory
        Its memory, which this process made.
    learned
        theta_hat (n,) to start from, by axis; axes that are missing start from their configuration.
    keep_open
        File descriptors that it holds as long as it lives.
    bell_fd
        An eventfd that this process rings when a driver shall be opened anew.
    end_note
        What it leaves where it loses this process and ends by itself.
    models_fd
        The end of a pipe that orders for other models are read from.

    Returns
    -------
    Popen
        The process; one that died at once is found dead by whoever watches it.
    """
    given = [fd for fd in (bell_fd, models_fd) if fd is not None]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "motorctl.loop"],
        stdin=subprocess.PIPE,
        pass_fds=(memory.fd, *given, *keep_open),
    )
    assert process.stdin is not None
    # A process that died at once is found dead by whoever watches it.
    with contextlib.suppress(BrokenPipeError), process.stdin as pipe:
        # Drivers and effects are found there wherever they were found here.
        pickle.dump(sys.path, pipe)
        orders = Orders(machine, memory.fd, learned or {}, bell_fd, end_note, models_fd)
        pickle.dump(orders, pipe)
    return process


def main() -> int:
    """Run the loop process and return its exit status."""
    # Ctrl-C and systemd's SIGTERM go to the whole group: the supervisor decides what they mean.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    gc.set_threshold(*SELDOM)  # until the first tick, from which on it is not looked for at all
    sys.path[:] = pickle.load(sys.stdin.buffer)
    orders: Orders = pickle.load(sys.stdin.buffer)
    memory = LoopMemory.attach(orders.memory_fd)
    status = memory.status
    status["pid"][0] = os.getpid()
    try:
        orphaned = _run(orders, memory)
    except MotorctlError as error:
        message = str(error)
    except Exception as error:  # a driver may break its contract in any way
        traceback.print_exc()
        message = f"{type(error).__name__}: {error}"
    else:
        if orphaned:
            limit_s = orders.machine.loop.patience_s
            told = f"no sign of life from the supervisor for {limit_s:g} s"
            status["message"][0] = f"{told}: every axis was stopped".encode()
            if orders.end_note is not None:
                orders.end_note.leave()
        memory.phase = Phase.STOPPED
        return 0
    status["message"][0] = message.encode()[:512]
    memory.phase = Phase.FAILED
    return 1


def _run(orders: Orders, memory: LoopMemory) -> bool:
    """Prepare everything and tick until the end; return whether the supervisor was lost.

    The outputs are safe and the devices released when it is left, in whatever way.
    """
    status = memory.status
    memory.phase = Phase.COMPILING
    warm_up(orders.machine)
    tick = Tick(orders.machine, memory, learned=orders.learned)
    tick.prepare()
    degraded = enter_realtime(orders.machine.loop)
    status["degraded"][0] = degraded
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        _insist(orders.machine, degraded)
        with usual_priority():
            tick.open()
        _tick_until_the_end(orders, memory, tick)
    finally:
        leave_priority()
    return bool(tick.watch["orphaned"][0])


def _tick_until_the_end(orders: Orders, memory: LoopMemory, tick: Tick) -> None:
    status = memory.status
    reopening = None
    try:
        notes = [note for name in tick.drivers for note in tick.notes_of(name)]
        status["notes"][0] = "\n".join(notes).encode(errors="replace")
        beside: list[int] = []
        with usual_priority():  # locked memory: all of a thread's stack is made when it begins
            if orders.bell_fd is not None:
                reopening = ReopeningThread(tick, memory, orders.bell_fd)
                beside.append(reopening.begin())
            if orders.models_fd is not None:
                beside.append(ModelThread(tick, memory, orders.models_fd).begin())
        for thread_id in beside:
            enter_beside(thread_id, orders.machine.loop)
        memory.phase = Phase.RUNNING
        run_wall(tick, WallClock(orders.machine.loop.spin_s))
    finally:
        # The axes of the other drivers must not wait for one that is being opened.
        tick.safe(busy=reopening.busy if reopening else None)
        tick.close(busy=reopening.end() if reopening else None)


def _insist(machine: Machine, degraded: Degraded) -> None:
    missing = degraded & NEEDED
    if missing and machine.loop.without_realtime == "refuse":
        raise RunError(
            f"{machine.source}: loop.without_realtime is 'refuse' and this computer lacks what "
            f"real time needs: {'; '.join(reasons(missing))}. Grant it, or set it to 'degrade'"
        )
