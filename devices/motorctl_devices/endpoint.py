"""What every protocol has in common: a machine behind it, two impaired lines in front of it."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Generic, TypeVar

from motorctl_devices.line import Line
from motorctl_devices.machine import Machine
from motorctl_devices.schedule import NEVER, Fault

M = TypeVar("M")


class Endpoint(ABC, Generic[M]):
    """The device's end of a bus, speaking one protocol in messages of one type.

    A protocol gives what comes to `heard`, sends with `say`, and is called back with `answer`
    for every message that the wire let through.
    """

    def __init__(self, machine: Machine, faults: Sequence[Fault]) -> None:
        self.machine = machine
        self.due_ns = NEVER
        """When `on_due` has to be called next: the device's own sending."""
        self.exchanges = 0
        """Messages that were sent."""
        self.refused = 0
        """What came and was no valid message for this device."""
        self.now_ns = 0
        self.plugged = True
        self._from_device: Line[M] = Line(self.emit, self.spoil, self.cut, faults, "from_device")
        self._to_device: Line[M] = Line(self._arrive, self.spoil, self.cut, faults, "to_device")
        self._sequence_fault: Fault | None = None
        self._faults = faults
        self._last_sequence = 0

    # What a protocol is made of.

    @property
    @abstractmethod
    def address(self) -> str:
        """Where a host finds the device: a path, host:port, or interface and channel."""

    @abstractmethod
    def open(self) -> None:
        """Make the bus ready. Raises RunError."""

    @abstractmethod
    def close(self) -> None:
        """Leave the bus."""

    @abstractmethod
    def filenos(self) -> list[int]:
        """Return the descriptors to wait on; they may change after `hear`, `plug` and `unplug`."""

    @abstractmethod
    def hear(self, ready: Sequence[int]) -> None:
        """Read from these and pass every message to `heard`."""

    @abstractmethod
    def answer(self, message: M) -> None:
        """Do what a message asks for, at `now_ns`."""

    @abstractmethod
    def emit(self, message: M) -> None:
        """Put a message on the bus, at once."""

    @abstractmethod
    def spoil(self, message: M, fault: Fault) -> M:
        """Return the message with bits flipped, or unchanged where the fault spares it."""

    @abstractmethod
    def cut(self, message: M, fault: Fault) -> M:
        """Return the message with a wrong length."""

    @abstractmethod
    def babble(self, fault: Fault) -> None:
        """Put something on the bus that is not for the host."""

    def on_due(self) -> None:
        """Send what the device sends by itself, and set `due_ns`."""

    def died(self) -> None:
        """Forget what a reset makes the firmware forget; nothing passes until `booted`."""

    def booted(self) -> None:
        """Do what the firmware does once it has started. Raises RunError."""

    # What all protocols do alike.

    def heard(self, message: M) -> None:
        """Let a message of the host into the wire."""
        self.now_ns = time.monotonic_ns()  # a burst after a pause is served later than it was seen
        self._to_device.send(message, self.now_ns)

    def say(self, message: M) -> None:
        """Let a message of the device into the wire."""
        self.exchanges += 1
        self._from_device.send(message, self.now_ns)

    def sequence(self, right: int, modulus: int) -> int:
        """Return the sequence number to send, which a fault may order to be wrong."""
        fault = self._sequence_fault
        if fault is None or not fault.strikes():
            self._last_sequence = right
            return right
        if fault.order.sequence == "stuck":
            return self._last_sequence % modulus
        return fault.random.randrange(modulus)

    def settle(self) -> None:
        """Take over which faults are in force."""
        self._from_device.settle()
        self._to_device.settle()
        wrong = [f for f in self._faults if f.active and f.order.kind == "wrong_sequence"]
        self._sequence_fault = wrong[0] if wrong else None

    def go_silent(self, silent: bool) -> None:
        """Let nothing pass, because the device is dead or unplugged."""
        self._from_device.silent = self._to_device.silent = silent
        if silent:
            self._from_device.drop()
            self._to_device.drop()

    def flush(self) -> None:
        """Let pass what a wire has held back and is due."""
        if self._to_device.due_ns <= self.now_ns:
            self._to_device.flush(self.now_ns)
        if self._from_device.due_ns <= self.now_ns:
            self._from_device.flush(self.now_ns)

    def earliest_ns(self) -> int:
        """Return when `flush` or `on_due` is to be called next [ns]."""
        return min(self.due_ns, self._from_device.due_ns, self._to_device.due_ns)

    def unplug(self) -> None:
        """Take the port away from the host; a bus without ports only falls silent."""
        self.plugged = False

    def plug(self) -> None:
        """Make the port available again. Raises RunError."""
        self.plugged = True

    def _arrive(self, message: M) -> None:
        self.answer(message)
