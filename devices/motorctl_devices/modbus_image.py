"""A machine behind registers: counts and flags that can be read, commands that are obeyed."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

from motorctl_devices.machine import Machine
from motorctl_devices.modbus_layout import (
    FLAGS,
    CountsShape,
    FlagShape,
    ModbusShape,
    VoltsShape,
    input_block,
    output_block,
)
from motorctl_devices.modbus_pdu import (
    ILLEGAL_ADDRESS,
    ILLEGAL_VALUE,
    Block,
    RefusedError,
    Registers,
    Table,
)

COUPLER_STATUS, WATCHDOG_TIME, WATCHDOG_RESET = 0x100C, 0x1120, 0x1121
WATCHDOG_RAN_OUT = 1 << 15
RESET_WORDS = (0xBECF, 0xAFFE)
FACTORY_WATCHDOG_MS = 1000
DEVICE_FAILURE = 4
NS_A_MS = 1_000_000


@dataclass
class Image:
    """The registers of a machine: shows its counts, and obeys what is written."""

    shape: ModbusShape
    machine: Machine
    now_ns: Callable[[], int]
    echo: Callable[[int], int]
    """Returns the sequence number to show for the one that was written."""

    def __post_init__(self) -> None:
        self._in_base, self._out_base = self.shape.bases
        inputs, outputs = input_block(self.shape), output_block(self.shape)
        self._outputs = Block(self._out_base + outputs.start, outputs.size)
        shown = Table(Block(self._in_base + inputs.start, inputs.size))
        self.registers = Registers(shown, Table(self._outputs), self.show, self.obey)
        self.clear()

    def clear(self) -> None:
        """Be as after power-on: commands are of no volts and nothing enabled."""
        told = self.registers.told.data
        told[:] = bytes(len(told))
        for number, channel in self.shape.channels.items():
            if number < self.machine.channels:
                self._put(told, self._out_base, channel.volts, channel.volts.zero_count)
        self._echo(0)

    def show(self, start: int, count: int) -> None:
        """Sample, and put counts, flags and the number of this start into the registers."""
        machine = self.machine
        machine.sample(self.now_ns())
        data = self.registers.shown.data
        words: dict[int, int] = {}
        for number, channel in self.shape.channels.items():
            self._put(data, self._in_base, channel.counts, machine.counts[number])
            if channel.index_counts is not None:
                marked = machine.index_counts[number]
                self._put(data, self._in_base, channel.index_counts, marked)
            status = machine.status[number]
            if machine.tripped[number]:
                status |= FLAGS["amplifier_fault"]
            for name, mask in FLAGS.items():
                flag: FlagShape | None = getattr(channel.status, name)
                if flag is None:
                    continue
                word = words.setdefault(flag.address, 0)
                if bool(status & mask) != flag.inverted:
                    words[flag.address] = word | 1 << flag.bit
        for address, word in words.items():
            place = 2 * (self._in_base + address)
            data[place : place + 2] = word.to_bytes(2, "big")
        if self.shape.boot_id is not None:
            place = 2 * (self._in_base + self.shape.boot_id.address)
            data[place : place + 2] = machine.boot_id.to_bytes(2, "big")
        machine.index_told()

    def obey(self, start: int, count: int) -> None:
        """Command the amplifiers as the output registers now say."""
        end = start + count
        if start >= self._outputs.start + self._outputs.size or end <= self._outputs.start:
            raise RefusedError(ILLEGAL_ADDRESS)
        data, machine, now_ns = self.registers.told.data, self.machine, self.now_ns()
        for number, channel in self.shape.channels.items():
            volts, enable = channel.volts, channel.enable
            raw = self._get(data, self._out_base, volts)
            place = 2 * (self._out_base + enable.address)
            on = int.from_bytes(data[place : place + 2], "big") >> enable.bit & 1
            level = (raw - volts.zero_count) * volts.volts_per_count
            machine.command(number, level, bool(on), now_ns)
        machine.apply(now_ns)
        if self.shape.sequence is not None:
            place = 2 * (self._out_base + self.shape.sequence.output)
            self._echo(int.from_bytes(data[place : place + 2], "big"))

    def _echo(self, number: int) -> None:
        if self.shape.sequence is None:
            return
        place = 2 * (self._in_base + self.shape.sequence.input)
        shown = self.echo(number) if number else 0
        self.registers.shown.data[place : place + 2] = shown.to_bytes(2, "big")

    def _put(self, data: bytearray, base: int, word: CountsShape | VoltsShape, value: int) -> None:
        count = word.bits // 16
        raw = (value & (1 << word.bits) - 1).to_bytes(2 * count, "big")
        if count > 1 and self.shape.word_order == "low_first":
            raw = _swapped(raw)
        place = 2 * (base + word.address)
        data[place : place + 2 * count] = raw

    def _get(self, data: bytearray, base: int, word: VoltsShape) -> int:
        count = word.bits // 16
        place = 2 * (base + word.address)
        raw = bytes(data[place : place + 2 * count])
        if count > 1 and self.shape.word_order == "low_first":
            raw = _swapped(raw)
        return int.from_bytes(raw, "big", signed=word.signed)


class Coupler(Image):
    """A Beckhoff coupler: an image with a watchdog of its own, in registers 0x100C and 0x1120 on.

    The first write of outputs makes the watchdog active. Once it ran out, exchanges are answered
    with exception 4 until the two reset words came.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self.registers.shown.extend(Block(COUPLER_STATUS, 1))
        self.registers.told.extend(Block(WATCHDOG_TIME, 2))
        self._power_on()

    def _power_on(self) -> None:
        self._fed_ns: int | None = None
        self._ran_out = False
        self._half_reset = False
        self._set_time(FACTORY_WATCHDOG_MS)

    def clear(self) -> None:
        """Be as after power-on."""
        super().clear()
        self._power_on()

    def _set_time(self, watchdog_ms: int) -> None:
        self._watchdog_ms = watchdog_ms
        self.machine.set_watchdog(watchdog_ms * 1e-3)
        place = 2 * WATCHDOG_TIME
        self.registers.told.data[place : place + 2] = watchdog_ms.to_bytes(2, "big")

    def _check(self) -> None:
        fed_ns, limit_ns = self._fed_ns, self._watchdog_ms * NS_A_MS
        if fed_ns is not None and limit_ns and self.now_ns() - fed_ns >= limit_ns:
            self._ran_out = True

    def show(self, start: int, count: int) -> None:
        """Show the machine, or the coupler's own registers. Raises RefusedError."""
        self._check()
        if start >= COUPLER_STATUS:
            place = 2 * COUPLER_STATUS
            word = WATCHDOG_RAN_OUT if self._ran_out else 0
            self.registers.shown.data[place : place + 2] = word.to_bytes(2, "big")
        elif self._ran_out:
            raise RefusedError(DEVICE_FAILURE)
        else:
            super().show(start, count)

    def obey(self, start: int, count: int) -> None:
        """Obey commands, or set the watchdog. Raises RefusedError."""
        self._check()
        if start < WATCHDOG_TIME:
            if self._ran_out:
                raise RefusedError(DEVICE_FAILURE)
            self._fed_ns = self.now_ns()
            super().obey(start, count)
            return
        place = 2 * start
        word = int.from_bytes(self.registers.told.data[place : place + 2], "big")
        if start == WATCHDOG_TIME:
            if self._fed_ns is not None:
                raise RefusedError(ILLEGAL_VALUE)
            self._set_time(word)
        elif self._half_reset and word == RESET_WORDS[1]:
            self._fed_ns, self._ran_out, self._half_reset = None, False, False
            self.machine.disable_all()
        else:
            self._half_reset = word == RESET_WORDS[0]


def _swapped(raw: bytes) -> bytes:
    words = struct.unpack(f">{len(raw) // 2}H", raw)
    return struct.pack(f">{len(words)}H", *reversed(words))
