"""Clocks: wall time that sleeps and then spins, and virtual time that never waits."""

from __future__ import annotations

import ctypes
import time
from typing import Protocol

NS_PER_S = 1_000_000_000
CLOCK_MONOTONIC = 1
TIMER_ABSTIME = 1


class Clock(Protocol):
    """What the loop waits on."""

    def now_ns(self) -> int:
        """Return the present time [ns]."""

    def wait_until_ns(self, deadline_ns: int) -> int:
        """Wait for a time [ns] and return the time at which the wait ended."""


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


class WallClock:
    """Sleep to shortly before the deadline, then spin.

    Pure spinning under SCHED_FIFO runs into the kernel's real-time throttling; pure sleeping
    wakes some 20 us late.
    """

    def __init__(self, spin_s: float) -> None:
        self._spin_ns = round(spin_s * NS_PER_S)
        self._until = _Timespec()
        self._until_pointer = ctypes.byref(self._until)
        self._sleep = ctypes.CDLL(None).clock_nanosleep
        self._sleep.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)

    def now_ns(self) -> int:
        """Return CLOCK_MONOTONIC."""
        return time.monotonic_ns()

    def wait_until_ns(self, deadline_ns: int) -> int:
        """Sleep, then spin; where the deadline has passed already, return at once."""
        wake = deadline_ns - self._spin_ns
        now = time.monotonic_ns
        if wake > now():
            self._until.tv_sec, self._until.tv_nsec = divmod(wake, NS_PER_S)
            self._sleep(CLOCK_MONOTONIC, TIMER_ABSTIME, self._until_pointer, None)
        moment = now()
        while moment < deadline_ns:
            moment = now()
        return moment


class VirtualClock:
    """Every deadline is met on the instant; times of day are measured only to be reported."""

    def now_ns(self) -> int:
        """Return CLOCK_MONOTONIC: how long computing takes is real in virtual time too."""
        return time.monotonic_ns()

    def wait_until_ns(self, deadline_ns: int) -> int:
        """Return the time at which the tick starts computing."""
        return time.monotonic_ns()
