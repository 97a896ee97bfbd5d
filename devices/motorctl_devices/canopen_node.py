"""The device as drives of CiA 402 on a CANopen bus, one a channel."""

from __future__ import annotations

import time
from collections.abc import Sequence

from motorctl.hal import Status
from motorctl_devices.can_bus import CanBus, Frame
from motorctl_devices.can_endpoint import CanEndpoint
from motorctl_devices.canopen_drive import OFF, Drive
from motorctl_devices.canopen_shape import DriveShape
from motorctl_devices.line import flip_bits
from motorctl_devices.machine import Machine
from motorctl_devices.schedule import NEVER, Fault

NMT, SYNC, EMCY, SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0, 0x80, 0x80, 0x580, 0x600, 0x700
BOOT_UP, OPERATIONAL, PRE_OPERATIONAL, STOPPED = 0, 5, 127, 4
NMT_STATES = {1: OPERATIONAL, 2: STOPPED, 128: PRE_OPERATIONAL}
MS = 1_000_000
HEARTBEAT_LOST, RPDO_LATE, POWER_SECTION, SENSOR = 0x8130, 0x8250, 0x5400, 0x7300
ESTOPPED = 0x9000
TROUBLES = (
    (int(Status.ESTOP), ESTOPPED),
    (int(Status.AMPLIFIER_FAULT), POWER_SECTION),
    (int(Status.ENCODER_LOST), SENSOR),
)
SWITCHES = (Status.LIMIT_NEGATIVE, Status.LIMIT_POSITIVE, Status.HOME_SWITCH)
"""Bits 0 to 2 of the digital inputs, in the order of CiA 402."""
SYNCHRONOUS = range(1, 241)


class _Node:
    """One drive on the bus."""

    def __init__(self, shape: DriveShape) -> None:
        self.drive = Drive(shape.node)
        self.volts_a_permille = shape.rated_torque_v / 1000.0
        self.began()

    def began(self) -> None:
        self.nmt = PRE_OPERATIONAL
        self.pending: dict[int, bytes] = {}
        self.heartbeat_due_ns = NEVER
        self.host_due_ns = NEVER


