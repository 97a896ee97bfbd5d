"""What the compiled codec works on: records with named fields, made once."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import Channel, Status
from motorctl_can.layout import FLAGS, Frame, Layout, Means, Signal

# After this many periods of silence a device may have restarted; fewer where its sequence counter
# has gone half around by then.
SILENCE_PERIODS = 128

Records = NDArray[Any]


class Kind(IntEnum):
    """What the codec does with a signal."""

    FLAG = 0
    COUNTS = 1
    INDEX_COUNTS = 2
    INDEX_LATCHED = 3
    BOOT = 4
    VOLTS = 5
    ENABLE = 6
    WATCHDOG = 7


SIGNAL = np.dtype(
    [
        ("kind", "i8"),  # Kind
        ("channel", "i8"),  # -1: all
        ("first", "i8"),  # byte of the lowest bit
        ("step", "i8"),  # to the byte of the next higher bits
        ("shift", "i8"),
        ("span", "i8"),  # bytes
        ("bits", "i8"),
        ("signed", "u1"),
        ("inverted", "u1"),
        ("scale", "f8"),
        ("offset", "f8"),
        ("low", "f8"),  # raw limits
        ("high", "f8"),
        ("fixed", "i8"),  # what a watchdog says
        ("status", "i8"),  # what a flag means
        ("seen", "i8"),  # last boot
        ("known", "u1"),  # whether there was one
    ],
    align=True,
)

FRAME = np.dtype(
    [
        ("begin", "i8"),  # its signals in the table
        ("end", "i8"),
        ("length", "i8"),
        ("sequence", "i8"),  # signal in the table; -1: none
        ("mask", "i8"),  # of the sequence
        ("half", "i8"),  # from here on a step is one backwards
        ("last", "i8"),  # last sequence accepted, or sent
        ("known", "u1"),  # whether there was one
        ("before", "i8"),  # the one accepted before it
        ("behind", "i8"),  # frames in a row whose sequence was behind, in their order
        ("last_behind", "i8"),  # the last one's
        ("answered", "i8"),  # frames refused for their sequence since one was accepted
        ("owed", "i8"),  # answers to SYNC that have not come
        ("silent", "i8"),  # reads without news
        ("patience", "i8"),  # after so many of them it may have restarted
        ("arrived", "u1"),  # since the last read
        ("refused", "u1"),
    ],
    align=True,
)

CHANNEL = np.dtype(
    [
        ("needs", "i8"),  # state frames of which one sample consists, a bit each
        ("news", "i8"),  # those that have come
        ("flags", "i8"),  # as the newest frames say
        ("latched", "i8"),  # until opened again
        ("event", "u1"),  # an index mark was passed
        ("boots", "u1"),  # the layout would tell of a restart
        ("marked", "u1"),  # there was an index count
        ("count", "i8"),  # newest
        ("shown", "i8"),  # of the last whole sample
        ("index", "i8"),
    ],
    align=True,
)

FLAG_STATUS = {
    Means.ENCODER_LOST: Status.ENCODER_LOST,
    Means.AMPLIFIER_FAULT: Status.AMPLIFIER_FAULT,
    Means.LIMIT_NEGATIVE: Status.LIMIT_NEGATIVE,
    Means.LIMIT_POSITIVE: Status.LIMIT_POSITIVE,
    Means.HOME_SWITCH: Status.HOME_SWITCH,
    Means.ESTOP: Status.ESTOP,
}


def signals_of(frames: Sequence[Frame], channels: Sequence[Channel], watchdog_s: float) -> Records:
    """Make the table of all signals of some frames, in their order."""
    order = {channel.axis: i for i, channel in enumerate(channels)}
    all_signals = [signal for frame in frames for signal in frame.signals]
    table = np.zeros(max(1, len(all_signals)), SIGNAL)
    for row, signal in zip(table, all_signals, strict=False):
        _fill_signal(row, signal, order, watchdog_s)
    return table


def _fill_signal(row: Any, signal: Signal, order: dict[str, int], watchdog_s: float) -> None:
    place = signal.place
    if signal.means in FLAGS:
        row["kind"], row["status"] = Kind.FLAG, int(FLAG_STATUS[signal.means])
    elif signal.means is not Means.SEQUENCE:
        row["kind"] = Kind[signal.means.name]
    row["channel"] = -1 if signal.axis is None else order[signal.axis]
    row["first"], row["shift"] = place.lowest
    row["step"], row["span"], row["bits"] = place.step, place.span, place.bits
    row["signed"], row["inverted"] = signal.signed, signal.inverted
    row["scale"], row["offset"] = signal.scale, signal.offset
    low, high = signal.raw_limits
    row["low"], row["high"] = low, high
    if signal.means is Means.WATCHDOG:
        row["fixed"] = signal.raw(watchdog_s)


def frames_of(frames: Sequence[Frame]) -> Records:
    """Make the table of some frames, whose signals stand in `signals_of` the same frames."""
    table = np.zeros(max(1, len(frames)), FRAME)
    begin = 0
    for row, frame in zip(table, frames, strict=False):
        row["begin"], row["end"] = begin, begin + len(frame.signals)
        row["length"] = frame.length
        row["sequence"], row["patience"] = -1, SILENCE_PERIODS
        for i, signal in enumerate(frame.signals):
            if signal.means is Means.SEQUENCE:
                bits = min(signal.place.bits, 62)
                row["sequence"], row["mask"] = begin + i, (1 << bits) - 1
                row["half"] = max(1, 1 << bits - 1)
                row["patience"] = min(row["half"], SILENCE_PERIODS)
        begin += len(frame.signals)
    return table


def channels_of(layout: Layout, channels: Sequence[Channel]) -> Records:
    """Make the table of the channels, each with the state frames that carry its signals."""
    table = np.zeros(max(1, len(channels)), CHANNEL)
    for row, channel in zip(table, channels, strict=False):
        for i, frame in enumerate(layout.states):
            mine = [
                s
                for s in frame.signals
                if s.axis in (channel.axis, None) and s.means is not Means.SEQUENCE
            ]
            if mine:
                row["needs"] |= 1 << i
            if any(s.means is Means.BOOT for s in mine):
                row["boots"] = 1
    return table
