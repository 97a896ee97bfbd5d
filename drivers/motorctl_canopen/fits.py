"""What the bus carries, and where drives do not fit the axes and the period of the machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from motorctl.hal import Channel
from motorctl_can import budget
from motorctl_can.budget import Sent, Traffic, Wire
from motorctl_can.fits import LEAST_STEPS
from motorctl_canopen.node import COMMAND_FRAME, INPUTS_FRAME, MOST_TORQUE, STATE_FRAME
from motorctl_canopen.options import CanopenOptions

Problem = tuple[tuple[str | int, ...], str]

COUNTER_BITS = 32
LEAST_WATCHDOG_PERIODS = 4
ROUNDING = 1e-9


def traffic(options: CanopenOptions, channels: Sequence[Channel]) -> Traffic:
    """Return what the bus carries in a period.

    One heartbeat is among it: they are rare, and the last ones to get the bus.
    """
    commands = [Sent(f"command {c.axis}", COMMAND_FRAME.size) for c in channels]
    states = []
    for channel in channels:
        states.append(Sent(f"state {channel.axis}", STATE_FRAME.size))
        node = options.nodes.get(channel.axis)
        if node is not None and node.inputs is not None:
            states.append(Sent(f"inputs {channel.axis}", INPUTS_FRAME.size))
    commands.append(Sent("heartbeat", 1))
    wire = Wire(options.bitrate)
    sync = Sent("SYNC", 0)
    return Traffic(options, wire, tuple(commands), tuple(states), sync, options.sync.wait_s)


def problems(
    options: CanopenOptions, channels: Sequence[Channel], period_s: float
) -> Iterator[Problem]:
    """Tell everything that does not fit together."""
    axes = [channel.axis for channel in channels]
    for axis in options.nodes:
        if axis not in axes:
            text = f"names axis '{axis}', but this driver serves: {', '.join(axes)}"
            yield ("nodes", axis), text
    for channel in channels:
        yield from _misfits(options, channel)
    whole = traffic(options, channels)
    if options.interface not in budget.HOST_COST_S:
        least_s = budget.answer_s(whole)
        if options.sync.wait_s < least_s:
            text = (
                f"found {options.sync.wait_s * 1e6:g} us, but SYNC and its answers take up to "
                f"{least_s * 1e6:.1f} us on the bus alone"
            )
            yield ("sync", "wait_s"), text
    least = len(whole.states) + 1
    if options.max_frames_per_read < least:
        text = (
            f"found {options.max_frames_per_read}, must be at least {least}, one more than the "
            "drives may send in a period"
        )
        yield ("max_frames_per_read",), text
    if options.watchdog_s < LEAST_WATCHDOG_PERIODS * period_s * (1 - ROUNDING):
        text = (
            f"found {options.watchdog_s:g}, must be at least {LEAST_WATCHDOG_PERIODS} periods of "
            f"{period_s:g} s: one late heartbeat would switch the drive off"
        )
        yield ("watchdog_s",), text


def _misfits(options: CanopenOptions, channel: Channel) -> Iterator[Problem]:
    axis, limit = channel.axis, channel.max_voltage_v
    node = options.nodes.get(axis)
    if node is None:
        yield ("nodes",), f"has no drive for axis '{axis}'"
        return
    where = ("nodes", axis)
    if channel.counter_bits != COUNTER_BITS:
        text = (
            f"axis '{axis}' has encoder.counter_bits {channel.counter_bits}, but the position of a "
            f"CiA 402 drive (6064h) has {COUNTER_BITS}"
        )
        yield where, text
    step, reach = node.rated_torque_v / 1000.0, node.rated_torque_v * MOST_TORQUE / 1000.0
    whose = f"axis '{axis}' has limits.max_voltage_v {limit:g}"
    key = (*where, "rated_torque_v")
    if step * LEAST_STEPS > limit * (1 + ROUNDING):
        text = (
            f"found {node.rated_torque_v:g}: a step of 1/1000 is {step:g} V, but {whose}: a step "
            f"may be {limit / LEAST_STEPS:g} V at most, 1/{LEAST_STEPS} of it"
        )
        yield key, text
    if limit > reach * (1 + ROUNDING):
        text = f"found {node.rated_torque_v:g}: the drive takes up to {reach:g} V, but {whose}"
        yield key, text
