"""Which frame carries what: the shapes, and cantools' messages made of them or of a DBC file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import cantools
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from pydantic import Field, model_validator

from motorctl_devices.can_bus import FD_LENGTHS
from motorctl_devices.orders import Settings

COMMANDED = ("volts", "enable", "watchdog")
FLAG_NAMES = (
    "encoder_lost",
    "amplifier_fault",
    "limit_negative",
    "limit_positive",
    "home_switch",
    "index_latched",
    "estop",
)
SHOWN = ("counts", "index_counts", "boot", *FLAG_NAMES)
Meaning = Literal[
    "volts",
    "enable",
    "watchdog",
    "sequence",
    "counts",
    "index_counts",
    "boot",
    "encoder_lost",
    "amplifier_fault",
    "limit_negative",
    "limit_positive",
    "home_switch",
    "index_latched",
    "estop",
]
ALL = "all"
Where = tuple[str | int, ...]


class SignalShape(Settings):
    """One signal of a frame that is written out."""

    means: Meaning
    axis: str = ALL
    start: Annotated[int, Field(ge=0, le=511)]
    bits: Annotated[int, Field(ge=1, le=64)]
    byte_order: Literal["little", "big"] = "little"
    signed: bool = False
    scale: float = 1.0
    offset: float = 0.0
    inverted: bool = False


class FrameShape(Settings):
    """One frame that is written out."""

    id: Annotated[int, Field(ge=0, lt=2**29)]
    extended: bool = False
    direction: Literal["command", "state"]
    length: int
    signals: dict[str, SignalShape] = Field(min_length=1)


class NamedSignal(Settings):
    """A signal of a DBC file."""

    signal: str
    inverted: bool = False


class SyncShape(Settings):
    """The frame that makes the device sample and answer."""

    id: Annotated[int, Field(ge=0, lt=2**29)]
    extended: bool = False


class CanShape(Settings):
    """A device on a CAN bus; frames are written as for the driver."""

    interface: Literal["socketcan", "virtual", "udp_multicast", "slcan"]
    channel: str | None = Field(default=None, description="of slcan: none, the device makes a port")
    bitrate: Annotated[int, Field(gt=0)] = 1_000_000
    fd: bool = False
    data_bitrate: Annotated[int, Field(gt=0)] | None = None
    port: Annotated[int, Field(ge=1, le=65535)] = 43113
    sync: SyncShape | None = None
    frames: dict[str, FrameShape] | None = None
    dbc: Path | None = None
    signals: dict[str, dict[str, str | NamedSignal | list[str]]] | None = None

    @model_validator(mode="after")
    def _one_layout(self) -> Self:
        if (self.frames is None) == (self.dbc is None):
            raise ValueError("give one of frames and dbc")
        if (self.dbc is None) != (self.signals is None):
            raise ValueError("signals belong to dbc")
        if (self.channel is None) != (self.interface == "slcan"):
            raise ValueError(f"{self.interface} takes {'no' if self.channel else 'a'} channel")
        return self


@dataclass(frozen=True)
class Meant:
    """What one signal carries, for one channel or for all."""

    signal: str
    means: str
    channel: int | None
    inverted: bool = False
    bits: int = 1


@dataclass
class FrameLayout:
    """One frame: cantools' message, and what its signals mean."""

    message: Message
    command: bool
    meant: list[Meant] = field(default_factory=list)


class LayoutError(Exception):
    """A layout cannot be; says where."""

    def __init__(self, where: Where, message: str) -> None:
        self.where = where
        super().__init__(message)


def layouts(shape: CanShape, axes: Sequence[str], folder: Path) -> list[FrameLayout]:
    """Return the frames of a device with channels of these names. Raises LayoutError."""
    if shape.frames is not None:
        found = [_written_out(shape, name, frame, axes) for name, frame in shape.frames.items()]
    else:
        found = _from_dbc(shape, axes, folder)
    _check(found, axes, ("frames",) if shape.frames is not None else ("signals",))
    _check_identifiers(shape, found)
    return found


