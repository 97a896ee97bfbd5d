"""The compiled codec: bytes of a state frame to counts and status, volts to a command frame."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from motorctl.hal import Status
from motorctl_can.codec_records import Kind, Records

RESYNCHRONISE = 3
"""So many frames behind the last number, each following the one before, are right"""
AFTER_GOOD = 16
"""if they are at most so far ahead of the number before the last, and further behind the last: what
is nearer may be old, and a wrong number so near is soon passed anyway."""
ACCEPTED, DUPLICATE, BACKWARDS, LATE = 0, 1, 2, 3
BEFORE_SYNC, AFTER_SYNC, FREE = 0, 1, 2

FLAG, COUNTS, INDEX_COUNTS, INDEX_LATCHED, BOOT, VOLTS, ENABLE, WATCHDOG = (int(k) for k in Kind)
STALE, CORRUPT = int(Status.STALE), int(Status.CORRUPT)
EVENT = int(Status.INDEX_LATCHED)
RESTARTED = int(Status.DEVICE_RESTARTED | Status.ENCODER_LOST)
ALL_ONES = np.uint64(0xFFFFFFFFFFFFFFFF)

Bytes = NDArray[np.uint8]


@numba.njit(cache=True)
def get_raw(signal: Any, row: Bytes) -> int:
    """Take a signal's bits out of a frame, as a whole number with or without sign."""
    shift = signal.shift
    value = np.uint64(0)
    for i in range(min(signal.span, 8)):
        value |= np.uint64(row[signal.first + signal.step * i]) << np.uint64(8 * i)
    value >>= np.uint64(shift)
    if signal.span == 9:
        top = np.uint64(row[signal.first + signal.step * 8])
        value |= top << np.uint64(64 - shift)
    bits = signal.bits
    if bits < 64:
        mask = (np.uint64(1) << np.uint64(bits)) - np.uint64(1)
        value &= mask
        if signal.signed and value >> np.uint64(bits - 1):
            value |= ALL_ONES ^ mask
    signed: int = np.int64(value)  # type: ignore[assignment]  # numba's int
    return signed


@numba.njit(cache=True)
def put_raw(signal: Any, row: Bytes, raw: int) -> None:
    """Write a signal's bits into a frame in which they are 0."""
    bits, shift = signal.bits, signal.shift
    value = np.uint64(raw)
    if bits < 64:
        value &= (np.uint64(1) << np.uint64(bits)) - np.uint64(1)
    low = value << np.uint64(shift)
    for i in range(min(signal.span, 8)):
        row[signal.first + signal.step * i] |= np.uint8((low >> np.uint64(8 * i)) & np.uint64(255))
    if signal.span == 9:
        row[signal.first + signal.step * 8] |= np.uint8(value >> np.uint64(64 - shift))


@numba.njit(cache=True)
def take(
    signals: Records, frames: Records, channels: Records, number: int, row: Bytes, phase: int
) -> int:
    """Decode a state frame of the right length, or refuse it for its sequence.

    Parameters
    ----------
    signals, frames, channels
        Records of SIGNAL, FRAME and CHANNEL of the state frames.
    number
        Index of the frame in `frames`.
    row
        Its bytes.
    phase
        Whether SYNC was sent before.

    Returns
    -------
    int
        ACCEPTED, DUPLICATE, BACKWARDS, or LATE: it answers an earlier SYNC, or may after a long
        silence, so its count is not of this period.
    """
    frame = frames[number]
    step = 1
    doubtful = False
    if _restarted(signals, frame, channels, row):
        frame.known = 0  # its counter began anew
    if frame.silent >= frame.patience:
        # Nothing for so long that the counter says nothing: it may have restarted meanwhile.
        frame.silent = 0
        frame.known = 0
        # Nor does it say which of the SYNCs is answered that were sent in that time.
        doubtful = phase == AFTER_SYNC and frame.owed > 1
        for channel in channels:
            if channel.needs >> number & 1 and not channel.boots:
                channel.latched |= RESTARTED
    if frame.sequence >= 0:
        sequence = get_raw(signals[frame.sequence], row) & frame.mask
        if frame.known:
            step = (sequence - frame.last) & frame.mask
            if step == 0:
                return DUPLICATE
            if step >= frame.half:
                follows = frame.behind > 0 and sequence == (frame.last_behind + 1) & frame.mask
                frame.behind = frame.behind + 1 if follows else 1
                frame.last_behind = sequence
                # A device that began anew is behind the last good number, too.
                near = min(AFTER_GOOD, frame.half - 1)
                after_good = (sequence - frame.before) & frame.mask
                follows_good = 1 <= after_good <= near
                far_behind = (frame.last - sequence) & frame.mask > near
                if frame.behind < RESYNCHRONISE or not (follows_good and far_behind):
                    frame.refused = 1
                    frame.answered += 1
                    return BACKWARDS
                # The number that was ahead of these was wrong; the last right one was refused.
                # Those refused have answered, too.
                frame.last = (sequence - 1) & frame.mask
                frame.owed = max(0, frame.owed - frame.answered)
                step = 1
        frame.behind, frame.answered = 0, 0
        frame.before = frame.last if frame.known else sequence
        frame.last = sequence
    late = doubtful or phase == BEFORE_SYNC
    if phase == AFTER_SYNC and frame.known and frame.sequence >= 0:
        late = step < frame.owed
    if late:
        frame.owed = max(0, frame.owed - step)
    else:
        frame.owed = 0
    frame.known = 1
    frame.arrived = 1
    for s in range(frame.begin, frame.end):
        if s != frame.sequence:
            _take_signal(signals[s], channels, row)
    if late:
        return LATE
    for channel in channels:
        channel.news |= channel.needs & 1 << number
    return ACCEPTED


