"""The device as a node on a CAN bus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from motorctl.hal import Status
from motorctl_devices.can_bus import FD_LENGTHS, CanBus, Frame
from motorctl_devices.can_endpoint import CanEndpoint
from motorctl_devices.can_layout import FLAG_NAMES, FrameLayout, Meant, SyncShape
from motorctl_devices.line import flip_bits
from motorctl_devices.machine import Machine
from motorctl_devices.schedule import NEVER, NS, Fault

FLAGS = {name: int(Status[name.upper()]) for name in FLAG_NAMES}
FOREIGN = (0x001, 0x002, 0x003, 0x004)


class CanNode(CanEndpoint):
    """Answers SYNC with its state, or sends it by its own clock; obeys command frames."""

    def __init__(
        self,
        machine: Machine,
        faults: Sequence[Fault],
        bus: CanBus,
        found: Sequence[FrameLayout],
        sync: SyncShape | None,
        rate_hz: float,
        fd: bool,
    ) -> None:
        super().__init__(machine, faults, bus)
        self._fd = fd
        self._period_ns = round(NS / rate_hz)
        self._sync = None if sync is None else (sync.id, sync.extended)
        self._commands = {_key(layout): layout for layout in found if layout.command}
        self._states = [layout for layout in found if not layout.command]
        self._told = [channels_of(layout) for layout in self._states]
        self._samples = 0
        known = {layout.message.frame_id for layout in found} | {self._sync and self._sync[0]}
        self._foreign = next(number for number in FOREIGN if number not in known)
        self._level = [0.0] * machine.channels
        self._enable = [False] * machine.channels

    def died(self) -> None:
        """Forget commands and samples."""
        self._samples = 0
        self._level = [0.0] * self.machine.channels
        self._enable = [False] * self.machine.channels
        self.due_ns = NEVER

    def booted(self) -> None:
        """Start to send, where no SYNC asks for it."""
        if self._sync is None:
            self.due_ns = self.now_ns

    def answer(self, message: Frame) -> None:
        """Answer SYNC, obey commands, ignore what is for others."""
        key = (message.identifier, message.extended)
        if key == self._sync:
            self._tell()
            return
        layout = self._commands.get(key)
        if layout is None:
            return
        if len(message.data) != layout.message.length:
            self.refused += 1
            return
        self._obey(layout, message.data)

    def on_due(self) -> None:
        """Send the state by the device's own clock."""
        self._tell()
        missed = (self.now_ns - self.due_ns) // self._period_ns
        self.due_ns += (missed + 1) * self._period_ns

    def _obey(self, layout: FrameLayout, data: bytes) -> None:
        values: Any = layout.message.decode(data, decode_choices=False)
        touched: set[int] = set()
        everyone = range(self.machine.channels)
        for meant in layout.meant:
            value = values[meant.signal]
            channels: Sequence[int] = everyone if meant.channel is None else (meant.channel,)
            if meant.means == "watchdog":
                self.machine.set_watchdog(float(value))
                continue
            if meant.means == "sequence":
                continue
            touched.update(channels)
            for channel in channels:
                if meant.means == "volts":
                    self._level[channel] = float(value)
                else:
                    self._enable[channel] = bool(value) != meant.inverted
        for channel in touched:
            level, on = self._level[channel], self._enable[channel]
            self.machine.command(channel, level, on, self.now_ns)
        if touched:
            self.machine.apply(self.now_ns)

    def _tell(self) -> None:
        """Sample, and send every state frame."""
        machine = self.machine
        machine.sample(self.now_ns)
        self._samples += 1
        for layout, channels in zip(self._states, self._told, strict=True):
            if channels and all(machine.silent[channel] for channel in channels):
                continue
            message = layout.message
            raw: dict[str, Any] = dict.fromkeys((signal.name for signal in message.signals), 0)
            for meant in layout.meant:
                raw[meant.signal] = self._raw(meant, message)
            data = message.encode(raw, scaling=False, strict=False)
            self.say(Frame(message.frame_id, data, message.is_extended_frame, self._fd))
        machine.index_told()

    def _raw(self, meant: Meant, message: Any) -> int:
        machine, channel = self.machine, meant.channel
        modulus = 1 << meant.bits
        if meant.means == "sequence":
            return self.sequence(self._samples % modulus, modulus)
        if meant.means == "boot":
            return machine.boot_id % modulus
        if meant.means in ("counts", "index_counts"):
            assert channel is not None
            shown = machine.counts if meant.means == "counts" else machine.index_counts
            signed = message.get_signal_by_name(meant.signal).is_signed
            return machine.signed(channel, shown[channel]) if signed else shown[channel]
        mask = FLAGS[meant.means]
        yes = False
        for number in range(machine.channels) if channel is None else (channel,):
            yes = yes or bool(machine.status[number] & mask)
            if meant.means == "amplifier_fault":
                yes = yes or machine.tripped[number]
        return int(yes != meant.inverted)

    def emit(self, message: Frame) -> None:
        """Send a frame."""
        self._bus.send(message)

    def spoil(self, message: Frame, fault: Fault) -> Frame:
        """Flip bits of the data: the bus' own checksum would stop others."""
        return message._replace(data=flip_bits(message.data, fault))

    def cut(self, message: Frame, fault: Fault) -> Frame:
        """Return the frame with another length."""
        longest = 64 if message.fd else 8
        others = [n for n in FD_LENGTHS if n <= longest and n != len(message.data)]
        length = others[fault.random.randrange(len(others))]
        return message._replace(data=message.data[:length].ljust(length, b"\0"))

    def babble(self, fault: Fault) -> None:
        """Send a frame of the highest priority that is for nobody here."""
        data = bytes(fault.random.randrange(256) for _ in range(8))
        self._bus.send(Frame(self._foreign, data, False, self._fd))


def channels_of(layout: FrameLayout) -> tuple[int, ...]:
    """Return the channels that a frame tells of."""
    return tuple({meant.channel for meant in layout.meant if meant.channel is not None})


def _key(layout: FrameLayout) -> tuple[int, bool]:
    return layout.message.frame_id, layout.message.is_extended_frame
