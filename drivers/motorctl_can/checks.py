"""What can be wrong with a layout, each with the key that is at fault."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from motorctl.hal import LIMIT_SWITCHES, UNTOLD_GUARDS, unseen_limit_switches, untold_guard
from motorctl_can.layout import (
    CLASSIC_LENGTHS,
    COMMAND_MEANINGS,
    FD_LENGTHS,
    INVERTIBLE,
    MAX_STATE_FRAMES,
    OF_AN_AXIS,
    OF_THE_FRAME,
    SCALED,
    STATE_MEANINGS,
    Frame,
    Key,
    Layout,
    Means,
    Signal,
    address,
)

SMALLEST_SEQUENCE_BITS = 4
LARGEST_EXACT_BITS = 53  # of a float
ROUNDING = 1e-9  # of the product of two floats, and more
SAME_MARK = "a mark that is passed twice in a row leaves the count of the mark as it was"


@dataclass(frozen=True)
class Wrong:
    """One thing that is wrong: the path of the option, what stands there, what would be right."""

    key: Key
    found: Any
    message: str


def wrong_in_layout(layout: Layout, fd: bool) -> Iterator[Wrong]:
    """Tell everything that is wrong with frames and signals."""
    for frame in layout.frames:
        yield from _wrong_frame(frame, fd)
        for signal in frame.signals:
            yield from _wrong_signal(signal, frame)
        yield from _overlaps(frame)
    yield from _same_identifiers(layout)
    yield from _given_twice(layout)
    yield from _missing(layout)
    yield from _index_apart(layout)


def wrong_sync(layout: Layout, identifier: int, extended: bool) -> Iterator[Wrong]:
    """Tell what is wrong with the identifier of SYNC."""
    yield from _wrong_identifier(("sync", "id"), identifier, extended)
    for frame in layout.frames:
        if (frame.identifier, frame.extended) == (identifier, extended):
            text = f"is the identifier of frame '{frame.name}' already; SYNC needs its own"
            yield Wrong(("sync", "id"), identifier, text)


def wrong_watchdog(layout: Layout, watchdog_s: float | None) -> Iterator[Wrong]:
    """Tell why the time of the device's watchdog does not reach the device."""
    where = ("watchdog_s",)
    carriers = layout.watchdogs
    if watchdog_s is None:
        if carriers:
            text = "is missing: the layout has a signal that means watchdog"
            yield Wrong(where, None, text)
        return
    if not carriers:
        text = "has no way to the device: no signal of the layout means watchdog"
        yield Wrong(where, watchdog_s, text)
    for signal in carriers:
        if any(_wrong_scale(signal)):
            continue  # told with the signal; what it carries is not known
        low, high = signal.limits
        least = max(low, abs(signal.scale))
        within = least * (1 - ROUNDING) <= watchdog_s <= high * (1 + ROUNDING)
        if not within or signal.raw(watchdog_s) == 0:
            text = f"should be {least:g} to {high:g} s, which its signal can carry; 0 there is off"
            yield Wrong(where, watchdog_s, text)
            return


def missing_from_layout(layout: Layout) -> Iterator[str]:
    """Tell what a layout can do without, and what a machine then does without."""
    if not any(signal.means is Means.WATCHDOG for signal in layout.signals()):
        yield (
            "no command frame has a watchdog: whether the device disables when commands stop, "
            "and when, is its own setting alone"
        )
    without = [f.name for f in layout.states if f.one(Means.SEQUENCE) is None]
    if without:
        yield (
            f"no sequence in {', '.join(without)}: a state frame that comes late or twice cannot "
            "be told from a new one"
        )
    untold = [axis for axis in layout.axes if layout.find(Means.BOOT, axis) is None]
    if untold:
        yield (
            f"no boot for {', '.join(untold)}: a device that starts anew after a short silence is "
            "not noticed, and its counts then begin elsewhere"
        )
    for means, guard in UNTOLD_GUARDS.items():
        untold = [axis for axis in layout.axes if layout.find(Means(means), axis) is None]
        if untold:
            yield untold_guard(means, guard, untold)
    switches = [Means(name) for name in LIMIT_SWITCHES]
    yield from unseen_limit_switches(
        {
            axis: [means for means in switches if layout.find(means, axis) is not None]
            for axis in layout.axes
        }
    )


