"""Options of the Modbus driver: the connection, the coupler, the register map."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from motorctl.hal import DriverOptions
from motorctl_modbus.registers import Address, BootId, ChannelMap, Part, Sequence

CouplerName = Literal["generic", "beckhoff_bk9000", "beckhoff_bk73x0"]

BECKHOFF_OUTPUTS = 0x0800
FACTORY_WATCHDOG_S = 1.0
T35_ABOVE_19200_S = 1.75e-3


def _without_nul(name: str) -> str:
    if "\0" in name:
        raise ValueError("should not contain a NUL byte: no name of a host or port has one")
    return name


Name = Annotated[str, Field(min_length=1), AfterValidator(_without_nul)]


class Tcp(Part):
    """A device on the network."""

    host: Name
    """Name or address of the device."""
    port: int = Field(default=502, ge=1, le=65535)
    """TCP port; Modbus has 502."""


class Rtu(Part):
    """A device on a serial line. Parity is even where nothing else is said, as in the standard."""

    port: Name
    """The serial port, as /dev/ttyUSB0."""
    baud: int = Field(ge=300, le=12_000_000)
    """Bits a second, as the device is set; `check` tells how many exchanges they carry."""
    parity: Literal["none", "even", "odd"] = "even"
    """As the device is set; wrong, and no answer comes."""
    stop_bits: Literal[1, 2] = 1
    """As the device is set; the standard has 2 without parity."""
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
    """A known make, whose watchdog and addresses the driver knows; generic: any device."""
    tcp: Tcp | None = None
    """The device on the network; null: it is on rtu."""
    rtu: Rtu | None = Field(default=None, validate_default=True)
    """The device on a serial line; null: it is on tcp."""
    unit: int = Field(default=1, ge=0, le=255, validate_default=True)
    """Unit identifier of the device; on rtu 1 to 247, as it is set there."""
    connect_timeout_s: float = Field(default=1.0, gt=0, le=60)
    """For the connection, and for each exchange that `open` makes."""
    device_turnaround_s: float = Field(default=0.5e-3, ge=0, le=10)
    """From the end of a request to the start of its reply; for the budget alone."""
    watchdog_s: float | None = Field(default=None, ge=1e-3, le=65.535, validate_default=True)
    """After which time without a request the coupler itself zeroes its outputs."""
    word_order: Literal["high_first", "low_first"] = "high_first"
    """Which register of a number of 32 or 64 bits comes first. Wrong, and counts jump by 65536."""
    output_base: Address | None = Field(default=None, validate_default=True)
    """Added to every address of an output; null: 0, with a Beckhoff coupler 0x0800."""
    input_base: Address | None = Field(default=None, validate_default=True)
    """Added to every address of an input; null: 0."""
    channels: dict[Annotated[int, Field(ge=0)], ChannelMap] = Field(min_length=1)
    """The registers of each channel, by its number."""
    sequence: Sequence | None = None
    """Registers that show which request a reply answers; null: on TCP the transaction's number
    does, on RTU nothing."""
    boot_id: BootId | None = None
    """Register that shows that the device was restarted; null: a restart is seen only where the
    connection breaks."""

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

    @property
    def device(self) -> str:
        """Name of the device, for messages."""
        if self.tcp is not None:
            return f"{self.tcp.host}:{self.tcp.port}"
        assert self.rtu is not None
        return self.rtu.port
