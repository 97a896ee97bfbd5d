"""What comes from the device: collected, checked and taken over, as compiled kernels."""

from __future__ import annotations

from enum import IntFlag
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from motorctl.hal import Status
from motorctl_serial.frames import CRC_BYTES, LONGEST_CODED, Bytes, cobs_decode, crc16
from motorctl_serial.protocol import (
    BARE_BYTES,
    CAPABILITIES_BYTES,
    ERROR_BYTES,
    FIRST_DEVICE_TYPE,
    MOST_CHANNELS,
    STATE_CHANNEL_BYTES,
    STATE_HEAD_BYTES,
    STATE_INDEX_BYTES,
    ErrorCode,
    FrameType,
    StateFlag,
)


class News(IntFlag):
    """What a stretch of bytes brought."""

    FRESH = 1 << 0
    """A sample newer than the last, and in mode poll the one that was asked for."""
    REFUSED = 1 << 1
    """Something came that was damaged or does not fit, or the device refused a frame."""
    RESTARTED = 1 << 2
    """The device began anew."""
    CAPABILITIES = 1 << 3
    ERROR = 1 << 4
    ANSWERED = 1 << 5
    """An ERROR in answer to the poll: waiting longer is of no use."""


RECEIVER = np.dtype(
    [
        ("pending", "i8"),  # bytes of the frame that has begun
        ("overlong", "i8"),  # 1: discarding up to the next delimiter
        ("channels", "i8"),  # of the session; 0: there is none, so no STATE fits
        ("counter_bits", "i8"),
        ("boot_id", "i8"),  # of the session; -1: there is none
        ("asked", "i8"),  # the number of the frame to be answered; -1: every sample is welcome
        ("commanded", "i8"),  # stream: the number of the newest command; -1: none
        ("outdated", "i8"),  # stream: the command that was in force for too long; -1: none
        ("sequence", "i8"),  # of the last accepted frame; -1: none yet
        ("refused_sequence", "i8"),  # of the last STATE if a number of it was refused; else -1
        ("refused_sample", "i8"),
        ("sample", "i8"),  # of the last accepted STATE; -1: none yet
        ("watchdog", "i8"),  # 1: the device's watchdog has tripped
        ("unheeded", "i8"),  # STATEs that told of a refused COMMAND, less those that did not
        ("counts", "i8", MOST_CHANNELS),
        ("index", "i8", MOST_CHANNELS),
        ("status", "u4", MOST_CHANNELS),
        ("marked", "i8", MOST_CHANNELS),  # 1: the last STATE told of an index mark
        ("latched", "i8", MOST_CHANNELS),  # 1: a mark that no read has told of yet
        ("coded", "u1", LONGEST_CODED),
        ("body", "u1", LONGEST_CODED),
        ("capabilities", "u1", CAPABILITIES_BYTES),  # the last one's body
        ("error", "u1", ERROR_BYTES),
    ],
    align=True,
)

# Numba takes plain integers for constants.
_FRESH, _REFUSED, _RESTARTED = int(News.FRESH), int(News.REFUSED), int(News.RESTARTED)
_CAPABILITIES, _ERROR, _ANSWERED = int(News.CAPABILITIES), int(News.ERROR), int(News.ANSWERED)
_TYPE_CAPABILITIES, _TYPE_STATE = int(FrameType.CAPABILITIES), int(FrameType.STATE)
_TYPE_ERROR, _TYPE_POLL = int(FrameType.ERROR), int(FrameType.POLL)
_NO_SESSION, _WATCHDOG = int(ErrorCode.NO_SESSION), int(StateFlag.WATCHDOG)
_IN_FORCE, _REFUSED_COMMAND = int(StateFlag.IN_FORCE), int(StateFlag.REFUSED)
MOST_IN_FLIGHT = 4
"""Commands newer than the one under which a stream's sample was taken, at most."""
MOST_UNHEEDED = 3
"""So many more STATEs with a refused COMMAND than without are a box that nobody commands."""
_INDEX_LATCHED = int(Status.INDEX_LATCHED)
_COMMUNICATION_LOST = int(Status.COMMUNICATION_LOST)
_STALE, _CORRUPT = int(Status.STALE), int(Status.CORRUPT)