def _wrong_identifier(key: Key, identifier: int, extended: bool) -> Iterator[Wrong]:
    highest = 0x1FFFFFFF if extended else 0x7FF
    if not 0 <= identifier <= highest:
        hint = "" if extended or identifier < 0 else "; 29 bits need extended: true"
        text = f"should be 0 to {highest:#x}, the highest of {29 if extended else 11} bits{hint}"
        yield Wrong(key, identifier, text)


def _wrong_frame(frame: Frame, fd: bool) -> Iterator[Wrong]:
    yield from _wrong_identifier((*frame.key, "id"), frame.identifier, frame.extended)
    where = (*frame.key, "length")
    if frame.length not in FD_LENGTHS:
        text = "is no length of a frame: 0 to 8, and with fd 12, 16, 20, 24, 32, 48, 64"
        yield Wrong(where, frame.length, text)
    elif frame.length not in CLASSIC_LENGTHS and not fd:
        text = "is more than a classic frame's 8 bytes; it needs fd: true"
        yield Wrong(where, frame.length, text)
    if not frame.signals:
        yield Wrong((*frame.key, "signals"), {}, "should name at least one signal")


def _wrong_signal(signal: Signal, frame: Frame) -> Iterator[Wrong]:
    means, place, key = signal.means, signal.place, signal.key
    allowed = COMMAND_MEANINGS if frame.command else STATE_MEANINGS
    if means not in allowed:
        kind = "command" if frame.command else "state"
        words = ", ".join(sorted(allowed))
        yield Wrong((*key, "means"), str(means), f"is not for a {kind} frame, which has: {words}")
    if means in OF_AN_AXIS and signal.axis is None:
        yield Wrong((*key, "axis"), "all", f"should name one axis, whose {means} it is")
    if means in OF_THE_FRAME and signal.axis is not None:
        yield Wrong((*key, "axis"), signal.axis, f"should be absent: {means} is of all axes")
    positions = list(place.positions())
    beyond = [byte for byte, _ in positions if not 0 <= byte < frame.length]
    if beyond:
        worst = max(beyond, key=lambda byte: abs(byte - frame.length / 2))
        text = (
            f"with {place.bits} bits goes to byte {worst}, but frame '{frame.name}' has only "
            f"bytes 0 to {frame.length - 1}"
        )
        yield Wrong((*key, "start"), place.start, text)
    if not frame.command and means is Means.SEQUENCE and place.bits < SMALLEST_SEQUENCE_BITS:
        text = f"should be at least {SMALLEST_SEQUENCE_BITS}: fewer cannot tell lost from late"
        yield Wrong((*key, "bits"), place.bits, text)
    if signal.inverted and means not in INVERTIBLE:
        yield Wrong((*key, "inverted"), True, f"is for flags and enable, not for {means}")
    if means in SCALED:
        yield from _wrong_scale(signal)
    elif (signal.scale, signal.offset) != (1.0, 0.0):
        text = f"is for volts and watchdog; {means} is taken raw"
        yield Wrong((*key, "scale"), signal.scale, text)


def _wrong_scale(signal: Signal) -> Iterator[Wrong]:
    key, place = signal.key, signal.place
    if signal.scale == 0 or not (math.isfinite(signal.scale) and math.isfinite(signal.offset)):
        yield Wrong((*key, "scale"), signal.scale, "should be a number other than 0")
        return
    if place.bits > LARGEST_EXACT_BITS:
        yield Wrong((*key, "bits"), place.bits, f"should be at most {LARGEST_EXACT_BITS}")
        return
    if signal.raw_limits[0] > signal.raw_limits[1]:
        text = f"leaves no value between {signal.minimum} and {signal.maximum}"
        yield Wrong((*key, "scale"), signal.scale, text)
        return
    low, high = signal.limits
    if signal.means is Means.VOLTS and not low <= 0.0 <= high:
        text = f"cannot represent 0 V: the signal goes from {low:g} to {high:g} V"
        yield Wrong((*key, "offset"), signal.offset, text)


