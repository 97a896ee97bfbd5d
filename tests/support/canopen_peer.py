"""CiA 402 drives made of the `canopen` package's own nodes, for the driver to be tried against.

Object dictionary, SDO server, PDO mapping, NMT, heartbeat producer and EMCY are the package's; the
words of the states come from its table. What a drive does besides is here.
"""

from __future__ import annotations

import struct
import threading
import time
from collections import deque
from typing import Any

import canopen
import numpy as np
import real_time
from canopen.objectdictionary import ODRecord, ODVariable, datatypes
from canopen.profiles.p402 import State402
from canopen.sdo import SdoAbortedError

SYNC_ID, NMT_ID, HEARTBEAT_ID = 0x80, 0, 0x700
STATUSWORD = {name: value for name, (_, value) in State402.SW_MASK.items()}
CST = 10
RATED_V = 12.5


class Drive:
    """A drive in cyclic synchronous torque."""

    def __init__(self, number: int, network: canopen.Network) -> None:
        self.number = number
        self.dictionary = object_dictionary(number)
        self.node = canopen.LocalNode(number, self.dictionary)
        self._network = network
        network.add_node(self.node)
        self.node.add_write_callback(self._written)
        self.refused: dict[tuple[int, int], int] = {}
        """SDO aborts to order, by index and value (of a mapping) or subindex."""
        self.state = "SWITCH ON DISABLED"
        self.stays_faulty = False
        self.reaction_periods = 3
        """How many controlwords long a fault reaction lasts."""
        self.stuck_in: str | None = None
        """It does not go on from this state."""
        self.stays_on = False
        """It does not leave Operation Enabled, whatever it is told."""
        self.position, self.torque, self.inputs = 0, 0, 0
        self.controlwords: deque[int] = deque(maxlen=200)
        self.asked: deque[tuple[int, int]] = deque(maxlen=200)
        """Controlword and torque of the command frames."""
        self.tells_late = 0
        """So many SYNCs later its statusword shows a new state."""
        self._states: deque[str] = deque(maxlen=16)
        self.silent = False
        self.faults: deque[np.random.Generator | None] = deque()
        """What becomes of the next samples: None is lost, a generator damages."""
        self._controlword = 0
        self._pending: bytes | None = None
        self._heard_s: float | None = None
        network.subscribe(NMT_ID, self._on_nmt)
        network.subscribe(SYNC_ID, self._on_sync)

    # What a test may let happen.

    def trip(self, code: int) -> None:
        """Go into Fault, and tell why."""
        self.node.emcy.send(code, 1)
        self.node.sdo[0x603F].raw = code
        self.state, self.torque = "FAULT", 0

    def restart(self) -> None:
        """Lose the power for a moment: a boot-up message, counts from 0, nothing configured."""
        self.position, self.torque = 0, 0
        self.state = "SWITCH ON DISABLED"
        self._reset()

    @property
    def enabled(self) -> bool:
        return self.state == "OPERATION ENABLED"

    # Network management and heartbeat.

    def _on_nmt(self, can_id: int, data: bytearray, timestamp: float) -> None:
        command, number = data[0], data[1]
        if number not in (0, self.number):
            return
        if command in (129, 130):
            self._reset()
        elif command == 1:
            self.node.rpdo.read()
            self.node.tpdo.read()
            for pdo in self.node.rpdo.values():
                if pdo.enabled:
                    pdo.add_callback(self._on_rpdo)

    def _reset(self) -> None:
        for index in (0x1016, 0x1017, *range(0x1400, 0x1C00)):
            self.node.data_store.pop(index, None)
        self._network.subscribers.pop(0x200 + self.number, None)
        self._heard_s, self._pending = None, None
        self.node.nmt.stop_heartbeat()
        self.node.nmt._state = 0
        self._network.send_message(HEARTBEAT_ID + self.number, b"\0")
        self.node.nmt.state = "PRE-OPERATIONAL"

    def _written(self, index: int, subindex: int, od: Any, data: bytes) -> None:
        value = int.from_bytes(data, "little")
        for key in ((index, subindex), (index, value)):
            if key in self.refused:
                raise SdoAbortedError(self.refused[key])
        if index == 0x6040:
            self.obey(value)
        elif index == 0x1016 and subindex == 1:
            for host in range(1, 128):
                self._network.subscribers.pop(HEARTBEAT_ID + host, None)
            self._heard_s = None
            self._silence_s = (value & 0xFFFF) / 1000
            if self._silence_s:
                self._network.subscribe(HEARTBEAT_ID + (value >> 16), self._on_heartbeat)

    def _on_heartbeat(self, can_id: int, data: bytearray, timestamp: float) -> None:
        self._heard_s = time.monotonic()

    def watch(self) -> None:
        """Go into Fault where the host's heartbeat is missing."""
        heard_s = self._heard_s
        if heard_s is not None and time.monotonic() - heard_s > self._silence_s:
            self._heard_s = None
            self.trip(0x8130)

    # PDOs.

    def _on_rpdo(self, pdo: Any) -> None:
        self._pending = bytes(pdo.data)
        if pdo.trans_type == 255:
            self._apply(pdo)

    def _apply(self, pdo: Any) -> None:
        if self._pending is None:
            return
        values = {variable.index: variable.raw for variable in pdo.map}
        self._pending = None
        self.asked.append((values[0x6040], values[0x6071]))
        self.obey(values[0x6040])
        self.torque = values[0x6071] if self.enabled else 0

    def _on_sync(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if self.node.nmt.state != "OPERATIONAL":
            return
        for pdo in self.node.rpdo.values():
            if pdo.enabled and pdo.trans_type == 1:
                self._apply(pdo)
        self._states.append(self.state)
        if self.silent:
            return
        fault = self.faults.popleft() if self.faults else False
        if fault is None:
            return
        told = self._states[max(0, len(self._states) - 1 - self.tells_late)]
        values = {0x6041: STATUSWORD[told] | 0x200, 0x6064: self.position}
        values[0x60FD] = self.inputs
        for pdo in self.node.tpdo.values():
            if not pdo.enabled or pdo.trans_type != 1:
                continue
            for variable in pdo.map:
                variable.raw = values[variable.index]
            data = bytes(pdo.data)
            if fault:
                data = data.ljust(8, b"\0")[: (0, 1, 2, 5, 7, 8)[fault.integers(6)]]
            self._network.send_message(pdo.cob_id, data)

    # The states.

    def obey(self, word: int) -> None:
        """Take a controlword, by the bits of CiA 402's table of commands."""
        self.controlwords.append(word)
        rising = word & ~self._controlword
        if self.state == "FAULT REACTION ACTIVE":
            self.reaction_periods -= 1
            if self.reaction_periods <= 0:
                self.state = "FAULT"
            return
        self._controlword = word
        state = self.state
        if state == "FAULT":
            if rising & 0x80 and not self.stays_faulty:
                self.state = "SWITCH ON DISABLED"
                self.node.emcy.reset()
        elif (self.stays_on and self.enabled) or (state == self.stuck_in and word & 2):
            pass
        elif not word & 2:
            self.state = "SWITCH ON DISABLED"
        elif not word & 4:
            running = state == "OPERATION ENABLED"
            self.state = "QUICK STOP ACTIVE" if running else "SWITCH ON DISABLED"
        elif state == "QUICK STOP ACTIVE":
            pass
        elif word & 0x8F == 0x0F:
            up = {"READY TO SWITCH ON": "SWITCHED ON", "SWITCHED ON": "OPERATION ENABLED"}
            self.state = up.get(state, state)
        elif word & 0x8F == 0x07:
            if state in ("READY TO SWITCH ON", "OPERATION ENABLED"):
                self.state = "SWITCHED ON"
        elif word & 0x87 == 0x06:
            self.state = "READY TO SWITCH ON"
        if not self.enabled:
            self.torque = 0


class Peer:
    """Drives on a virtual bus, served by the package's own thread."""

    def __init__(self, channel: str, numbers: tuple[int, ...] = (1, 2)) -> None:
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = 0.02
        real_time.begins()
        self.network.connect(interface="virtual", channel=channel)
        self.drives = [Drive(number, self.network) for number in numbers]
        self._ending = threading.Event()
        self._watch = threading.Thread(target=self._run, daemon=True)
        self._watch.start()

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def _run(self) -> None:
        while not self._ending.wait(0.005):
            for drive in self.drives:
                drive.watch()

    def end(self) -> None:
        if self._ending.is_set():
            return
        self._ending.set()
        self._watch.join()
        for drive in self.drives:
            drive.node.nmt.stop_heartbeat()
        self.network.disconnect()


def object_dictionary(number: int) -> canopen.ObjectDictionary:
    """Return what a drive of CiA 402 has, as far as a torque drive needs it."""
    made = canopen.ObjectDictionary()
    made.node_id = number

    def one(parent: Any, name: str, index: int, sub: int, kind: int, default: int) -> None:
        variable = ODVariable(name, index, sub)
        variable.data_type, variable.access_type, variable.default = kind, "rw", default
        parent.add_object(variable) if parent is made else parent.add_member(variable)

    u8, u16, u32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
    i8, i16, i32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
    one(made, "Device type", 0x1000, 0, u32, 0x00020192)
    one(made, "Error register", 0x1001, 0, u8, 0)
    one(made, "SYNC", 0x1005, 0, u32, 0x80)
    one(made, "Producer heartbeat", 0x1017, 0, u16, 0)
    one(made, "Abort connection", 0x6007, 0, i16, 0)
    one(made, "Error code", 0x603F, 0, u16, 0)
    one(made, "Controlword", 0x6040, 0, u16, 0)
    one(made, "Statusword", 0x6041, 0, u16, 0)
    one(made, "Mode", 0x6060, 0, i8, 0)
    one(made, "Mode display", 0x6061, 0, i8, CST)
    one(made, "Position", 0x6064, 0, i32, 0)
    one(made, "Target torque", 0x6071, 0, i16, 0)
    one(made, "Digital inputs", 0x60FD, 0, u32, 0)
    one(made, "Supported modes", 0x6502, 0, u32, 1 << 9 | 1 << 7)
    consumer = ODRecord("Consumer heartbeat", 0x1016)
    made.add_object(consumer)
    one(consumer, "Number", 0x1016, 0, u8, 1)
    one(consumer, "First", 0x1016, 1, u32, 0)
    for first, mapping, base, off in ((0x1400, 0x1600, 0x200, 0), (0x1800, 0x1A00, 0x180, 1 << 31)):
        for i in range(2):
            record, mapped = ODRecord("PDO", first + i), ODRecord("Map", mapping + i)
            made.add_object(record)
            made.add_object(mapped)
            cob_id = base + 0x100 * i + number
            for sub, kind, value in ((0, u8, 2), (1, u32, cob_id | off), (2, u8, 255)):
                one(record, f"parameter {sub}", first + i, sub, kind, value)
            one(mapped, "Number", mapping + i, 0, u8, 0)
            for sub in range(1, 9):
                one(mapped, f"entry {sub}", mapping + i, sub, u32, 0)
    return made


def unpacked(data: bytes) -> tuple[int, int]:
    """Return controlword and torque of a command frame."""
    word, torque = struct.unpack("<Hh", data)
    return word, torque
