"""Options of the CAN driver, and how they become a layout."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from motorctl_can.bus import BusOptions, refuse
from motorctl_can.checks import Wrong, wrong_in_layout, wrong_sync, wrong_watchdog
from motorctl_can.dbc import DbcSignals, layout_of_dbc
from motorctl_can.layout import Frame, Key, Layout, Means, Place, Signal

SLCAN_DATA_BITRATES = (2000000, 5000000)
ALL = "all"

Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class SyncOptions(_Part):
    """SYNC: sent once a period; the device samples when it arrives."""

    id: int
    """Identifier of the SYNC frame."""
    extended: bool = False
    """The identifier has 29 bits, else 11."""
    wait_s: float = Field(gt=0, le=1.0, allow_inf_nan=False)
    """How long a read waits for the answers, at most."""


class SignalOptions(_Part):
    """Some bits of a frame."""

    means: Means
    """What the bits are: a command (volts, enable, watchdog, sequence) or a state (counts,
    index_counts, index_latched, sequence, boot, or a flag such as limit_negative)."""
    axis: str = ALL
    """Name of the axis whose signal it is; all: every axis of this driver."""
    start: int = Field(ge=0, lt=512)
    """Number of the lowest bit where byte_order is little (byte 1 begins at 8); of the highest,
    as in DBC files, where it is big. Wrong, and a count is read across a field's edge."""
    bits: int = Field(ge=1, le=64)
    """Width of the field. Of counts it must be encoder.counter_bits."""
    byte_order: Literal["little", "big"] = "little"
    """Whether the lowest or the highest byte comes first."""
    signed: bool = False
    """Two's complement; else from 0."""
    scale: float = Field(default=1.0, allow_inf_nan=False)
    """Value = raw * scale + offset, of volts [V] and of the watchdog [s] alone."""
    offset: float = Field(default=0.0, allow_inf_nan=False)
    """Added to raw * scale. 0 V has to be a step of what the field carries."""
    inverted: bool = False
    """0 on the wire means yes; of enable and flags."""


class FrameOptions(_Part):
    """A frame of the bus."""

    id: int
    """Identifier of the frame."""
    extended: bool = False
    """The identifier has 29 bits, else 11."""
    direction: Literal["command", "state"]
    """Whether the frame is sent to the device or comes from it."""
    length: int
    """Bytes of the frame: up to 8, with fd up to 64. A frame of another length is refused."""
    signals: dict[str, SignalOptions]
    """What stands where in the frame, by names of your own."""


class CanOptions(BusOptions):
    """A bus, and what its frames mean; docs/drivers/can.md has complete examples."""

    fd: bool = False
    """CAN FD: frames of up to 64 bytes. The interface has to be set up for it."""
    data_bitrate: int | None = Field(default=None, ge=5000, le=12000000)
    """Of the data phase of CAN FD [bit/s]; null: no switch of the bit rate."""
    frames: dict[str, FrameOptions] | None = None
    """The frames by name, written out here; null: they stand in dbc."""
    dbc: Path | None = None
    """A DBC file with the frames, relative to this file; null: they stand in frames."""
    signals: dict[str, DbcSignals] | None = None
    """What signals of the DBC file mean, by axis or for all: meaning to `Frame.Signal`."""
    sync: SyncOptions | None = None
    """A frame that lets the device sample, sent once a period; null: the device sends by its
    own clock."""
    watchdog_s: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    """After so long without a command the device disables itself [s]; sent in the signal that
    means watchdog, and needed with one."""
    max_age_s: Seconds | None = None
    """A state frame that is older is refused [s]; 0: none is; null: 10 periods."""
    max_frames_per_read: int = Field(default=64, ge=1, le=10000)
    """A read looks at no more frames; lower loses samples on a busy bus, higher lets a babbling
    one take the tick's time."""
    open_timeout_s: float = Field(default=1.0, gt=0, le=60, allow_inf_nan=False)
    """How long opening waits for the first of every state frame [s]."""

    _layout: Layout = PrivateAttr()

    @field_validator("dbc")
    @classmethod
    def _beside_the_yaml_file(cls, value: Path | None, info: ValidationInfo) -> Path | None:
        if value is None:
            return None
        directory = (info.context or {}).get("directory")
        return (Path(directory) if directory else Path.cwd()).joinpath(value).resolve()

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        wrong = self._wrong_keys()
        layout, gaps = self._read_layout()
        wrong += gaps
        if layout.frames and not gaps:
            wrong += wrong_in_layout(layout, self.fd)
            wrong += wrong_watchdog(layout, self.watchdog_s)
        if self.sync is not None:
            wrong += wrong_sync(layout, self.sync.id, self.sync.extended)
        refuse(wrong, "CanOptions")
        self._layout = layout
        return self

    @property
    def layout(self) -> Layout:
        """Return the frames, whether written out or taken from a DBC file."""
        return self._layout

    def _read_layout(self) -> tuple[Layout, list[Wrong]]:
        """Return the layout and its problems; empty unless it is given in exactly one way."""
        if self.frames is not None and self.dbc is None:
            return _layout_of(self.frames), []
        if self.dbc is not None and self.frames is None and self.signals:
            return layout_of_dbc(self.dbc, self.signals)
        return Layout(()), []

    def _wrong_keys(self) -> list[Wrong]:
        wrong = list(self.wrong_in_bus())

        def add(key: Key, found: Any, message: str) -> None:
            wrong.append(Wrong(key, found, message))

        if (self.frames is None) == (self.dbc is None):
            both = "both frames and dbc" if self.dbc else "neither frames nor dbc"
            add(("frames",), both, "should be one of the two: the layout, or a DBC file with it")
        elif self.dbc is not None and not self.signals:
            add(("signals",), None, "is missing: it says what the signals of the DBC file mean")
        elif self.dbc is None and self.signals is not None:
            add(("signals",), "signals", "belongs to dbc; in frames each frame has its own")
        if self.data_bitrate is not None:
            if not self.fd:
                add(("data_bitrate",), self.data_bitrate, "needs fd: true")
            elif self.data_bitrate < self.bitrate:
                add(("data_bitrate",), self.data_bitrate, f"is below the bitrate {self.bitrate}")
        slcan_fd = self.interface == "slcan" and self.fd
        if slcan_fd and self.data_bitrate not in SLCAN_DATA_BITRATES:
            known = " or ".join(map(str, SLCAN_DATA_BITRATES))
            add(("data_bitrate",), self.data_bitrate, f"should be {known} with slcan")
        for name, given in (("frames", self.frames), ("signals", self.signals)):
            if given is not None and not given:
                add((name,), {}, "should not be empty")
        return wrong


def _layout_of(frames: dict[str, FrameOptions]) -> Layout:
    return Layout(tuple(_frame_of(name, given) for name, given in frames.items()))


def _frame_of(name: str, given: FrameOptions) -> Frame:
    key: Key = ("frames", name)
    signals = tuple(
        Signal(
            key=(*key, "signals", signal),
            means=s.means,
            axis=None if s.axis == ALL else s.axis,
            place=Place(s.start, s.bits, s.byte_order == "big"),
            signed=s.signed,
            scale=s.scale,
            offset=s.offset,
            inverted=s.inverted,
        )
        for signal, s in given.signals.items()
    )
    command = given.direction == "command"
    return Frame(key, name, given.id, given.extended, command, given.length, signals)
