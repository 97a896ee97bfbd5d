"""Where a layout does not fit the axes and the period of the machine, each with the key."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from motorctl.hal import Channel, Status
from motorctl_can import budget
from motorctl_can.checks import ROUNDING
from motorctl_can.layout import Key, Layout, Means, Signal
from motorctl_can.options import ALL, CanOptions

Problem = tuple[Key, str]

WATCHDOG_PERIODS = 2
LEAST_STEPS = 50
"""So many steps of its signal has an axis' voltage limit at least."""
MOST_ZERO = 1e-4
"""The part of its voltage limit that may be sent to an axis for 0 V: it is what disables."""


def problems(
    options: CanOptions, channels: Sequence[Channel], period_s: float
) -> Iterator[Problem]:
    """Tell everything that does not fit together."""
    axes = [channel.axis for channel in channels]
    if ALL in axes:
        yield (_layout_key(options),), "an axis on CAN cannot be named 'all'"
    for axis in options.layout.axes:
        if axis not in axes:
            key = next(s.key for s in options.layout.signals() if s.axis == axis)
            key = (*key, "axis") if options.frames is not None else ("signals", axis)
            yield key, f"names axis '{axis}', but this driver serves: {', '.join(axes)}"
    for channel in channels:
        yield from _misfits(options, channel)
    yield from _impatient(options)
    yield from _too_few_frames(options)
    yield from _hasty(options, period_s)


def switches(layout: Layout, channels: Sequence[Channel]) -> list[Status]:
    """Return which switches and marks the layout carries, an entry a channel."""
    means = (Means.HOME_SWITCH, Means.INDEX_LATCHED, Means.LIMIT_NEGATIVE, Means.LIMIT_POSITIVE)
    found = []
    for channel in channels:
        told = Status(0)
        for flag in means:
            if layout.find(flag, channel.axis) is not None:
                told |= Status[flag.name]
        found.append(told)
    return found


def sampled_apart_s(options: CanOptions, channels: Sequence[Channel], period_s: float) -> float:
    """Return how far apart two axes' samples may lie [s]: frames come as their senders like.

    Two frames of one device and one moment, too: a read that falls between them brings the new
    sample of one axis, and the next one the old sample of the other beside a newer one.
    """
    layout = options.layout
    counts = [layout.find(Means.COUNTS, channel.axis) for channel in channels]
    frames = {layout.frame_of(signal).key for signal in counts if signal is not None}
    return 0.0 if options.sync is not None or len(frames) <= 1 else period_s


def _layout_key(options: CanOptions) -> str:
    return "frames" if options.frames is not None else "signals"


def _entry(options: CanOptions, signal: Signal, name: str) -> Key:
    """Return the key of a signal's entry, which stands in the DBC file where there is one."""
    return (*signal.key, name) if options.frames is not None else signal.key


def _misfits(options: CanOptions, channel: Channel) -> Iterator[Problem]:
    axis = channel.axis
    volts = options.layout.find(Means.VOLTS, axis)
    counts = options.layout.find(Means.COUNTS, axis)
    if volts is None or counts is None:
        yield (_layout_key(options),), f"has no volts and counts for axis '{axis}'"
        return
    if counts.place.bits != channel.counter_bits:
        text = (
            f"found {counts.place.bits} bits of counts, but axis '{axis}' has "
            f"encoder.counter_bits {channel.counter_bits}: the two must be equal"
        )
        yield _entry(options, counts, "bits"), text
    low, high = volts.limits
    step, limit = abs(volts.scale), channel.max_voltage_v
    coarsest = limit / LEAST_STEPS
    whose = f"axis '{axis}' has limits.max_voltage_v {limit:g}"
    if step > coarsest * (1 + ROUNDING):
        text = (
            f"found steps of {step:g} V, but {whose}: a step may be {coarsest:g} V at most, "
            f"1/{LEAST_STEPS} of it"
        )
        yield _entry(options, volts, "scale"), text
    zero_v = volts.value(volts.raw(0.0))
    if abs(zero_v) > limit * MOST_ZERO:
        text = f"0 V would be sent as {zero_v:g} V, limit {limit * MOST_ZERO:g} V"
        yield _entry(options, volts, "offset"), text
    # two's complement reaches a step less far up than down
    if limit > min(-low, high) + step * (1 + ROUNDING):
        yield _entry(options, volts, "bits"), f"carries {low:g} to {high:g} V, but {whose}"


def _impatient(options: CanOptions) -> Iterator[Problem]:
    sync = options.sync
    if sync is None or options.interface in budget.HOST_COST_S:
        return
    least_s = budget.answer_s(budget.traffic(options, options.layout))
    if sync.wait_s < least_s:
        text = (
            f"found {sync.wait_s * 1e6:g} us, but SYNC and its answers take up to "
            f"{least_s * 1e6:.1f} us on the bus alone"
        )
        yield ("sync", "wait_s"), text


def _too_few_frames(options: CanOptions) -> Iterator[Problem]:
    # As many as that waiting are taken for a backlog.
    least = len(options.layout.states) + 1
    if options.max_frames_per_read < least:
        text = (
            f"found {options.max_frames_per_read}, must be at least {least}, one more than states"
        )
        yield ("max_frames_per_read",), text


def _hasty(options: CanOptions, period_s: float) -> Iterator[Problem]:
    """Tell of a watchdog that one late period would trip."""
    asked_s = options.watchdog_s
    if asked_s is None:
        return
    sent_s = min(s.value(s.raw(asked_s)) for s in options.layout.watchdogs)
    if sent_s < WATCHDOG_PERIODS * period_s * (1 - ROUNDING):
        text = (
            f"found {asked_s:g}, sent as {sent_s:g} s, must be at least {WATCHDOG_PERIODS} periods "
            f"of {period_s:g} s"
        )
        yield ("watchdog_s",), text
