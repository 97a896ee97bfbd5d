"""The parts of a register map as they stand in YAML, and who claims which register."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

MOST_READ = 125
"""Registers that one function code 23 may read, and write: the request has to fit 253 bytes."""
MOST_WRITTEN = 121

Address = Annotated[int, Field(ge=0, le=0xFFFF)]


class Part(BaseModel):
    """Base of every part of the options; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Volts(Part):
    """The output word of an axis: zero_count + volts / volts_per_count, clamped to its width."""

    address: Address
    bits: Literal[16, 32] = 16
    signed: bool = True
    volts_per_count: float = Field(gt=0, allow_inf_nan=False)
    zero_count: int = Field(default=0, ge=-(2**31), lt=2**32)

    @property
    def lowest(self) -> int:
        """The smallest count that the word can carry."""
        return -(1 << (self.bits - 1)) if self.signed else 0

    @property
    def highest(self) -> int:
        """The largest count that the word can carry."""
        return (1 << (self.bits - self.signed)) - 1


class Counts(Part):
    """A counter of an axis. 64 bit ones are signed."""

    address: Address
    bits: Literal[16, 32, 64]
    signed: bool = True


class OutputBit(Part):
    """One bit of an output register; bit 0 is the lowest."""

    address: Address
    bit: int = Field(ge=0, le=15)


class InputBit(Part):
    """One bit of an input register; `inverted` where 0 means that it is so."""

    address: Address
    bit: int = Field(ge=0, le=15)
    inverted: bool = False


class StatusBits(Part):
    """Where the device shows what, each named as in `motorctl.hal.Status`."""

    encoder_lost: InputBit | None = None
    amplifier_fault: InputBit | None = None
    limit_negative: InputBit | None = None
    limit_positive: InputBit | None = None
    home_switch: InputBit | None = None
    index_latched: InputBit | None = None
    estop: InputBit | None = None

    def named(self) -> Iterator[tuple[str, InputBit]]:
        """Give those that the device has, with their names."""
        for name in StatusBits.model_fields:
            bit = getattr(self, name)
            if bit is not None:
                yield name, bit


class ChannelMap(Part):
    """The registers of one channel."""

    volts: Volts
    enable: OutputBit
    counts: Counts
    index_counts: Counts | None = None
    status: StatusBits = StatusBits()


class Sequence(Part):
    """A number that every request writes to `output` and that the device shows in `input`."""

    output: Address
    input: Address


class BootId(Part):
    """An input register whose value is another one after every start of the device."""

    address: Address


@dataclass(frozen=True)
class Claim:
    """A key that claims registers, or one bit of a register."""

    key: str
    address: int
    registers: int
    bit: int | None = None
    shared: tuple[str, bool] | None = None
    """Claims of the same bit may stand side by side where this is the same."""


def output_claims(
    channels: Mapping[int, ChannelMap], sequence: Sequence | None = None
) -> list[Claim]:
    """Give everything that a request writes."""
    claims = []
    for number, channel in channels.items():
        volts, enable = channel.volts, channel.enable
        claims.append(Claim(f"channels.{number}.volts", volts.address, volts.bits // 16))
        claims.append(Claim(f"channels.{number}.enable", enable.address, 1, enable.bit))
    if sequence is not None:
        claims.append(Claim("sequence.output", sequence.output, 1))
    return claims


def input_claims(
    channels: Mapping[int, ChannelMap],
    sequence: Sequence | None = None,
    boot_id: BootId | None = None,
) -> list[Claim]:
    """Give everything that a request reads."""
    claims = []
    for number, channel in channels.items():
        for name, word in (("counts", channel.counts), ("index_counts", channel.index_counts)):
            if word is not None:
                key = f"channels.{number}.{name}"
                claims.append(Claim(key, word.address, word.bits // 16))
        for name, bit in channel.status.named():
            key, shared = f"channels.{number}.status.{name}", (name, bit.inverted)
            claims.append(Claim(key, bit.address, 1, bit.bit, shared))
    if sequence is not None:
        claims.append(Claim("sequence.input", sequence.input, 1))
    if boot_id is not None:
        claims.append(Claim("boot_id", boot_id.address, 1))
    return claims


def block(claims: list[Claim]) -> tuple[int, int]:
    """Give the first address and the number of registers that cover all claims."""
    first = min(claim.address for claim in claims)
    return first, max(claim.address + claim.registers for claim in claims) - first


def conflict(claims: list[Claim], base: int, most: int, kind: str) -> str | None:
    """Tell what keeps these claims from being one block of at most `most` registers, or None."""
    words: dict[int, Claim] = {}
    bits: dict[tuple[int, int], Claim] = {}
    for claim in claims:
        for address in range(claim.address, claim.address + claim.registers):
            held = words.get(address)
            if claim.bit is None:
                held = held or next((c for (a, _), c in bits.items() if a == address), None)
                words[address] = claim
            elif held is None:
                held = bits.setdefault((address, claim.bit), claim)
                if held is claim or (claim.shared is not None and held.shared == claim.shared):
                    continue
            if held is not None:
                where = f"{kind} register {address}"
                if claim.bit is not None and held.bit is not None:
                    where += f" bit {claim.bit}"
                return f"{claim.key} is on {where}, which {held.key} uses already"
    first, count = block(claims)
    if base + first + count > 0x10000:
        last = max(claims, key=lambda claim: claim.address + claim.registers)
        return f"{last.key} ends at {kind} register {base + first + count - 1:#x}, past 0xffff"
    if count > most:
        ends = sorted(claims, key=lambda claim: claim.address)
        return (
            f"the {kind} registers from {ends[0].key} to {ends[-1].key} are {count} in a row, and "
            f"one request carries at most {most}"
        )
    return None