@numba.njit(cache=True)
def _restarted(signals: Records, frame: Any, channels: Records, row: Bytes) -> bool:
    found = False
    for s in range(frame.begin, frame.end):
        signal = signals[s]
        if s == frame.sequence or signal.kind != BOOT:
            continue
        raw = get_raw(signal, row)
        if signal.known and raw != signal.seen:
            found = True
            for c in range(len(channels)):
                if signal.channel in (-1, c):
                    channels[c].latched |= RESTARTED
        signal.seen, signal.known = raw, 1
    return found


@numba.njit(cache=True)
def _take_signal(signal: Any, channels: Records, row: Bytes) -> None:
    raw = get_raw(signal, row)
    yes = (raw != 0) != (signal.inverted != 0)
    begin, end = signal.channel, signal.channel + 1
    if signal.channel < 0:
        begin, end = 0, len(channels)
    for c in range(begin, end):
        channel = channels[c]
        if signal.kind == FLAG:
            channel.flags &= ~signal.status
            if yes:
                channel.flags |= signal.status
        elif signal.kind == COUNTS:
            channel.count = raw
        elif signal.kind == INDEX_COUNTS:
            if channel.marked and raw != channel.index:
                channel.event = 1
            channel.index, channel.marked = raw, 1
        elif signal.kind == INDEX_LATCHED and yes:
            channel.event = 1


@numba.njit(cache=True)
def refuse(frames: Records, number: int) -> None:
    """Note that a frame with this identifier came and cannot be used."""
    frames[number].refused = 1


@numba.njit(cache=True)
def sync_sent(frames: Records, channels: Records) -> None:
    """Expect an answer in every state frame; frames received before are of an earlier period."""
    for frame in frames:
        frame.owed += 1
    for channel in channels:
        channel.news = 0


@numba.njit(cache=True)
def settle(frames: Records) -> None:
    """Expect no more answers: a period has passed in which none was asked for."""
    for frame in frames:
        frame.owed = 0


@numba.njit(cache=True)
def deliver(
    frames: Records,
    channels: Records,
    common: int,
    counts: NDArray[np.int64],
    index_counts: NDArray[np.int64],
    status: NDArray[np.uint32],
) -> None:
    """End a read: write each channel's newest whole sample, and flag what is missing.

    Parameters
    ----------
    frames, channels
        Records of FRAME and CHANNEL of the state frames.
    common
        Status bits of all channels.
    counts, index_counts, status
        Receive the sample [counts, counts, status bits], shape (channels,) each.
    """
    refused = 0
    for f in range(len(frames)):
        frame = frames[f]
        if frame.refused:
            refused |= 1 << f
        if frame.arrived:
            frame.silent = 0
        elif frame.silent < frame.patience:
            frame.silent += 1
        frame.refused = 0
        frame.arrived = 0
    for c in range(len(counts)):
        channel = channels[c]
        word = common | channel.flags | channel.latched
        if channel.news & channel.needs == channel.needs:
            channel.news = 0
            channel.shown = channel.count
        else:
            word |= STALE
        if refused & channel.needs:
            word |= CORRUPT
        if channel.event:
            word |= EVENT
            channel.event = 0
        counts[c] = channel.shown
        index_counts[c] = channel.index
        status[c] = word


@numba.njit(cache=True)
def encode(
    signals: Records,
    frames: Records,
    number: int,
    volts: NDArray[np.float64],
    enable: NDArray[np.uint8],
    row: Bytes,
) -> None:
    """Write a command frame: clamped, never wrapped, and with the next sequence.

    Parameters
    ----------
    signals, frames
        Records of SIGNAL and FRAME of the command frames.
    number
        Index of the frame in `frames`.
    volts, enable
        Command of each channel [V], and whether it is enabled; shape (channels,).
    row
        Receives the frame's bytes.
    """
    frame = frames[number]
    row[:] = 0
    for s in range(frame.begin, frame.end):
        signal = signals[s]
        if s == frame.sequence:
            put_raw(signal, row, frame.last)
        elif signal.kind == WATCHDOG:
            put_raw(signal, row, signal.fixed)
        elif signal.kind == VOLTS:
            value = volts[signal.channel]
            if not enable[signal.channel] or np.isnan(value):
                value = 0.0
            raw = np.rint((value - signal.offset) / signal.scale)
            put_raw(signal, row, int(min(max(raw, signal.low), signal.high)))
        elif signal.kind == ENABLE:
            begin, end = signal.channel, signal.channel + 1
            if signal.channel < 0:
                begin, end = 0, len(volts)
            on = True
            for c in range(begin, end):
                if not enable[c] or np.isnan(volts[c]):
                    on = False
            if on != (signal.inverted != 0):
                put_raw(signal, row, 1)
    frame.last = (frame.last + 1) & frame.mask
