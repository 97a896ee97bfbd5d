"""The parts of a register map as they stand in YAML, and who claims which register."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

MOST_READ = 125
"""Registers that one function code 23 may read, and write: the request has to fit 253 bytes."""
MOST_WRITTEN = 121

Address = Annotated[int, Field(ge=0, le=0xFFFF)]


class Part(BaseModel):
    """Base of every part of the options; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Volts(Part):
    """The output word of an axis: zero_count + volts / volts_per_count, clamped to its width."""

    address: Address
    """First register, counted from output_base."""
    bits: Literal[16, 32] = 16
    """Width of the word."""
    signed: bool = True
    """Two's complement; else from 0."""
    volts_per_count: float = Field(gt=0, allow_inf_nan=False)
    """Volts of command for one count of the word: 10/32767 for an output of 10 V over 16 bits.
    Wrong, and every parameter of the model is wrong by as much."""
    zero_count: int = Field(default=0, ge=-(2**31), lt=2**32)
    """The count that gives 0 V."""

    @field_validator("zero_count")
    @classmethod
    def _is_carried(cls, zero_count: int, info: ValidationInfo) -> int:
        if {"bits", "signed"} <= info.data.keys():
            bits, signed = info.data["bits"], info.data["signed"]
            lowest, highest = _range(bits, signed)
            if not lowest <= zero_count <= highest:
                kind = "signed" if signed else "unsigned"
                raise ValueError(f"expected {lowest} to {highest}, which {bits} bit {kind} carry")
        return zero_count

    @property
    def lowest(self) -> int:
        """The smallest count that the word can carry."""
        return _range(self.bits, self.signed)[0]

    @property
    def highest(self) -> int:
        """The largest count that the word can carry."""
        return _range(self.bits, self.signed)[1]


def _range(bits: int, signed: bool) -> tuple[int, int]:
    return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)


class Counts(Part):
    """A counter of an axis. 64 bit ones are signed."""

    address: Address
    """First register, counted from input_base."""
    bits: Literal[16, 32, 64]
    """Width of the counter; as encoder.counter_bits."""
    signed: bool = True
    """Two's complement; else from 0."""


class OutputBit(Part):
    """One bit of an output register; bit 0 is the lowest."""

    address: Address
    """Register, counted from output_base."""
    bit: int = Field(ge=0, le=15)
    """Bit of it, 0 the lowest."""


class InputBit(Part):
    """One bit of an input register; `inverted` where 0 means that it is so."""

    address: Address
    """Register, counted from input_base."""
    bit: int = Field(ge=0, le=15)
    """Bit of it, 0 the lowest."""
    inverted: bool = False
    """0 means that it is so."""


class StatusBits(Part):
    """Where the device shows what, each named as in `motorctl.hal.Status`."""

    encoder_lost: InputBit | None = None
    """The count cannot be trusted; null: the device does not tell."""
    amplifier_fault: InputBit | None = None
    """The amplifier has a fault; null: the device does not tell."""
    limit_negative: InputBit | None = None
    """The limit switch at the negative end is pressed; null: none."""
    limit_positive: InputBit | None = None
    """The limit switch at the positive end is pressed; null: none."""
    home_switch: InputBit | None = None
    """The home switch is pressed; null: none."""
    index_latched: InputBit | None = None
    """An index mark was passed since the last reply; null: none."""
    estop: InputBit | None = None
    """The emergency-stop chain is open; null: the device does not tell."""

    def named(self) -> Iterator[tuple[str, InputBit]]:
        """Yield the bits that the device has, with their names."""
        for name in StatusBits.model_fields:
            bit = getattr(self, name)
            if bit is not None:
                yield name, bit


class ChannelMap(Part):
    """The registers of one channel."""

    volts: Volts
    """Where the command goes."""
    enable: OutputBit
    """The bit that enables the amplifier."""
    counts: Counts
    """Where the encoder's count is."""
    index_counts: Counts | None = None
    """Where the count at the last index mark is; null: no index."""
    status: StatusBits = StatusBits()
    """Where the device shows faults and switches."""


class Sequence(Part):
    """A number that every request writes to `output` and that the device shows in `input`."""

    output: Address
    """Register that it is written to, counted from output_base."""
    input: Address
    """Register that shows it, counted from input_base."""


class BootId(Part):
    """An input register whose value is another one after every start of the device."""

    address: Address
    """Register, counted from input_base."""


@dataclass(frozen=True)
class Claim:
    """A key that claims registers, or one bit of a register."""

    path: tuple[str, ...]
    address: int
    registers: int
    bit: int | None = None
    shared: tuple[str, bool] | None = None
    """Claims of the same bit may stand side by side where this is the same."""

    @property
    def key(self) -> str:
        """The key as people write it."""
        return ".".join(self.path)


def output_claims(
    channels: Mapping[int, ChannelMap], sequence: Sequence | None = None
) -> list[Claim]:
    """Return a claim for everything that a request writes."""
    claims = []
    for number, channel in channels.items():
        part, volts, enable = ("channels", str(number)), channel.volts, channel.enable
        claims.append(Claim((*part, "volts"), volts.address, volts.bits // 16))
        claims.append(Claim((*part, "enable"), enable.address, 1, enable.bit))
    if sequence is not None:
        claims.append(Claim(("sequence", "output"), sequence.output, 1))
    return claims


def input_claims(
    channels: Mapping[int, ChannelMap],
    sequence: Sequence | None = None,
    boot_id: BootId | None = None,
) -> list[Claim]:
    """Return a claim for everything that a request reads."""
    claims = []
    for number, channel in channels.items():
        part = ("channels", str(number))
        for name, word in (("counts", channel.counts), ("index_counts", channel.index_counts)):
            if word is not None:
                claims.append(Claim((*part, name), word.address, word.bits // 16))
        for name, bit in channel.status.named():
            shared = (name, bit.inverted)
            claims.append(Claim((*part, "status", name), bit.address, 1, bit.bit, shared))
    if sequence is not None:
        claims.append(Claim(("sequence", "input"), sequence.input, 1))
    if boot_id is not None:
        claims.append(Claim(("boot_id",), boot_id.address, 1))
    return claims


def block(claims: list[Claim]) -> tuple[int, int]:
    """Return the first address and the number of registers that cover all claims."""
    first = min(claim.address for claim in claims)
    return first, max(claim.address + claim.registers for claim in claims) - first