def make_receiver() -> NDArray[Any]:
    """Return a receiver without a session."""
    receiver = np.zeros(1, RECEIVER)
    forget(receiver)
    return receiver


def forget(receivers: NDArray[Any]) -> None:
    """End the session: nothing is pending, and whatever comes is the first."""
    receivers[:] = 0
    unknown = ("boot_id", "asked", "commanded", "outdated", "sequence", "sample")
    for name in (*unknown, "refused_sequence", "refused_sample"):
        receivers[name] = -1


@njit(cache=True)
def expect(receivers: NDArray[Any], asked: int) -> None:
    """Tell which number the answer is to name; -1: every sample is welcome."""
    receivers[0].asked = asked


@njit(cache=True)
def command_sent(receivers: NDArray[Any], number: int) -> None:
    """Tell the number of the newest command, by which a stream's samples are dated."""
    receivers[0].commanded = number


@njit(cache=True)
def lose_count(receivers: NDArray[Any]) -> None:
    """After bytes were thrown away: whatever number and sample come next are taken.

    What is left of a frame that was cut has a wrong length, so it cannot be taken for one.
    """
    rx = receivers[0]
    rx.pending = 0
    rx.overlong = 0
    rx.sequence = -1
    rx.refused_sequence = -1
    rx.sample = -1


@njit(cache=True)
def take(receivers: NDArray[Any], chunk: Bytes, size: int) -> int:
    """Take `size` bytes from the wire; return the bits of `News`."""
    rx = receivers[0]
    news = 0
    for i in range(size):
        byte = chunk[i]
        if byte == 0:
            if rx.overlong != 0:
                news |= _REFUSED
            elif rx.pending > 0:
                news |= _take_frame(rx)
            rx.pending = 0
            rx.overlong = 0
        elif rx.pending < LONGEST_CODED:
            rx.coded[rx.pending] = byte
            rx.pending += 1
        else:
            rx.overlong = 1
    return news


@njit(cache=True)
def _take_frame(rx: Any) -> int:
    size = cobs_decode(rx.coded, rx.pending, rx.body) - CRC_BYTES
    if size < BARE_BYTES:
        return _REFUSED
    body = rx.body
    if crc16(body, size) != int(body[size]) + 256 * int(body[size + 1]):
        return _REFUSED
    if body[0] < FIRST_DEVICE_TYPE:
        return 0  # what the host sent, echoed by the line
    if body[0] == _TYPE_STATE:
        return _take_state(rx, size)
    if body[0] == _TYPE_CAPABILITIES and size == CAPABILITIES_BYTES:
        rx.sequence = body[1]
        rx.refused_sequence = -1
        rx.capabilities[:] = body[:CAPABILITIES_BYTES]
        boot_id = _signed(body, 12) & 0xFFFFFFFF
        restarted = rx.boot_id >= 0 and boot_id != rx.boot_id
        return _CAPABILITIES | (_RESTARTED if restarted else 0)
    if body[0] == _TYPE_ERROR and size == ERROR_BYTES:
        rx.sequence = body[1]
        rx.refused_sequence = -1
        rx.error[:] = body[:ERROR_BYTES]
        news = _ERROR | _REFUSED
        if body[2] == _NO_SESSION and rx.boot_id >= 0:
            news |= _RESTARTED
        if body[3] == _TYPE_POLL and body[4] == rx.asked:
            news |= _ANSWERED
        return news
    return _REFUSED


