"""What the registers of one exchange mean: volts and enables into words, words into counts."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from motorctl.hal import Channel, Outputs, Status
from motorctl_modbus.options import ModbusOptions
from motorctl_modbus.registers import ChannelMap, Volts, block, input_claims, output_claims

REGISTER = struct.Struct(">H")


def used_of(options: ModbusOptions, channels: Sequence[Channel]) -> dict[int, ChannelMap]:
    """Return the part of the map that axes use, by channel number."""
    used = {channel.number for channel in channels}
    return {number: part for number, part in options.channels.items() if number in used}


class OutputBlock:
    """The registers that every request writes, from the lowest to the highest of the axes' own.

    Channels in between that no axis uses are at zero and disabled.
    """

    def __init__(self, options: ModbusOptions, channels: Sequence[Channel]) -> None:
        maps = [options.channels[channel.number] for channel in channels]
        first, self.count = block(output_claims(used_of(options, channels), options.sequence))
        self.address = (options.output_base or 0) + first
        high_first = options.word_order == "high_first"
        self._volts = [_volts_plan(part.volts, first, high_first) for part in maps]
        used = {channel.number for channel in channels}
        self._unused = [
            _volts_plan(part.volts, first, high_first)
            for number, part in options.channels.items()
            if number not in used and 0 <= part.volts.address - first < self.count
        ]
        enables = sorted({part.enable.address - first for part in maps})
        self._enables = [(enables.index(m.enable.address - first), 1 << m.enable.bit) for m in maps]
        self._enable_at = [2 * address for address in enables]
        self._enable_words = [0] * len(enables)
        sequence = options.sequence
        self._sequence_at = None if sequence is None else 2 * (sequence.output - first)
        self.off = Outputs(len(maps))
        """Every axis at zero and disabled."""

    def encode(self, frame: bytearray, at: int, outputs: Outputs, sequence: int) -> None:
        """Write the commands into `frame` from byte `at` on. Registers in between stay as they are.

        What the word cannot carry is clamped to its ends; a command that is not a number is sent as
        zero and disabled.
        """
        words = self._enable_words
        for i in range(len(words)):
            words[i] = 0
        volts, enables = outputs.volts.tolist(), outputs.enable.tolist()
        for i, (packing, offset, scale, zero, low, high, mask, swap) in enumerate(self._volts):
            value, count = volts[i], zero
            if enables[i] and value == value:  # noqa: PLR0124 (false for what is not a number)
                exact = value / scale + zero
                count = low if exact <= low else high if exact >= high else round(exact)
                word, bit = self._enables[i]
                words[word] |= bit
            packing.pack_into(frame, at + offset, _word(count, mask, swap))
        for offset, word in zip(self._enable_at, words, strict=True):
            REGISTER.pack_into(frame, at + offset, word)
        if self._sequence_at is not None:
            REGISTER.pack_into(frame, at + self._sequence_at, sequence)

    def off_registers(self, sequence: int) -> list[int]:
        """Return the registers of every channel at zero and disabled."""
        frame = bytearray(2 * self.count)
        for packing, offset, _, zero, _, _, mask, swap in self._unused:
            packing.pack_into(frame, offset, _word(zero, mask, swap))
        self.encode(frame, 0, self.off, sequence)
        return list(struct.unpack(f">{self.count}H", frame))


class InputBlock:
    """The registers that every reply brings, from the lowest to the highest address."""

    def __init__(self, options: ModbusOptions, channels: Sequence[Channel]) -> None:
        maps = [options.channels[channel.number] for channel in channels]
        claims = input_claims(used_of(options, channels), options.sequence, options.boot_id)
        first, self.count = block(claims)
        self.address = (options.input_base or 0) + first
        high_first = options.word_order == "high_first"
        self._plans = [_input_plan(part, first, high_first) for part in maps]
        sequence, boot_id = options.sequence, options.boot_id
        self._sequence = None if sequence is None else sequence.input - first
        self._boot_id = None if boot_id is None else boot_id.address - first
        self.counts = np.zeros(len(maps), np.int64)
        self.index_counts = np.zeros(len(maps), np.int64)
        self.status = np.zeros(len(maps), np.uint32)
        self.passed = np.zeros(len(maps), np.uint32)
        """INDEX_LATCHED where a reply told of a mark whose counts were too old to be a sample."""
        self._marks = [
            (i, bit)
            for i, (_, _, bits) in enumerate(self._plans)
            for bit in bits
            if bit[3] == Status.INDEX_LATCHED
        ]

    def answers(self, registers: tuple[int, ...], sequence: int) -> bool:
        """Tell whether these registers show the sequence number of the request they answer."""
        return self._sequence is None or registers[self._sequence] == sequence

    def boot_id(self, registers: tuple[int, ...]) -> int:
        """Return the device's boot number; 0 where it has none."""
        return 0 if self._boot_id is None else registers[self._boot_id]

    def note_marks(self, registers: tuple[int, ...]) -> None:
        """Note the index marks that a reply tells of, in `passed`, and nothing else of it."""
        for i, (register, mask, inverted, flag) in self._marks:
            if (registers[register] & mask == 0) == inverted:
                self.passed[i] = flag

    def decode(self, registers: tuple[int, ...]) -> None:
        """Fill `counts`, `index_counts` and `status` from the registers of a reply."""
        for i, (counts, index, bits) in enumerate(self._plans):
            self.counts[i] = _integer(registers, *counts)
            if index is not None:
                self.index_counts[i] = _integer(registers, *index)
            status = 0
            for register, mask, inverted, flag in bits:
                if (registers[register] & mask == 0) == inverted:
                    status |= flag
            self.status[i] = status


VoltsPlan = tuple[struct.Struct, int, float, int, int, int, int, bool]
WordPlan = tuple[tuple[int, ...], int]
BitPlan = tuple[int, int, bool, int]


def _volts_plan(volts: Volts, first: int, high_first: bool) -> VoltsPlan:
    return (
        struct.Struct(">H" if volts.bits == 16 else ">I"),
        2 * (volts.address - first),
        volts.volts_per_count,
        volts.zero_count,
        volts.lowest,
        volts.highest,
        (1 << volts.bits) - 1,
        volts.bits == 32 and not high_first,
    )


def _word(count: int, mask: int, swap: bool) -> int:
    """Return a count as it is sent: unsigned, the registers in the device's order."""
    count &= mask
    return (count >> 16) | ((count & 0xFFFF) << 16) if swap else count


def _input_plan(
    part: ChannelMap, first: int, high_first: bool
) -> tuple[WordPlan, WordPlan | None, list[BitPlan]]:
    words: list[WordPlan | None] = []
    for word in (part.counts, part.index_counts):
        if word is None:
            words.append(None)
            continue
        places = tuple(word.address - first + i for i in range(word.bits // 16))
        sign = 1 << (word.bits - 1) if word.signed or word.bits == 64 else 0
        words.append((places if high_first else places[::-1], sign))
    bits = [
        (bit.address - first, 1 << bit.bit, bit.inverted, int(Status[name.upper()]))
        for name, bit in part.status.named()
    ]
    assert words[0] is not None
    return words[0], words[1], bits


def _integer(registers: tuple[int, ...], places: tuple[int, ...], sign: int) -> int:
    value = 0
    for place in places:
        value = value << 16 | registers[place]
    return (value ^ sign) - sign
