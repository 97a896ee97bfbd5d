"""The options of ``type: serial``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from motorctl.hal import DriverOptions
from motorctl_serial.protocol import Mode

PollingMode = Literal["poll", "exchange", "stream"]
LowLatency = Literal["require", "ask", "no"]
MODES: dict[PollingMode, Mode] = {
    "poll": Mode.POLL,
    "exchange": Mode.EXCHANGE,
    "stream": Mode.STREAM,
}
Seconds = Annotated[float, Field(gt=0, lt=60, allow_inf_nan=False)]
Delay = Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]


class Rs485Options(BaseModel):
    """How the kernel's serial driver switches the transmitter by RTS."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    rts_level_for_tx: bool = Field(default=True, description="level of RTS while sending")
    rts_level_for_rx: bool = Field(default=False, description="level of RTS otherwise")
    delay_before_tx_s: Delay = Field(default=0.0, description="from RTS to the first bit")
    delay_before_rx_s: Delay = Field(default=0.0, description="from the last bit to RTS")


class SerialOptions(DriverOptions):
    """A box of amplifiers and encoders that speaks the serial protocol, version 1."""

    port: str = Field(min_length=1, description="the terminal, as /dev/ttyUSB0")
    baud: Annotated[int, Field(gt=0, le=100_000_000)] | None = Field(
        description="bits a second; null for a pseudo-terminal or a USB CDC device: it has none"
    )
    mode: PollingMode = Field(
        default="poll",
        description="poll: a fresh sample each read; exchange: each write asks for the next read's "
        "sample; stream: the device sends by its own clock",
    )
    wait_s: Seconds | None = Field(
        default=None,
        description="how long a read in mode poll waits for its sample; null: 0.7 periods",
    )
    watchdog_s: Annotated[float, Field(ge=0.001, le=65.535)] = Field(
        default=0.02, description="the device zeroes and disables after so long without a command"
    )
    low_latency: LowLatency = Field(
        default="ask", description="require: open fails without it; ask: a note tells; no"
    )
    half_duplex: bool = Field(default=False, description="one pair of wires for both directions")
    rs485: Rs485Options | None = Field(
        default=None, description="switch the transmitter by RTS; implies half duplex"
    )
    turnaround_s: Seconds | None = Field(
        default=None,
        description="from a request to its answer beside the bytes; null: by the port's name",
    )
    connect_s: Seconds = Field(default=2.0, description="how long open waits for the device")

    @field_validator("port")
    @classmethod
    def _can_be_a_path(cls, port: str) -> str:
        if "\0" in port:
            raise ValueError("should not contain a NUL byte: no path has one")
        return port

    @field_validator("wait_s")
    @classmethod
    def _waits_only_where_it_polls(cls, wait_s: float | None, info: ValidationInfo) -> float | None:
        if wait_s is not None and info.data.get("mode") in {"exchange", "stream"}:
            raise ValueError(f"mode {info.data['mode']} never waits; only mode poll does")
        return wait_s

    @field_validator("watchdog_s")
    @classmethod
    def _is_whole_milliseconds(cls, watchdog_s: float) -> float:
        if abs(watchdog_s * 1e3 - round(watchdog_s * 1e3)) > 1e-6:
            raise ValueError("the protocol carries whole milliseconds")
        return watchdog_s

    @field_validator("half_duplex", "rs485")
    @classmethod
    def _streams_only_full_duplex(
        cls, value: bool | Rs485Options | None, info: ValidationInfo
    ) -> bool | Rs485Options | None:
        if value and info.data.get("mode") == "stream":
            raise ValueError("mode stream needs a line for each direction; take exchange or poll")
        return value

    @property
    def one_pair(self) -> bool:
        """Whether both directions share the line."""
        return self.half_duplex or self.rs485 is not None

    @property
    def watchdog_ms(self) -> int:
        """The watchdog as HELLO carries it."""
        return round(self.watchdog_s * 1e3)