def _overlaps(frame: Frame) -> Iterator[Wrong]:
    taken: dict[tuple[int, int], Signal] = {}
    for signal in frame.signals:
        positions = list(signal.place.positions())
        first = next((taken[p] for p in positions if p in taken), None)
        if first is not None:
            text = f"overlaps '{_name(first)}' in frame '{frame.name}'"
            yield Wrong((*signal.key, "start"), signal.place.start, text)
        taken.update(dict.fromkeys(positions, signal))


def _same_identifiers(layout: Layout) -> Iterator[Wrong]:
    taken: dict[tuple[int, bool], Frame] = {}
    for frame in layout.frames:
        first = taken.setdefault((frame.identifier, frame.extended), frame)
        if first is not frame:
            text = f"({address(frame.identifier, frame.extended)}) is that of '{first.name}'"
            yield Wrong((*frame.key, "id"), frame.identifier, f"{text} already")


def _given_twice(layout: Layout) -> Iterator[Wrong]:
    taken: dict[tuple[Means, str | None, str], Signal] = {}
    for frame in layout.frames:
        for signal in frame.signals:
            means, axis = signal.means, signal.axis
            # a frame has its own sequence and watchdog, an axis everything else
            place = frame.name if means in OF_THE_FRAME else ""
            keys = [(means, a, place) for a in ((axis,) if axis else (None, *layout.axes))]
            first = next((taken[k] for k in keys if k in taken), None)
            if first is None and axis is not None:
                first = taken.get((means, None, place))
            if first is not None:
                whose = f"axis '{axis}'" if axis else "all axes"
                whose = f"frame '{place}'" if place else whose
                text = f"is given twice for {whose}: '{_name(first)}' is it already"
                yield Wrong((*signal.key, "means"), str(means), text)
            for key in keys:
                taken.setdefault(key, signal)


def _missing(layout: Layout) -> Iterator[Wrong]:
    from_dbc = any(frame.key[0] == "dbc" for frame in layout.frames)
    where: Key = ("signals" if from_dbc else "frames",)
    if not layout.axes:
        yield Wrong(where, "no axis", "should carry volts, enable and counts of an axis")
    for axis in layout.axes:
        for means in (Means.VOLTS, Means.ENABLE, Means.COUNTS):
            if layout.find(means, axis) is None:
                text = (
                    f"axis '{axis}' has no {means}; every axis needs volts, enable and counts "
                    f"(the layout names: {', '.join(layout.axes)})"
                )
                yield Wrong(where, axis, text)
    states = layout.states
    if len(states) > MAX_STATE_FRAMES:
        text = f"should have at most {MAX_STATE_FRAMES} state frames"
        yield Wrong(where, len(states), text)


def _index_apart(layout: Layout) -> Iterator[Wrong]:
    for axis in layout.axes:
        counts, index = (layout.find(m, axis) for m in (Means.COUNTS, Means.INDEX_COUNTS))
        latched = layout.find(Means.INDEX_LATCHED, axis)
        if index is None:
            if latched is not None:
                text = f"needs index_counts of axis '{axis}', which says where the mark is"
                yield Wrong((*latched.key, "means"), str(latched.means), text)
            continue
        if latched is None:
            text = f"needs index_latched of axis '{axis}': {SAME_MARK}"
            yield Wrong((*index.key, "means"), str(index.means), text)
        if counts is not None and index.place.bits != counts.place.bits:
            text = f"should be {counts.place.bits}, as wide as the counts of axis '{axis}'"
            yield Wrong((*index.key, "bits"), index.place.bits, text)
        if latched is not None and layout.frame_of(latched) is not layout.frame_of(index):
            text = f"should be in one frame with the index_counts of axis '{axis}'"
            yield Wrong((*latched.key, "means"), str(latched.means), text)


def _name(signal: Signal) -> str:
    return ".".join(str(part) for part in signal.key if part not in ("frames", "signals"))
