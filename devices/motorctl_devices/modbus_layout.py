"""What stands in which register, and a machine behind the registers."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from motorctl.hal import Status
from motorctl_devices.modbus_pdu import Block
from motorctl_devices.orders import Settings

Address = Annotated[int, Field(ge=0, le=65535)]
Bit = Annotated[int, Field(ge=0, le=15)]
WordOrder = Literal["high_first", "low_first"]


class VoltsShape(Settings):
    """The word of a voltage."""

    address: Address
    bits: Literal[16, 32] = 16
    signed: bool = True
    volts_per_count: Annotated[float, Field(gt=0)]
    zero_count: int = 0


class EnableShape(Settings):
    """The bit that enables an amplifier."""

    address: Address
    bit: Bit


class CountsShape(Settings):
    """The words of a counter."""

    address: Address
    bits: Literal[16, 32, 64] = 32
    signed: bool = True


class FlagShape(Settings):
    """A bit that tells something."""

    address: Address
    bit: Bit
    inverted: bool = False


class StatusShape(Settings):
    """Bits that tell what `motorctl.hal.Status` knows."""

    encoder_lost: FlagShape | None = None
    amplifier_fault: FlagShape | None = None
    limit_negative: FlagShape | None = None
    limit_positive: FlagShape | None = None
    home_switch: FlagShape | None = None
    index_latched: FlagShape | None = None
    estop: FlagShape | None = None


class ModbusChannelShape(Settings):
    """What is on one channel."""

    volts: VoltsShape
    enable: EnableShape
    counts: CountsShape
    index_counts: CountsShape | None = None
    status: StatusShape = Field(default_factory=StatusShape)


class SequenceShape(Settings):
    """Where the host writes a number, and where it is shown again."""

    output: Address
    input: Address


class BootIdShape(Settings):
    """Where the number of this start is shown."""

    address: Address


class TcpShape(Settings):
    """Where to listen; port 0 takes a free one."""

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 502


class RtuShape(Settings):
    """A pseudo-terminal, which has neither a speed nor parity."""


class ModbusShape(Settings):
    """A Modbus coupler; the registers are written as for the driver."""

    tcp: TcpShape | None = None
    rtu: RtuShape | None = None
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    coupler: Literal["beckhoff_bk9000", "beckhoff_bk73x0"] | None = None
    word_order: WordOrder = "high_first"
    output_base: Address = 0
    input_base: Address = 0
    channels: dict[Annotated[int, Field(ge=0)], ModbusChannelShape]
    sequence: SequenceShape | None = None
    boot_id: BootIdShape | None = None

    @model_validator(mode="after")
    def _one_line_and_a_coupler_that_fits(self) -> Self:
        if (self.tcp is None) == (self.rtu is None):
            raise ValueError("give one of tcp and rtu")
        if self.coupler is not None:
            if (self.coupler == "beckhoff_bk9000") != (self.tcp is not None):
                raise ValueError(f"{self.coupler} is no {'tcp' if self.tcp else 'rtu'} coupler")
            if self.output_base or self.input_base:
                raise ValueError("a coupler sets input_base and output_base itself")
        return self

    @property
    def bases(self) -> tuple[int, int]:
        """Return the addresses from which inputs and outputs are counted."""
        return (0, 0x0800) if self.coupler else (self.input_base, self.output_base)


FLAGS = {name: int(Status[name.upper()]) for name in StatusShape.model_fields}


def problems(
    shape: ModbusShape, counter_bits: list[int]
) -> list[tuple[tuple[str | int, ...], str]]:
    """Tell what does not fit between the registers and the device's channels."""
    found: list[tuple[tuple[str | int, ...], str]] = []
    for number in range(len(counter_bits)):
        if number not in shape.channels:
            found.append((("channels",), f"channel {number} of the device has no entry"))
    for number, channel in shape.channels.items():
        where = ("channels", str(number))
        if number >= len(counter_bits):
            found.append((where, f"the device has {len(counter_bits)} channels, from 0"))
        elif channel.counts.bits != counter_bits[number]:
            message = f"found {channel.counts.bits}, the channel's counter_bits are"
            found.append(((*where, "counts", "bits"), f"{message} {counter_bits[number]}"))
    inputs, outputs = shape.bases
    for block, base in ((input_block(shape), inputs), (output_block(shape), outputs)):
        if base + block.start + block.size > 65536:
            found.append((("channels",), "an address lies beyond 65535"))
    return found


def input_block(shape: ModbusShape) -> Block:
    """Return the range of the registers that are read, from the input base."""
    ends: list[tuple[int, int]] = []
    for channel in shape.channels.values():
        for word in (channel.counts, channel.index_counts):
            if word is not None:
                ends.append((word.address, word.address + word.bits // 16))
        for name in FLAGS:
            flag = getattr(channel.status, name)
            if flag is not None:
                ends.append((flag.address, flag.address + 1))
    if shape.sequence:
        ends.append((shape.sequence.input, shape.sequence.input + 1))
    if shape.boot_id:
        ends.append((shape.boot_id.address, shape.boot_id.address + 1))
    return _block(ends)


def output_block(shape: ModbusShape) -> Block:
    """Return the range of the registers that are written, from the output base."""
    ends: list[tuple[int, int]] = []
    for channel in shape.channels.values():
        volts, enable = channel.volts, channel.enable
        ends.append((volts.address, volts.address + volts.bits // 16))
        ends.append((enable.address, enable.address + 1))
    if shape.sequence:
        ends.append((shape.sequence.output, shape.sequence.output + 1))
    return _block(ends)


def _block(ends: list[tuple[int, int]]) -> Block:
    start = min(first for first, _ in ends)
    return Block(start, max(last for _, last in ends) - start)
