"""Options of the Modbus driver: the connection, the coupler, the register map."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from motorctl.hal import DriverOptions
from motorctl_modbus.registers import (
    MOST_READ,
    MOST_WRITTEN,
    Address,
    BootId,
    ChannelMap,
    Part,
    Sequence,
    conflict,
    input_claims,
    output_claims,
)

CouplerName = Literal["generic", "beckhoff_bk9000", "beckhoff_bk73x0"]

BECKHOFF_OUTPUTS = 0x0800
FACTORY_WATCHDOG_S = 1.0
T35_ABOVE_19200_S = 1.75e-3


class Tcp(Part):
    """A device on the network."""

    host: str = Field(min_length=1)
    port: int = Field(default=502, ge=1, le=65535)


class Rtu(Part):
    """A device on a serial line. Parity is even where nothing else is said, as in the standard."""

    port: str = Field(min_length=1)
    baud: int = Field(ge=300, le=12_000_000)
    parity: Literal["none", "even", "odd"] = "even"
    stop_bits: Literal[1, 2] = 1
    silence_s: float | None = Field(default=None, ge=0, le=1)
    """t3.5; None: 3.5 characters up to 19200 baud, 1.75 ms above."""
    timeout_s: float | None = Field(default=None, gt=0, le=60)
    """No new request before a reply has had this long; None: 0.9 of the period."""

    @property
    def character_s(self) -> float:
        """Time of one character on the line."""
        return (1 + 8 + (self.parity != "none") + self.stop_bits) / self.baud

    @property
    def t35_s(self) -> float:
        """Silence between two frames."""
        if self.silence_s is not None:
            return self.silence_s
        return 3.5 * self.character_s if self.baud <= 19200 else T35_ABOVE_19200_S


class ModbusOptions(DriverOptions):
    """One device on Modbus TCP or RTU, and where in its registers the axes are.

    Addresses count from `output_base` and `input_base`. See docs/drivers/modbus.md.
    """

    coupler: CouplerName = "generic"
    tcp: Tcp | None = None
    rtu: Rtu | None = Field(default=None, validate_default=True)
    unit: int = Field(default=1, ge=0, le=255, validate_default=True)
    connect_timeout_s: float = Field(default=1.0, gt=0, le=60)
    """For the connection, and for each exchange that `open` makes."""
    device_turnaround_s: float = Field(default=0.5e-3, ge=0, le=10)
    """From the end of a request to the start of its reply; for the budget alone."""
    watchdog_s: float | None = Field(default=None, ge=1e-3, le=65.535, validate_default=True)
    """After which time without a request the coupler itself zeroes its outputs."""
    word_order: Literal["high_first", "low_first"] = "high_first"
    output_base: Address | None = Field(default=None, validate_default=True)
    input_base: Address | None = Field(default=None, validate_default=True)
    channels: dict[Annotated[int, Field(ge=0)], ChannelMap] = Field(min_length=1)
    sequence: Sequence | None = None
    boot_id: BootId | None = None

    @field_validator("rtu")
    @classmethod
    def _one_connection(cls, rtu: Rtu | None, info: ValidationInfo) -> Rtu | None:
        if "tcp" not in info.data or "coupler" not in info.data:
            return rtu  # that is wrong already
        tcp, coupler = info.data["tcp"], info.data["coupler"]
        if (tcp is None) == (rtu is None):
            raise ValueError("give either tcp: {host, port} or rtu: {port, baud}, not both")
        if coupler == "beckhoff_bk9000" and tcp is None:
            raise ValueError("coupler beckhoff_bk9000 is on tcp, not on rtu")
        if coupler == "beckhoff_bk73x0" and rtu is None:
            raise ValueError("coupler beckhoff_bk73x0 is on rtu, not on tcp")
        return rtu

    @field_validator("unit")
    @classmethod
    def _known_unit(cls, unit: int, info: ValidationInfo) -> int:
        if 247 < unit < 255 or (unit == 255 and info.data.get("rtu") is not None):
            raise ValueError("expected 0 to 247, or 255 on tcp")
        if unit == 0 and info.data.get("rtu") is not None:
            raise ValueError("expected 1 to 247: on rtu 0 is a broadcast, which nobody answers")
        return unit

    @field_validator("watchdog_s")
    @classmethod
    def _known_watchdog(cls, time_s: float | None, info: ValidationInfo) -> float | None:
        if info.data.get("coupler", "generic") != "generic":
            return FACTORY_WATCHDOG_S if time_s is None else time_s
        if time_s is not None and "coupler" in info.data:
            raise ValueError("needs a coupler whose watchdog is known: name it in `coupler`")
        return time_s

    @field_validator("output_base", "input_base")
    @classmethod
    def _known_base(cls, base: int | None, info: ValidationInfo) -> int:
        if base is not None:
            return base
        beckhoff = info.data.get("coupler", "generic") != "generic"
        return BECKHOFF_OUTPUTS if beckhoff and info.field_name == "output_base" else 0

    @field_validator("channels")
    @classmethod
    def _channels_fit(
        cls, channels: dict[int, ChannelMap], info: ValidationInfo
    ) -> dict[int, ChannelMap]:
        _insist(info, channels)
        for number, channel in channels.items():
            if channel.status.index_latched and channel.index_counts is None:
                raise ValueError(f"channels.{number}.status.index_latched needs index_counts")
            index = channel.index_counts
            if index is not None and index.bits != channel.counts.bits:
                raise ValueError(
                    f"channels.{number}.index_counts has {index.bits} bit, and counts "
                    f"{channel.counts.bits}"
                )
            volts = channel.volts
            if not volts.lowest <= volts.zero_count <= volts.highest:
                raise ValueError(
                    f"channels.{number}.volts.zero_count {volts.zero_count} is not within "
                    f"{volts.lowest} to {volts.highest}, which {volts.bits} bit carry"
                )
        return channels

    @field_validator("sequence")
    @classmethod
    def _sequence_fits(cls, sequence: Sequence | None, info: ValidationInfo) -> Sequence | None:
        if "channels" in info.data:
            _insist(info, info.data["channels"], sequence)
        return sequence

    @field_validator("boot_id")
    @classmethod
    def _boot_id_fits(cls, boot_id: BootId | None, info: ValidationInfo) -> BootId | None:
        if "channels" in info.data and "sequence" in info.data:
            _insist(info, info.data["channels"], info.data["sequence"], boot_id)
        return boot_id

    @model_validator(mode="after")
    def _timeout_holds_a_reply(self) -> Self:
        rtu = self.rtu
        if rtu is not None and rtu.timeout_s is not None:
            shortest = rtu.t35_s + self.device_turnaround_s
            if rtu.timeout_s <= shortest:
                raise ValueError(
                    f"rtu.timeout_s {rtu.timeout_s:g} s is not longer than silence and "
                    f"device_turnaround_s, {shortest:g} s: no reply can come within it"
                )
        return self

    @property
    def device(self) -> str:
        """Name of the device, for messages."""
        if self.tcp is not None:
            return f"{self.tcp.host}:{self.tcp.port}"
        assert self.rtu is not None
        return self.rtu.port


def _insist(
    info: ValidationInfo,
    channels: dict[int, ChannelMap],
    sequence: Sequence | None = None,
    boot_id: BootId | None = None,
) -> None:
    outputs = output_claims(channels, sequence)
    inputs = input_claims(channels, sequence, boot_id)
    for claims, name, most, kind in (
        (outputs, "output_base", MOST_WRITTEN, "output"),
        (inputs, "input_base", MOST_READ, "input"),
    ):
        wrong = conflict(claims, info.data.get(name) or 0, most, kind)
        if wrong is not None:
            raise ValueError(wrong)