def _written_out(shape: CanShape, name: str, frame: FrameShape, axes: Sequence[str]) -> FrameLayout:
    where: Where = ("frames", name)
    _check_length((*where, "length"), frame.length, shape.fd)
    if frame.id >= 2**11 and not frame.extended:
        raise LayoutError((*where, "id"), f"found {frame.id:#x}, more than 11 bits need extended")
    meant, signals = [], []
    for key, signal in frame.signals.items():
        place = (*where, "signals", key)
        commanded = frame.direction == "command"
        if signal.means != "sequence" and (signal.means in COMMANDED) != commanded:
            raise LayoutError((*place, "means"), f"{signal.means} is of no {frame.direction} frame")
        if signal.axis != ALL and signal.axis not in axes:
            known = ", ".join(axes)
            raise LayoutError((*place, "axis"), f"unknown axis '{signal.axis}'; known: {known}")
        channel = None if signal.axis == ALL else axes.index(signal.axis)
        meant.append(Meant(key, signal.means, channel, signal.inverted, signal.bits))
        order: Any = f"{signal.byte_order}_endian"
        signals.append(
            Signal(
                key,
                signal.start,
                signal.bits,
                order,
                signal.signed,
                conversion=BaseConversion.factory(signal.scale, signal.offset),
            )
        )
    try:
        message = Message(
            frame.id, name, frame.length, signals, is_extended_frame=frame.extended, is_fd=shape.fd
        )
    except Exception as error:  # cantools tells overlaps and signals that do not fit
        raise LayoutError((*where, "signals"), str(error)) from error
    return FrameLayout(message, frame.direction == "command", meant)


def _from_dbc(shape: CanShape, axes: Sequence[str], folder: Path) -> list[FrameLayout]:
    assert shape.dbc is not None
    assert shape.signals is not None
    path = folder / shape.dbc
    try:
        database: Any = cantools.database.load_file(path)
    except OSError as error:
        raise LayoutError(("dbc",), f"{path}: {error.strerror}") from error
    except Exception as error:  # cantools' parser and its dialects fail in many ways
        raise LayoutError(("dbc",), f"{path}: {error}") from error
    found: dict[str, FrameLayout] = {}
    for axis, meanings in shape.signals.items():
        if axis != ALL and axis not in axes:
            known = ", ".join([*axes, ALL])
            raise LayoutError(("signals", axis), f"unknown axis '{axis}'; known: {known}")
        channel = None if axis == ALL else axes.index(axis)
        for means, value in meanings.items():
            where = ("signals", axis, means)
            if means not in (*COMMANDED, *SHOWN, "sequence"):
                raise LayoutError(where, "has no meaning")
            for named in value if isinstance(value, list) else [value]:
                name = named if isinstance(named, str) else named.signal
                inverted = not isinstance(named, str) and named.inverted
                _place(database, found, where, name, Meant("", means, channel, inverted))
    for layout in found.values():
        _check_length(("dbc",), layout.message.length, shape.fd)
        carried = {meant.means for meant in layout.meant}
        layout.command = bool(carried.intersection(COMMANDED))
        if layout.command and carried.intersection(SHOWN):
            message = f"frame {layout.message.name} has meanings of both directions"
            raise LayoutError(("signals",), message)
    return list(found.values())


def _place(
    database: Any, found: dict[str, FrameLayout], where: Where, name: str, meant: Meant
) -> None:
    frame, _, key = name.partition(".")
    try:
        message = database.get_message_by_name(frame)
        signal = message.get_signal_by_name(key)
    except KeyError as error:
        raise LayoutError(where, f"the DBC file has no signal '{name}'") from error
    if signal.is_float or message.is_multiplexed():
        raise LayoutError(where, f"{name} is multiplexed or a floating-point number")
    layout = found.setdefault(frame, FrameLayout(message, False))
    layout.meant.append(Meant(key, meant.means, meant.channel, meant.inverted, signal.length))


def _check_length(where: Where, length: int, fd: bool) -> None:
    if length not in FD_LENGTHS or (length > 8 and not fd):
        raise LayoutError(where, f"found {length}, no frame has that length")


def _check_identifiers(shape: CanShape, found: Sequence[FrameLayout]) -> None:
    """Refuse two frames of one identifier, of which a node could not tell which came."""
    taken: dict[tuple[int, bool], str] = {}
    for layout in found:
        message = layout.message
        identifier = (message.frame_id, message.is_extended_frame)
        if identifier in taken:
            where: Where = ("dbc",) if shape.dbc is not None else ("frames", message.name, "id")
            text = f"frame {message.name} has {message.frame_id:#x}, as {taken[identifier]} has"
            raise LayoutError(where, text)
        taken[identifier] = f"frame {message.name}"
    sync = shape.sync
    if sync is not None and (sync.id, sync.extended) in taken:
        first = taken[sync.id, sync.extended]
        raise LayoutError(("sync", "id"), f"SYNC has {sync.id:#x}, as {first} has")


def _check(found: Sequence[FrameLayout], axes: Sequence[str], where: Where) -> None:
    every = [meant for layout in found for meant in layout.meant]
    for number, axis in enumerate(axes):
        for means in ("volts", "counts", "enable"):
            own = [m for m in every if m.means == means and m.channel in (number, None)]
            if len(own) != 1:
                raise LayoutError(where, f"axis {axis} needs one {means}, found {len(own)}")
            if means != "enable" and own[0].channel is None:
                raise LayoutError(where, f"{own[0].signal}: {means} is of one axis, not of all")