@njit(cache=True)
def _take_state(rx: Any, size: int) -> int:
    body, channels = rx.body, rx.channels
    marks_at = STATE_HEAD_BYTES + STATE_CHANNEL_BYTES * channels
    if channels == 0 or size < marks_at:
        return _REFUSED
    marks = 0
    for c in range(channels):
        marks += (body[STATE_HEAD_BYTES + STATE_CHANNEL_BYTES * c] & _INDEX_LATCHED) != 0
    if size != marks_at + STATE_INDEX_BYTES * marks:
        return _REFUSED
    sequence = int(body[1])
    sample = int(body[5]) + 256 * int(body[6])
    # After a silence of half a round the numbers look old: the second of two that follow is taken.
    follows = (
        rx.refused_sequence >= 0
        and sequence == (rx.refused_sequence + 1) & 0xFF
        and 0 < (sample - rx.refused_sample) & 0xFFFF < 32768
    )
    if rx.sequence >= 0 and not follows:
        ahead = (sequence - rx.sequence) & 0xFF
        if ahead == 0:
            return 0
        if ahead >= 128:
            return _refuse(rx, sequence, sample)
    if rx.sample >= 0 and not follows:
        newer = (sample - rx.sample) & 0xFFFF
        if newer >= 32768:
            return _refuse(rx, sequence, sample)
        if newer == 0:
            rx.sequence = sequence
            rx.refused_sequence = -1
            return 0
    rx.sequence = sequence
    rx.refused_sequence = -1
    rx.sample = sample
    rx.watchdog = 1 if body[4] & _WATCHDOG else 0
    news = 0
    if body[4] & _REFUSED_COMMAND:
        news = _REFUSED
        rx.unheeded = min(rx.unheeded + 1, MOST_UNHEEDED)
    else:
        rx.unheeded = max(rx.unheeded - 1, 0)
    fresh = rx.asked < 0 or int(body[2]) == rx.asked
    if rx.commanded >= 0 and body[4] & _IN_FORCE:
        # The command in force tells when a sample was taken, which a stream does not. One that
        # stays in force looks new again when the numbers have come round.
        in_force = int(body[3])
        if (rx.commanded - in_force) & 0xFF > MOST_IN_FLIGHT:
            rx.outdated = in_force
        elif in_force != rx.outdated:
            rx.outdated = -1
        fresh = fresh and rx.outdated < 0
    mark_at = marks_at
    for c in range(channels):
        at = STATE_HEAD_BYTES + STATE_CHANNEL_BYTES * c
        rx.status[c] = body[at] & ~_INDEX_LATCHED & 0xFF
        if body[at] & _INDEX_LATCHED:
            index = _narrowed(_signed(body, mark_at), rx.counter_bits)
            mark_at += STATE_INDEX_BYTES
            # The device repeats each mark, so that a lost frame loses none.
            if rx.marked[c] == 0 or index != rx.index[c]:
                rx.latched[c] = 1
            rx.index[c] = index
            rx.marked[c] = 1
        else:
            rx.marked[c] = 0
        if fresh:
            rx.counts[c] = _narrowed(_signed(body, at + 1), rx.counter_bits)
    return (news | _FRESH) if fresh else news


@njit(cache=True)
def _refuse(rx: Any, sequence: int, sample: int) -> int:
    rx.refused_sequence = sequence
    rx.refused_sample = sample
    return _REFUSED


@njit(cache=True)
def _signed(body: Bytes, at: int) -> int:
    value = 0
    for i in range(4):
        value |= int(body[at + i]) << (8 * i)
    return value - (1 << 32) if value >= 1 << 31 else value


@njit(cache=True)
def _narrowed(value: int, bits: int) -> int:
    """Sign-extend from the counter's width, whatever the bits above it say."""
    half = 1 << (bits - 1)
    return ((value + half) & ((1 << bits) - 1)) - half


@njit(cache=True)
def deliver(
    receivers: NDArray[Any],
    numbers: NDArray[np.int64],
    news: int,
    bits: int,
    counts: NDArray[np.int64],
    index_counts: NDArray[np.int64],
    status: NDArray[np.uint32],
) -> None:
    """Fill one read's arrays with the newest sample.

    Parameters
    ----------
    receivers
        One record of RECEIVER.
    numbers
        The device's channel of each entry, shape (n,).
    news
        Bits of `News` of this read.
    bits
        Bits of `Status` to set on every channel.
    counts, index_counts, status
        Receive the sample [counts, counts, status bits], shape (n,) each.
    """
    rx = receivers[0]
    if news & _FRESH == 0:
        bits |= _STALE
    if news & _REFUSED:
        bits |= _CORRUPT
    if rx.watchdog != 0 or rx.unheeded >= MOST_UNHEEDED:
        bits |= _COMMUNICATION_LOST
    for i in range(numbers.size):
        number = numbers[i]
        counts[i] = rx.counts[number]
        index_counts[i] = rx.index[number]
        word = rx.status[number] | bits
        if rx.latched[number] != 0:
            word |= _INDEX_LATCHED
            rx.latched[number] = 0
        status[i] = word