class CanopenDrives(CanEndpoint):
    """Answers SDO and SYNC, obeys NMT and PDOs, and switches off where the host falls silent."""

    def __init__(
        self, machine: Machine, faults: Sequence[Fault], bus: CanBus, shapes: Sequence[DriveShape]
    ) -> None:
        super().__init__(machine, faults, bus)
        self._nodes = [_Node(shape) for shape in shapes]

    def died(self) -> None:
        """Forget everything, as without power."""
        for node in self._nodes:
            node.drive.begin()
            node.began()
        self._set_due()

    def booted(self) -> None:
        """Tell that every drive has started."""
        for channel, node in enumerate(self._nodes):
            self._tell(channel, HEARTBEAT + node.drive.number, bytes([BOOT_UP]))

    def answer(self, message: Frame) -> None:
        """Do what a frame asks for; frames for others are ignored."""
        if message.extended:
            return
        identifier, data = message.identifier, message.data
        if identifier == SYNC:
            self._synchronise()
        for channel, node in enumerate(self._nodes):
            number = node.drive.number
            if identifier == NMT and len(data) == 2 and data[1] in (0, number):
                self._manage(channel, node, data[0])
            elif identifier == SDO_REQUEST + number and len(data) == 8:
                self._tell(channel, SDO_ANSWER + number, node.drive.answer(data))
                self._obey_host(node)
                if not node.drive.enabled:
                    self._act(channel)
            elif identifier == self._host_of(node):
                node.host_due_ns = self.now_ns + self._host_ms(node) * MS
            else:
                self._take_pdo(channel, node, identifier, data)
        self._set_due()

    def on_due(self) -> None:
        """Send heartbeats, and look for the host's, whose absence is a watchdog's trip."""
        enabled = self.machine.any_enabled
        lost = False
        for channel, node in enumerate(self._nodes):
            if node.heartbeat_due_ns <= self.now_ns:
                period_ns = node.drive.value(0x1017) * MS
                node.heartbeat_due_ns = self.now_ns + period_ns
                self._tell(channel, HEARTBEAT + node.drive.number, bytes([node.nmt]))
            if node.host_due_ns <= self.now_ns:
                heard_ns = node.host_due_ns - self._host_ms(node) * MS
                node.host_due_ns = NEVER
                node.drive.fail(HEARTBEAT_LOST)
                self._act(channel)
                lost = True
                if enabled:
                    self.machine.watchdog_after_ns = time.monotonic_ns() - heard_ns
        self.machine.watchdog_trips += enabled and lost
        self._set_due()

    def _set_due(self) -> None:
        self.due_ns = min(min(n.heartbeat_due_ns, n.host_due_ns) for n in self._nodes)

    def _manage(self, channel: int, node: _Node, command: int) -> None:
        drive = node.drive
        if command in NMT_STATES:
            node.nmt = NMT_STATES[command]
            return
        if command == 129:
            drive.begin()
        elif command == 130:
            drive.begin_communication()
        else:
            return
        node.began()
        self._tell(channel, HEARTBEAT + drive.number, bytes([BOOT_UP]))

    def _obey_host(self, node: _Node) -> None:
        """Take over what was written of heartbeats."""
        period_ms = node.drive.value(0x1017)
        if not period_ms:
            node.heartbeat_due_ns = NEVER
        elif node.heartbeat_due_ns == NEVER:
            node.heartbeat_due_ns = self.now_ns + period_ms * MS
        if not self._host_ms(node):
            node.host_due_ns = NEVER

    def _host_ms(self, node: _Node) -> int:
        return node.drive.value(0x1016, 1) & 0xFFFF

    def _host_of(self, node: _Node) -> int:
        word = node.drive.value(0x1016, 1)
        return HEARTBEAT + (word >> 16 & 0x7F) if word & 0xFFFF else -1

    def _take_pdo(self, channel: int, node: _Node, identifier: int, data: bytes) -> None:
        if node.nmt != OPERATIONAL:
            return
        for i in range(4):
            if node.drive.value(0x1400 + i, 1) != identifier:
                continue
            if len(data) != sum(size for _, size in node.drive.mapped(0x1600 + i)):
                self.refused += 1
            elif node.drive.value(0x1400 + i, 2) in SYNCHRONOUS:
                node.pending[i] = data
            else:
                self._apply(channel, node, i, data)

    def _apply(self, channel: int, node: _Node, i: int, data: bytes) -> None:
        drive, place = node.drive, 0
        for index, size in drive.mapped(0x1600 + i):
            drive.put(index, int.from_bytes(data[place : place + size], "little"))
            place += size
        drive.obey(drive.value(0x6040))
        self._act(channel)

    def _act(self, channel: int) -> None:
        """Let the amplifier do what the drive's state and target say."""
        node = self._nodes[channel]
        drive = node.drive
        torque = drive.value(0x6071)
        torque -= (torque & 0x8000) << 1
        volts = torque * node.volts_a_permille
        self.machine.command(channel, volts, drive.enabled, self.now_ns)
        self.machine.apply(self.now_ns)
        if drive.emergency is not None:
            code, drive.emergency = drive.emergency, None
            register = drive.value(0x1001)
            data = code.to_bytes(2, "little") + bytes([register]) + bytes(5)
            self._tell(channel, EMCY + drive.number, data)

    def _synchronise(self) -> None:
        """Sample, send what is mapped, and let what was received before act from now on."""
        machine = self.machine
        machine.sample(self.now_ns)
        for channel, node in enumerate(self._nodes):
            if node.nmt != OPERATIONAL:
                continue
            drive, word = node.drive, machine.status[channel]
            for bit, code in TROUBLES:
                if word & bit:
                    drive.fail(code)
            if machine.tripped[channel]:
                drive.fail(RPDO_LATE)
            for i, data in list(node.pending.items()):
                self._apply(channel, node, i, data)
            node.pending.clear()
            if drive.emergency is not None:
                self._act(channel)
            drive.put(0x6064, machine.counts[channel])
            inputs = sum(1 << bit for bit, told in enumerate(SWITCHES) if word & told)
            drive.put(0x60FD, inputs)
            drive.tell_state()
            self._tell_pdos(channel, drive)
        machine.index_told()

    def _tell_pdos(self, channel: int, drive: Drive) -> None:
        for i in range(4):
            place = drive.value(0x1800 + i, 1)
            if place & OFF or drive.value(0x1800 + i, 2) not in SYNCHRONOUS:
                continue
            parts = drive.mapped(0x1A00 + i)
            data = b"".join(drive.value(index).to_bytes(size, "little") for index, size in parts)
            self._tell(channel, place & 0x7FF, data)

    def _tell(self, channel: int, identifier: int, data: bytes) -> None:
        if not self.machine.silent[channel]:
            self.say(Frame(identifier, data))

    def emit(self, message: Frame) -> None:
        """Send a frame."""
        self._bus.send(message)

    def spoil(self, message: Frame, fault: Fault) -> Frame:
        """Flip bits of the data: the bus' own checksum would stop others."""
        return message._replace(data=flip_bits(message.data, fault))

    def cut(self, message: Frame, fault: Fault) -> Frame:
        """Return the frame with another length."""
        others = [n for n in range(9) if n != len(message.data)]
        length = others[fault.random.randrange(len(others))]
        return message._replace(data=message.data[:length].ljust(length, b"\0"))

    def babble(self, fault: Fault) -> None:
        """Send a frame of a high priority that is for nobody here."""
        self._bus.send(Frame(0x001, bytes(fault.random.randrange(256) for _ in range(8))))
