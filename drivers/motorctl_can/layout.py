"""What a bus carries: frames, their signals, and where each bit lies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

Key = tuple[str | int, ...]
"""Path of an option, as in ``("frames", "command", "length")``."""

CLASSIC_LENGTHS = tuple(range(9))
FD_LENGTHS = (*CLASSIC_LENGTHS, 12, 16, 20, 24, 32, 48, 64)
MAX_STATE_FRAMES = 62  # a channel's frames are bits of one int64


class Means(StrEnum):
    """What a signal is."""

    VOLTS = "volts"
    ENABLE = "enable"
    WATCHDOG = "watchdog"
    SEQUENCE = "sequence"
    COUNTS = "counts"
    INDEX_COUNTS = "index_counts"
    INDEX_LATCHED = "index_latched"
    BOOT = "boot"
    ENCODER_LOST = "encoder_lost"
    AMPLIFIER_FAULT = "amplifier_fault"
    LIMIT_NEGATIVE = "limit_negative"
    LIMIT_POSITIVE = "limit_positive"
    HOME_SWITCH = "home_switch"
    ESTOP = "estop"


FLAGS = frozenset(
    {
        Means.ENCODER_LOST,
        Means.AMPLIFIER_FAULT,
        Means.LIMIT_NEGATIVE,
        Means.LIMIT_POSITIVE,
        Means.HOME_SWITCH,
        Means.ESTOP,
    }
)
COMMAND_MEANINGS = frozenset({Means.VOLTS, Means.ENABLE, Means.WATCHDOG, Means.SEQUENCE})
STATE_MEANINGS = (
    frozenset({Means.COUNTS, Means.INDEX_COUNTS, Means.INDEX_LATCHED, Means.BOOT, Means.SEQUENCE})
    | FLAGS
)
OF_AN_AXIS = frozenset({Means.VOLTS, Means.COUNTS, Means.INDEX_COUNTS, Means.INDEX_LATCHED})
OF_THE_FRAME = frozenset({Means.SEQUENCE, Means.WATCHDOG})
SCALED = frozenset({Means.VOLTS, Means.WATCHDOG})
INVERTIBLE = FLAGS | {Means.ENABLE, Means.INDEX_LATCHED}


@dataclass(frozen=True)
class Place:
    """Where a signal's bits lie. Both byte orders come down to steps from its lowest byte."""

    start: int
    bits: int
    big: bool

    @property
    def step(self) -> int:
        """Return 1 where the next higher bits are in the next byte, -1 where in the one before."""
        return -1 if self.big else 1

    @property
    def lowest(self) -> tuple[int, int]:
        """Return byte and bit of the lowest bit; the byte may lie beyond the frame."""
        if not self.big:
            return divmod(self.start, 8)
        last = self.start // 8 * 8 + (7 - self.start % 8) + self.bits - 1
        return last // 8, 7 - last % 8

    @property
    def span(self) -> int:
        """Return the number of bytes that the signal touches."""
        return (self.lowest[1] + self.bits + 7) // 8

    def positions(self) -> Iterator[tuple[int, int]]:
        """Yield (byte, bit) of every bit, from the lowest."""
        byte, bit = self.lowest
        for i in range(bit, bit + self.bits):
            yield byte + self.step * (i // 8), i % 8


@dataclass(frozen=True)
class Signal:
    """Some bits of a frame, and what they mean."""

    key: Key
    means: Means
    axis: str | None
    """None: every axis, or the frame itself."""
    place: Place
    signed: bool = False
    scale: float = 1.0
    offset: float = 0.0
    inverted: bool = False
    minimum: float | None = None
    maximum: float | None = None
    """Limits of the value that the description of the layout gives besides those of the bits."""

    def raw(self, value: float) -> int:
        """Return the raw number nearest to a value."""
        return round((value - self.offset) / self.scale)

    def value(self, raw: int) -> float:
        """Return the value that a raw number stands for."""
        return raw * self.scale + self.offset

    @property
    def raw_limits(self) -> tuple[int, int]:
        """Return the lowest and the highest raw number that may be sent."""
        bits = self.place.bits
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if self.signed else (0, (1 << bits) - 1)
        for bound, is_low in ((self.minimum, True), (self.maximum, False)):
            if bound is None:
                continue
            raw = self.raw(bound)
            if is_low == (self.scale > 0):
                low = max(low, raw)
            else:
                high = min(high, raw)
        return low, high

    @property
    def limits(self) -> tuple[float, float]:
        """Return the lowest and the highest value that may be sent."""
        ends = [self.value(raw) for raw in self.raw_limits]
        return min(ends), max(ends)


@dataclass(frozen=True)
class Frame:
    """A frame of the bus. `command`: from motorctl to the device, else the other way."""

    key: Key
    name: str
    identifier: int
    extended: bool
    command: bool
    length: int
    signals: tuple[Signal, ...]

    @property
    def address(self) -> str:
        """Return the identifier as people write it."""
        return address(self.identifier, self.extended)

    def one(self, means: Means) -> Signal | None:
        """Return the frame's first signal of a meaning; None where it has none."""
        return next((s for s in self.signals if s.means is means), None)


@dataclass(frozen=True)
class Layout:
    """All frames that motorctl sends and reads, in their order."""

    frames: tuple[Frame, ...]

    @property
    def commands(self) -> tuple[Frame, ...]:
        """Return the frames that motorctl sends."""
        return tuple(f for f in self.frames if f.command)

    @property
    def states(self) -> tuple[Frame, ...]:
        """Return the frames that the device sends."""
        return tuple(f for f in self.frames if not f.command)

    @property
    def axes(self) -> tuple[str, ...]:
        """Return the axes that are named, in the order of their first signals."""
        return tuple(dict.fromkeys(s.axis for s in self.signals() if s.axis is not None))

    @property
    def watchdogs(self) -> tuple[Signal, ...]:
        """Return the signals that set the device's watchdog time."""
        return tuple(s for s in self.signals() if s.means is Means.WATCHDOG)

    def signals(self) -> Iterator[Signal]:
        """Yield every signal of every frame."""
        for frame in self.frames:
            yield from frame.signals

    def find(self, means: Means, axis: str) -> Signal | None:
        """Return the signal of a meaning for an axis: its own, or the one for all axes."""
        return next(
            (s for s in self.signals() if s.means is means and s.axis in (axis, None)), None
        )

    def frame_of(self, signal: Signal) -> Frame:
        """Return the frame that carries a signal."""
        return next(f for f in self.frames if signal in f.signals)


def address(identifier: int, extended: bool) -> str:
    """Write an identifier as people do: 3 digits for 11 bits, 8 for 29."""
    return f"0x{identifier:08X}" if extended else f"0x{identifier:03X}"
