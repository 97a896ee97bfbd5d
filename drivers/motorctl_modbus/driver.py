"""The driver: one exchange of function code 23 a period, collected in the next."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import ClassVar

import numpy as np

from motorctl.hal import (
    UNTOLD_GUARDS,
    Channel,
    Claim,
    Driver,
    DriverOptions,
    FirstAxis,
    FirstOptions,
    Inputs,
    Outputs,
    RateBudget,
    Status,
    serial_line,
    unseen_limit_switches,
    untold_guard,
)
from motorctl_modbus import budget, checks
from motorctl_modbus.coupler import DEVICE_FAILURE, arm_watchdog
from motorctl_modbus.exchange import (
    EXCEPTION,
    FRESH,
    NOTHING,
    REFUSED,
    Exchange,
    RtuExchange,
    TcpExchange,
)
from motorctl_modbus.first_options import first_options
from motorctl_modbus.layout import InputBlock, OutputBlock, used_of
from motorctl_modbus.line import LOST, SENT, Line
from motorctl_modbus.opening import (
    Client,
    connect,
    first_exchange,
    line_of,
    lower_latency,
    release,
    switch_off,
)
from motorctl_modbus.options import ModbusOptions
from motorctl_modbus.registers import block, input_claims, output_claims

TIMEOUT_SHARE = 0.9
"""Share of the period that a reply on RTU has, where the options do not tell."""
DRAINS = 4
"""Reads of the line in one tick at most: four outstanding replies fit into the first."""
SAFE_ANSWER_S = 0.05
SAFE_CONNECT_S = 0.25

STALE = np.uint32(Status.STALE)
CORRUPT = np.uint32(Status.CORRUPT | Status.STALE)
TRIPPED = np.uint32(Status.COMMUNICATION_LOST | Status.CORRUPT | Status.STALE)
GONE = np.uint32(Status.BUS_OFF | Status.COMMUNICATION_LOST | Status.STALE)
RESTARTED = np.uint32(Status.DEVICE_RESTARTED | Status.ENCODER_LOST)
INDEX_LATCHED = np.uint32(Status.INDEX_LATCHED)
REPEATED = np.uint32(0xFFFFFFFF & ~int(Status.INDEX_LATCHED))


class ModbusDriver(Driver):
    """An amplifier and encoder coupler on Modbus TCP or RTU; see `ModbusOptions`.

    `write` sends the request with the commands, `read` collects its reply in the next period.
    Neither waits. docs/drivers/modbus.md tells what each failure looks like.
    """

    Options: ClassVar[type[DriverOptions]] = ModbusOptions
    exchange_delay_periods: float = 1.0

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        assert isinstance(options, ModbusOptions)
        self._modbus = options
        self.watchdog_s = options.watchdog_s
        tcp, rtu = options.tcp, options.rtu
        if tcp is not None:
            # Behind one gateway there may be several units.
            self.medium = f"Modbus {tcp.host}:{tcp.port} unit {options.unit}"
        elif rtu is not None:
            self.medium = serial_line(rtu.port)
        self._client: Client | None = None
        self._line: Line | None = None
        self._claim: Claim | None = None
        self._exchange: Exchange | None = None
        self._outputs: OutputBlock | None = None
        self._inputs: InputBlock | None = None
        self._lost = False
        self._unread = False
        self._wrote = False
        self._sequence = 0
        self._boot_id = 0
        self._latched = np.uint32(0)
        self._told_enable = np.zeros(len(self.channels), np.uint8)
        self._told_index = np.zeros(len(self.channels), np.int64)
        self._marks = np.zeros(len(self.channels), np.uint32)

    def problems(self) -> Sequence[tuple[tuple[str | int, ...], str]]:
        """Tell what is wrong in the register map, and between it, channels and period."""
        options = self._modbus
        found = checks.map_problems(options, used_of(options, self.channels))
        for channel in self.channels:
            found += checks.axis_problems(options, channel)
        # With a wrong map, how long an exchange takes would mislead.
        found += checks.time_problems(options, self.period_s, None if found else self._sizes())
        return found

    def advice(self) -> Sequence[str]:
        """Tell which registers a safe machine would have besides."""
        options = self._modbus
        found = []
        if options.watchdog_s is None:
            found.append(
                "coupler generic has no watchdog that is known: whether the device disables when "
                "requests stop, and when, is its own setting alone"
            )
        if options.boot_id is None and options.rtu is not None:
            found.append(
                "no boot_id: on rtu nothing else shows that the device started anew, and its "
                "counts then begin elsewhere"
            )
        for flag, guard in UNTOLD_GUARDS.items():
            untold = [
                channel.axis
                for channel in self.channels
                if getattr(options.channels[channel.number].status, flag) is None
            ]
            if untold:
                found.append(untold_guard(flag, guard, untold))
        told = {c.axis: dict(options.channels[c.number].status.named()) for c in self.channels}
        return [*found, *unseen_limit_switches(told)]

    def switches(self) -> Sequence[Status]:
        """Tell which switches and marks have a bit in the map."""
        known = Status.HOME_SWITCH | Status.INDEX_LATCHED | Status.LIMIT_NEGATIVE
        known |= Status.LIMIT_POSITIVE
        found = []
        for channel in self.channels:
            names = dict(self._modbus.channels[channel.number].status.named())
            found.append(reduce(or_, (Status[name.upper()] for name in names), Status(0)) & known)
        return found

    @classmethod
    def first_options(cls, axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
        """Return a coupler on TCP with registers in a row."""
        return first_options(axes)

    def rate_budget(self) -> RateBudget:
        """Compute the rate at which one exchange fills nine tenths of the period."""
        options = self._modbus
        if options.rtu is not None:
            return budget.rtu_budget(options.rtu, *self._sizes(), options.device_turnaround_s)
        return budget.tcp_budget(*self._sizes(), options.device_turnaround_s)

    def _sizes(self) -> tuple[int, int]:
        """Registers written and read."""
        options = self._modbus
        used = used_of(options, self.channels)
        _, written = block(output_claims(used, options.sequence))
        _, read = block(input_claims(used, options.sequence, options.boot_id))
        return written, read

    def prepare(self) -> None:
        """Lay out the registers and make the request."""
        options = self._modbus
        outputs = OutputBlock(options, self.channels)
        inputs = InputBlock(options, self.channels)
        if options.rtu is None:
            self._exchange = TcpExchange(options.unit, outputs, inputs)
        else:
            timeout_s = options.rtu.timeout_s or TIMEOUT_SHARE * self.period_s
            numbered = options.sequence is not None
            self._exchange = RtuExchange(options.unit, outputs, inputs, timeout_s, numbered)
        self._exchange.on_late = self._take_late
        self._outputs, self._inputs = outputs, inputs

    def open(self) -> None:
        """Connect, arm the coupler's watchdog, and exchange once with every output disabled.

        Raises RunError where that fails, naming key and device.
        """
        self.close()
        self.prepare()
        assert self._outputs is not None
        assert self._inputs is not None
        self._claim = self._claimed(self._outputs)
        try:
            self._connect(self._outputs, self._inputs)
        except BaseException:
            self.close()
            raise

    def _connect(self, outputs: OutputBlock, inputs: InputBlock) -> None:
        client = connect(self._modbus, self._modbus.connect_timeout_s)
        try:
            arm_watchdog(client, self._modbus)
            self._sequence = 1
            registers = first_exchange(client, self._modbus, outputs, inputs, self._sequence)
            notes = lower_latency(client, self._modbus)
            line = line_of(client)
            line.forget()
        except BaseException:
            release(client)
            raise
        inputs.decode(registers)
        self._told_index[:] = inputs.index_counts
        self._boot_id = inputs.boot_id(registers)
        self._latched = np.uint32(0)
        self._client, self._line = client, line
        self.notes = notes
        self._lost, self._unread = False, True

    def close(self) -> None:
        """Release the connection."""
        client, line, exchange = self._client, self._line, self._exchange
        self._client = self._line = None
        self._unread = False
        claim, self._claim = self._claim, None
        try:
            if client is None or line is None or exchange is None:
                return
            # A socket closed over unread replies is reset, and the last request lost with it.
            for _ in range(DRAINS):
                if line.receive(memoryview(bytearray(4096))) <= 0:
                    break
            release(client)
        finally:
            if claim is not None:
                claim.release()

    def read(self, inputs: Inputs) -> None:
        """Collect the reply to the request of the last `write`, if it is there."""
        block = self._inputs
        if block is None:
            inputs.status[:] = GONE
            return
        verdict = self._collect(time.monotonic())
        if self._unread:
            self._unread = False
            inputs.counts[:] = block.counts
            inputs.index_counts[:] = block.index_counts
            np.bitwise_or(block.status, self._latched, out=inputs.status)
            self._tell_marks(block, inputs)
            return
        if self._lost or self._line is None:
            flags = GONE
        elif verdict == NOTHING:
            flags = STALE
        elif verdict == EXCEPTION and self._tripped():
            flags = TRIPPED
        else:
            flags = CORRUPT
        inputs.counts[:] = block.counts
        inputs.index_counts[:] = block.index_counts
        np.bitwise_and(block.status, REPEATED, out=inputs.status)
        np.bitwise_or(inputs.status, flags | self._latched, out=inputs.status)

    def _tell_marks(self, block: InputBlock, inputs: Inputs) -> None:
        """Tell of a mark whose bit came too late, and of another one whose bit came never."""
        passed = block.passed
        np.not_equal(inputs.index_counts, self._told_index, out=self._marks, casting="unsafe")
        np.multiply(self._marks, INDEX_LATCHED, out=self._marks)
        np.bitwise_or(self._marks, passed, out=self._marks)
        np.bitwise_or(inputs.status, self._marks, out=inputs.status)
        passed[:] = 0
        self._told_index[:] = inputs.index_counts

    def _collect(self, now_s: float) -> int:
        """Take everything that has come; a new sample is decoded and marked unread."""
        line, exchange, block = self._line, self._exchange, self._inputs
        if line is None or exchange is None or block is None or self._lost:
            return NOTHING
        best = NOTHING
        for _ in range(DRAINS):
            space = exchange.space()
            size = line.receive(space)
            if size == LOST:
                self._lost = True
                break
            exchange.received(size)
            verdict = exchange.judge(now_s)
            if verdict == FRESH:
                verdict = self._take(exchange.registers, block)
            best = max(best, verdict)
            if size < len(space):
                break
        return best

    def _take(self, registers: tuple[int, ...], block: InputBlock) -> int:
        if not block.answers(registers, self._sequence):
            return REFUSED
        if not self._wrote:  # the newest request is older than one period, and so is its sample
            block.note_marks(registers)
            return NOTHING
        if block.boot_id(registers) != self._boot_id:
            self._latched = RESTARTED
        block.decode(registers)
        self._unread = True
        return FRESH

    def _take_late(self, registers: tuple[int, ...], newer: int) -> None:
        """Take from a reply to an older request what would not be told again."""
        block = self._inputs
        asked = (self._sequence - 1 - newer) % 0xFFFF + 1
        if block is not None and block.answers(registers, asked):
            block.note_marks(registers)

    def _tripped(self) -> bool:
        exchange = self._exchange
        return (
            self._modbus.watchdog_s is not None
            and exchange is not None
            and exchange.exception_code == DEVICE_FAILURE
        )

    def write(self, outputs: Outputs) -> None:
        """Send the commands, unless the line has to be left alone."""
        now_s, exchange = time.monotonic(), self._exchange
        self._wrote = False
        if exchange is None or self._lost:
            return
        if exchange.may_send(now_s) or (exchange.MAY_INTERRUPT and self._takes_away(outputs)):
            self._wrote = self._send(outputs, now_s)

    def _takes_away(self, outputs: Outputs) -> bool:
        """Tell whether an axis is disabled that the device was last told to enable."""
        return bool(np.any(self._told_enable > outputs.enable))

    def _send(self, outputs: Outputs, now_s: float) -> bool:
        line, exchange, block = self._line, self._exchange, self._outputs
        if line is None or exchange is None or block is None:
            return False
        sequence = self._sequence % 0xFFFF + 1
        block.encode(exchange.request, exchange.data_at, outputs, sequence)
        exchange.seal()
        line.forget()
        done = line.send(exchange.request)
        if done == SENT:
            self._sequence = sequence
            self._told_enable[:] = outputs.enable
            exchange.sent(now_s)
        elif done == LOST:
            self._lost = True
        return done == SENT

    def safe(self) -> None:
        """Zero and disable every axis: on the open connection, else on one made for it."""
        with self.telling_safe():
            if self._line is not None and not self._lost and self._safe_on_line():
                return
            self._safe_on_own_connection()
            self.safe_sent = True

    def _safe_on_line(self) -> bool:
        line, exchange, block = self._line, self._exchange, self._outputs
        if line is None or exchange is None or block is None:
            return False
        deadline_s = time.monotonic() + SAFE_ANSWER_S
        while not exchange.may_send(time.monotonic()) and time.monotonic() < deadline_s:
            line.wait(1e-3)
            self._collect(time.monotonic())
        # The last word counts more than order on the line: it goes out whatever is outstanding.
        if not self._send(block.off, time.monotonic()):
            return False
        deadline_s = time.monotonic() + SAFE_ANSWER_S
        verdict = NOTHING
        while verdict == NOTHING and not self._lost and time.monotonic() < deadline_s:
            line.wait(deadline_s - time.monotonic())
            verdict = self._collect(time.monotonic())
        # What nobody answers may still be on its way, or lie in front of a cable that is out.
        self.safe_sent = True if verdict == FRESH else None
        return not self._lost

    def _safe_on_own_connection(self) -> None:
        options = self._modbus
        outputs = OutputBlock(options, self.channels)
        # What another program drives is not this one's to make safe.
        claim = None if self._claim else self._claimed(outputs)
        try:
            self._switch_off(outputs)
        finally:
            if claim is not None:
                claim.release()

    def _claimed(self, block: OutputBlock) -> Claim | None:
        """Claim what is written; a serial port is claimed by itself."""
        options = self._modbus
        if options.tcp is None:
            return None
        registers = range(block.address, block.address + block.count)
        device = f"tcp: {options.device}, unit {options.unit}"
        outputs = [f"output register {register}" for register in registers]
        if options.watchdog_s is not None:
            # There is one for all of it: whoever writes anything feeds it for everybody.
            outputs.append("watchdog")
        return Claim(device, outputs)

    def _switch_off(self, outputs: OutputBlock) -> None:
        options = self._modbus
        client = connect(options, SAFE_CONNECT_S)
        try:
            switch_off(client, options, outputs, InputBlock(options, self.channels))
        finally:
            release(client)
