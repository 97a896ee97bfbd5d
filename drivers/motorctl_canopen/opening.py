"""What is asked of a drive, and told to it, before the first tick."""

from __future__ import annotations

import contextlib
import time

from motorctl.hal import RunError, error_words
from motorctl_canopen import objects
from motorctl_canopen.drive_states import DISABLE_VOLTAGE, FAULT, FAULT_REACTION
from motorctl_canopen.exchange import Exchange
from motorctl_canopen.node import INPUTS, Node
from motorctl_canopen.objects import MODES, Object, Pdo
from motorctl_canopen.options import CanopenOptions
from motorctl_canopen.sdo import SdoClient, SdoError

SDO_TIMEOUT_S = 0.5
MS_PER_S = 1000.0
STOP_ON_SILENCE = 1
"""Of the abort connection option code: a fault, which switches off."""
LOOK_S = 0.02
"""Between two looks at the mode that a drive shows."""
GONE = (objects.NO_SUCH_OBJECT, objects.NO_SUCH_SUBINDEX)


class Opening:
    """Sets up one drive over SDO, from its reset to Pre-operational with every mapping written.

    Raises RunError, naming bus, node, axis and object.
    """

    def __init__(self, options: CanopenOptions, node: Node, exchange: Exchange) -> None:
        self._options = options
        self._node = node
        self._link = exchange.link
        self._exchange = exchange
        timeout_s = min(SDO_TIMEOUT_S, options.open_timeout_s)
        self._sdo = SdoClient(exchange.link, node.number, timeout_s, exchange.take)
        self.notes: list[str] = []

    @property
    def where(self) -> str:
        """Return the drive in words."""
        node, medium = self._node, self._options.medium
        return f"CANopen: {medium}: node {node.number} (axis {node.axis})"

    def restart_communication(self) -> None:
        """Let the node begin its communication anew."""
        self._node.booted = False
        self._exchange.send_nmt(objects.NMT_RESET_COMMUNICATION, self._node.number)

    def await_boot(self) -> None:
        """Wait until the node has told that its communication has begun."""
        node = self._node
        if not self._exchange.listen(lambda: node.booted, self._options.open_timeout_s):
            rate = ""
            if self._options.interface in ("socketcan", "slcan"):
                rate = f", at {self._options.bitrate} bit/s"
            why = f"; the bus says: {self._link.complaint}" if self._link.complaint else ""
            raise RunError(
                f"{self.where} did not report after its reset within open_timeout_s = "
                f"{self._options.open_timeout_s:g} s{why}; is the drive on{rate}, and is that its "
                "node number?"
            )
        node.booted = False

    def configure(self) -> None:
        """Check what the drive is, and write heartbeats, PDOs and mode."""
        try:
            self._check()
            self._write_heartbeats()
            self._map(objects.RPDO1, objects.COMMAND, self._command_type)
            self._map(objects.TPDO1, objects.STATE, objects.SYNCHRONOUS)
            if self._node.asked & INPUTS:
                self._map(objects.TPDO2, (objects.DIGITAL_INPUTS,), objects.SYNCHRONOUS)
            else:
                self._silence(objects.TPDO2)
            for pdo in objects.OTHER_TPDOS:
                self._silence(pdo)
            self._sdo.write(objects.CONTROLWORD, DISABLE_VOLTAGE)
            self._sdo.write(objects.TARGET_TORQUE, 0)
            self._sdo.write(objects.MODE, objects.TORQUE_MODE)
        except SdoError as error:
            raise RunError(f"{self.where}: {error}") from error

    @property
    def _command_type(self) -> int:
        if self._options.command_at == "sync":
            return objects.SYNCHRONOUS
        return objects.ON_ARRIVAL

    def _check(self) -> None:
        kind = self._sdo.read(objects.DEVICE_TYPE)
        profile = kind & 0xFFFF
        if profile != objects.PROFILE_402:
            raise RunError(
                f"{self.where}: its device type (1000h) is {kind:08X}h, profile {profile}; a drive "
                f"has profile {objects.PROFILE_402} (CiA 402)"
            )
        modes = self._sdo.read(objects.SUPPORTED_MODES)
        if not modes >> objects.TORQUE_MODE_BIT & 1:
            known = ", ".join(name for bit, name in MODES.items() if modes >> bit & 1) or "none"
            raise RunError(
                f"{self.where}: it has no cyclic synchronous torque; its modes (6502h = "
                f"{modes:08X}h): {known}"
            )

    def _write_heartbeats(self) -> None:
        options, sdo = self._options, self._sdo
        if sdo.read(objects.SYNC_COB_ID) & 0x7FF != objects.SYNC_ID:
            sdo.write(objects.SYNC_COB_ID, objects.SYNC_ID)
        sdo.write(objects.PRODUCER_HEARTBEAT, round(options.heartbeat_s * MS_PER_S))
        watchdog = round(options.watchdog_s * MS_PER_S) | options.host_node << 16
        sdo.write(objects.CONSUMER_HEARTBEAT, watchdog)
        try:
            sdo.write(objects.ABORT_CONNECTION, STOP_ON_SILENCE)
        except SdoError as error:
            if error.code not in GONE:
                raise
            self.notes.append(
                f"node {self._node.number} (axis {self._node.axis}) has no "
                f"{_named(objects.ABORT_CONNECTION)}: what it does when motorctl's "
                "heartbeat stops is its own setting; try it"
            )

    def _map(self, pdo: Pdo, mapped: tuple[Object, ...], transmission: int) -> None:
        identifier = pdo.identifier + self._node.number
        if pdo is not objects.RPDO1:
            identifier |= objects.NO_REMOTE_REQUEST
        place = pdo.entry(1, 4, "identifier")
        self._sdo.write(place, identifier | objects.PDO_OFF)
        self._sdo.write(pdo.mapped(0), 0)
        for number, entry in enumerate(mapped, 1):
            try:
                self._sdo.write(pdo.mapped(number), entry.mapped)
            except SdoError as error:
                raise SdoError(f"{_named(entry)}: {error}", error.code) from error
        self._sdo.write(pdo.mapped(0), len(mapped))
        self._sdo.write(pdo.entry(2, 1, "transmission type"), transmission)
        self._sdo.write(place, identifier)

    def _silence(self, pdo: Pdo) -> None:
        """Let a node not send what nobody asked for, where it has that at all."""
        identifier = pdo.identifier + self._node.number | objects.PDO_OFF
        try:
            self._sdo.write(pdo.entry(1, 4, "identifier"), identifier | objects.NO_REMOTE_REQUEST)
        except SdoError as error:
            if error.code not in GONE:
                raise

    def start(self) -> None:
        """Let the node become operational."""
        self._exchange.send_nmt(objects.NMT_START, self._node.number)

    @property
    def started(self) -> bool:
        """Whether the node has told its state, and that it is operational."""
        return self._node.known and self._node.nmt == objects.OPERATIONAL

    def insist_on_start(self) -> None:
        """Refuse a node that has not started."""
        if self.started:
            return
        missing = "sends no statusword with SYNC"
        if self._node.known:
            missing = "sends no heartbeat that it is operational"
        raise RunError(
            f"{self.where} {missing}, within open_timeout_s = "
            f"{self._options.open_timeout_s:g} s after it was started"
        )

    # Once it is operational.

    def await_mode(self) -> None:
        """Wait until the drive shows that it is in torque mode."""
        deadline = time.monotonic() + self._options.open_timeout_s
        try:
            while (mode := self._sdo.read(objects.MODE_SHOWN)) != objects.TORQUE_MODE:
                if time.monotonic() > deadline:
                    raise RunError(
                        f"{self.where}: it stays in mode {mode} (6061h) though mode "
                        f"{objects.TORQUE_MODE}, cyclic synchronous torque, was asked for"
                    )
                self._exchange.listen(lambda: False, LOOK_S)
        except SdoError as error:
            raise RunError(f"{self.where}: {error}") from error

    def clear_fault(self) -> None:
        """Reset a fault that the drive is in, since nobody else can once it is open."""
        node = self._node
        if node.drive not in (FAULT, FAULT_REACTION):
            return
        code = node.error_code or self._error_code()
        node.clear_fault()
        if not self._exchange.run(
            lambda: node.drive not in (FAULT, FAULT_REACTION), self._options.open_timeout_s
        ):
            raise RunError(
                f"{self.where}: it is in Fault and cannot be reset: {_code_words(code)}; clear the "
                "cause at the drive"
            )
        self.notes.append(
            f"node {node.number} (axis {node.axis}) was in Fault and was reset: {_code_words(code)}"
        )

    def _error_code(self) -> int:
        with contextlib.suppress(SdoError):
            return self._sdo.read(objects.ERROR_CODE)
        return 0


def _named(entry: Object) -> str:
    return f"{entry.address} ({entry.name})"


def _code_words(code: int) -> str:
    return error_words(code) if code else "it tells no error code"
