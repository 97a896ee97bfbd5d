"""A driver whose bus was lost is closed and opened anew, in a thread beside the ticks.

The same thread passes on that a device is to forget its fault.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time

import numpy as np

from motorctl.config.dual_drive_keys import SECOND_END
from motorctl.errors import MotorctlError
from motorctl.hal import Inputs, Outputs, Status
from motorctl.loop.guards.device import FORGET_PLACE
from motorctl.loop.layout import REOPEN_TOLD_BYTES
from motorctl.loop.shared import LoopMemory
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import Word

LOOK_S = 2e-3
"""Between two looks at what the ticks have done."""
END_S = 1.5
"""How long the end of the loop waits for an `open` that is under way."""

AWAY = np.uint32(int(Status.BUS_OFF | Status.COMMUNICATION_LOST | Status.STALE) | FORGET_PLACE)


class Away:
    """Stands in the ticks for a driver that is not open: gone, and its count forgotten."""

    def __init__(self) -> None:
        self.passed = False
        """A whole tick has gone through it, so none is within the driver any more."""

    def read(self, inputs: Inputs) -> None:
        """Leave the counts as they are, and say that they mean nothing."""
        inputs.status[:] = AWAY

    def write(self, outputs: Outputs) -> None:
        """Drop the volts."""
        self.passed = True


class ReopeningThread:
    """The thread that opens drivers anew, one at a time, each on an order of the supervisor's.

    Tick and thread share no lock. The thread puts `Away` in the driver's place, waits until a tick
    has gone through it, and then has the driver for itself; in the end it puts it back. A tick
    takes the drivers' doors once, at its start.
    """

    def __init__(self, tick: Tick, memory: LoopMemory, bell_fd: int) -> None:
        self._tick = tick
        self._memory = memory
        self._bell_fd = bell_fd
        self._ending = False
        self.busy: str | None = None
        """The driver that is being opened."""
        self._thread = threading.Thread(target=self._serve, name="reopening", daemon=True)

    def begin(self) -> int:
        """Start the thread, which then sleeps until it is rung for; return its id."""
        self._thread.start()
        assert self._thread.native_id is not None
        return self._thread.native_id

    def end(self) -> str | None:
        """Open nothing any more; return the driver that an `open` still has after END_S, if any."""
        self._ending = True
        with contextlib.suppress(OSError):
            os.eventfd_write(self._bell_fd, 1)
        if self._thread.ident is not None:  # it may not have begun
            self._thread.join(END_S)
        return self.busy

    def _serve(self) -> None:
        memory = self._memory
        done = memory.look_at(Word.REOPEN_DONE)
        axes = list(self._tick.machine.axes.values())
        while not self._ending:
            os.eventfd_read(self._bell_fd)
            asked = memory.look_at(Word.REOPEN_ASKED)
            if asked == done or self._ending:
                continue
            axis = axes[int(memory.status["reopen_axis"][0])]
            try:
                if memory.status["reopen_clears"][0]:
                    problem, told = self._clear_fault(axis.name, axis.driver)
                else:
                    self.busy = axis.driver
                    problem, told = self._open_anew(axis.driver)
            except BaseException as error:  # whatever it is, who asked is told, and the next served
                problem, told = True, f"{type(error).__name__}: {error}"
            self.busy = None
            memory.status["reopen_failed"][0] = problem
            memory.status["reopen_told"][0] = told.encode(errors="replace")[:REOPEN_TOLD_BYTES]
            memory.announce(Word.REOPEN_DONE, asked)
            done = asked

    def _clear_fault(self, axis: str, name: str) -> tuple[bool, str]:
        """Let the next ticks ask the devices of an axis to forget their faults."""
        driver = self._tick.drivers[name]
        for number, channel in enumerate(driver.channels):
            if channel.axis in (axis, axis + SECOND_END):
                driver.clear_fault(number)
        return False, ""

    def _open_anew(self, name: str) -> tuple[bool, str]:
        """Close and open a driver; return whether that failed, and why or what it notes."""
        tick = self._tick
        driver, away = tick.drivers[name], Away()
        tick.put_in_place(name, away)
        while not away.passed:
            if self._ending:
                return True, "the loop is ending"
            time.sleep(LOOK_S)
        if name not in tick.closed:
            # What is left of the bus may raise; whether there is a new one is up to `open`.
            with contextlib.suppress(Exception):
                driver.safe()
            tick.closed.add(name)
            with contextlib.suppress(Exception):
                driver.close()
        try:
            driver.prepare()
            driver.open()
        except Exception as error:  # a driver may break its contract in any way
            with contextlib.suppress(Exception):
                driver.safe()
            foreseen = isinstance(error, MotorctlError)
            return True, str(error) if foreseen else f"{type(error).__name__}: {error}"
        tick.closed.discard(name)
        tick.put_in_place(name, driver)
        self._wait_until_read(name)
        return False, "\n".join(tick.notes_of(name))

    def _wait_until_read(self, name: str) -> None:
        """Wait until every axis has seen the device: who is told of the opening may command it."""
        ticks = self._memory.status["tick"]
        slowest = max(a.divisor for a in self._tick.machine.axes.values() if a.driver == name)
        seen = int(ticks[0]) + slowest + 1
        while int(ticks[0]) < seen and not self._ending:
            time.sleep(LOOK_S)
