"""How a device on a CAN bus gets on it, leaves it, and hears what is on it."""

from __future__ import annotations

from collections.abc import Sequence

from motorctl_devices.can_bus import CanBus, Frame
from motorctl_devices.endpoint import Endpoint
from motorctl_devices.machine import Machine
from motorctl_devices.schedule import Fault


class CanEndpoint(Endpoint[Frame]):
    """A device on one bus; what frames mean is its kind's to say."""

    def __init__(self, machine: Machine, faults: Sequence[Fault], bus: CanBus) -> None:
        super().__init__(machine, faults)
        self._bus = bus

    @property
    def address(self) -> str:
        """Return interface and channel."""
        return self._bus.address

    def open(self) -> None:
        """Get on the bus. Raises RunError."""
        self._bus.open()
        self.booted()

    def close(self) -> None:
        """Leave the bus."""
        self._bus.close()

    def filenos(self) -> list[int]:
        """Return the file descriptors to wait on."""
        number = self._bus.fileno()
        return [number] if number >= 0 else []

    def unplug(self) -> None:
        """Leave the bus; a serial adapter's port goes away."""
        super().unplug()
        self._bus.close()

    def plug(self) -> None:
        """Come back to the bus. Raises RunError."""
        super().plug()
        self._bus.open()

    def hear(self, ready: Sequence[int]) -> None:
        """Take the frames that came."""
        if self._bus.fileno() in ready:
            for frame in self._bus.receive():
                self.heard(frame)
