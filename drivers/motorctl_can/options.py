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
    model_config = ConfigDict(extra="forbid", frozen=True)


class SyncOptions(_Part):
    """SYNC: sent once a period; the device samples when it arrives."""

    id: int
    extended: bool = False
    wait_s: float = Field(gt=0, le=1.0, allow_inf_nan=False)
    """How long a read waits for the answers, at most."""


class SignalOptions(_Part):
    """Some bits of a frame."""

    means: Means
    axis: str = ALL
    start: int = Field(ge=0, lt=512)
    bits: int = Field(ge=1, le=64)
    byte_order: Literal["little", "big"] = "little"
    signed: bool = False
    scale: float = Field(default=1.0, allow_inf_nan=False)
    offset: float = Field(default=0.0, allow_inf_nan=False)
    inverted: bool = False


class FrameOptions(_Part):
    """A frame of the bus."""

    id: int
    extended: bool = False
    direction: Literal["command", "state"]
    length: int
    signals: dict[str, SignalOptions]


class CanOptions(BusOptions):
    """A bus, and what its frames mean; docs/drivers/can.md has complete examples."""

    fd: bool = False
    data_bitrate: int | None = Field(default=None, ge=5000, le=12000000)
    frames: dict[str, FrameOptions] | None = None
    dbc: Path | None = None
    signals: dict[str, DbcSignals] | None = None
    sync: SyncOptions | None = None
    watchdog_s: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    max_age_s: Seconds | None = None
    max_frames_per_read: int = Field(default=64, ge=1, le=10000)
    open_timeout_s: float = Field(default=1.0, gt=0, le=60, allow_inf_nan=False)

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
