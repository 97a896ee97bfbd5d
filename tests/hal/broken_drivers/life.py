"""Drivers that are wrong in opening, closing and running for long."""

from __future__ import annotations

import ctypes
import itertools
import signal
from typing import Any

from wire_driver import WireDriver

from broken_drivers.registry import ABSENT, ANEW, LOCKED, UNOPENED, VIRTUAL, fails
from motorctl.hal import Inputs, Outputs, RunError


@fails(ABSENT)
class DoesNotSayWhichDevice(WireDriver):
    def refuse(self) -> None:
        raise RunError("no answer")


@fails(ABSENT)
class ShowsATraceback(WireDriver):
    def refuse(self) -> None:
        raise FileNotFoundError("wire0")


@fails(ABSENT)
class CannotTryAgain(WireDriver):
    failed = False

    def refuse(self) -> None:
        self.failed = True
        super().refuse()

    def open(self) -> None:
        super().open()
        if self.failed:
            self.refuse()


@fails("test_safe_ends_at_zero_and_disabled", "test_closing_leaves_the_device_at_zero_and_disabled")
class ForgetsAChannelInSafe(WireDriver):
    def safe(self) -> None:
        if self.device is None:
            super().safe()
        elif not self.device.gone:
            self.device.volts[0], self.device.enabled[0] = 0.0, False


@fails(UNOPENED)
class IsSafeOnlyWhileOpen(WireDriver):
    def safe(self) -> None:
        if self.device is not None:
            super().safe()


@fails("test_closing_leaves_the_device_at_zero_and_disabled")
class WritesAfterClosing(WireDriver):
    old: Any = None

    def close(self) -> None:
        self.old = self.device
        super().close()

    def write(self, outputs: Outputs) -> None:
        if self.device is not None or self.old is None:
            super().write(outputs)
        else:
            self.device = self.old
            super().write(outputs)
            self.device = None

    def safe(self) -> None:
        if self.device is not None or self.old is None:
            super().safe()


@fails("test_closing_leaves_the_device_at_zero_and_disabled")
class RaisesAfterClosing(WireDriver):
    was_open = False

    def open(self) -> None:
        super().open()
        self.was_open = True

    def read(self, inputs: Inputs) -> None:
        if self.was_open and self.device is None:
            raise ValueError("file descriptor cannot be a negative integer (-1)")
        super().read(inputs)


@fails("test_it_opens_again_after_closing", ANEW, LOCKED)
class OpensTwice(WireDriver):
    times = 0

    def open(self) -> None:
        self.times += 1
        if self.times > 2:
            raise RunError(f"port {self.port}: in use")
        super().open()


@fails(ANEW, LOCKED)
class IsBoundToItsThread(WireDriver):
    def open(self) -> None:
        signal.signal(signal.SIGUSR2, signal.SIG_DFL)  # the main thread alone may do that
        super().open()


@fails(LOCKED)
class WaitsWithPythonsLock(WireDriver):
    def open(self) -> None:
        ctypes.PyDLL(None).usleep(100_000)
        super().open()


@fails("test_memory_does_not_grow")
class KeepsWhatItSaw(WireDriver):
    def __init__(self, options, channels, period_s):
        super().__init__(options, channels, period_s)
        self.seen: list[int] = []

    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        self.seen.append(0)


@fails(VIRTUAL)
class LooksAtTheClock(WireDriver):
    """In virtual time its carriage moves by itself, and no run is like the other."""

    supports_virtual_time = True
    runs = itertools.count()
    virtual = False

    def start_virtual_time(self) -> None:
        self.virtual, self.run = True, next(self.runs)

    def advance(self) -> None:
        self.last += 1 + self.run

    def read(self, inputs: Inputs) -> None:
        if self.virtual:
            inputs.counts[:] = self.last
        else:
            super().read(inputs)
