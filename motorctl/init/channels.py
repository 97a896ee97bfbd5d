"""Which channel of its driver each motor of a new machine is on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from motorctl.errors import UsageError
from motorctl.init.questions import SECOND_CHANNEL

if TYPE_CHECKING:
    from motorctl.init.told import AxisTold

MOST_CHANNELS = 1024
"""Of a driver, as a configuration has it."""


def second_channel(words: str) -> int:
    """Return the channel that words name. Raises UsageError where they name none."""
    if not words.isdecimal() or int(words) >= MOST_CHANNELS:
        raise UsageError(
            f"--second-channel {words}: should be a whole number, 0 to {MOST_CHANNELS - 1}"
        )
    return int(words)


def number_channels(axes: Sequence[AxisTold]) -> None:
    """Give each axis the next free channels of its driver, a beam with two motors two of them.

    Channels that devices told of themselves stay. Raises UsageError where one would be given twice.
    """
    owners: dict[tuple[str, int], str] = {}

    def own(axis: AxisTold, channel: int) -> int:
        owner = owners.setdefault((axis.driver, channel), axis.name)
        if owner != axis.name or channel == axis.second_channel == axis.channel:
            raise UsageError(
                f"--second-channel {channel}: axis {axis.name} of driver {axis.driver}: it is "
                f"another motor's already, of axis {owner}"
            )
        return channel

    for axis in axes:
        if axis.found is not None:
            own(axis, axis.channel)
    for axis in axes:
        told = axis.words.get(SECOND_CHANNEL.option)
        if axis.found is None:
            axis.second_channel = None
            if axis.is_dual and told is not None:
                axis.second_channel = own(axis, second_channel(told))
    for axis in axes:
        free = (n for n in range(MOST_CHANNELS) if (axis.driver, n) not in owners)
        if axis.found is None:
            axis.channel = own(axis, next(free))
            if axis.is_dual and axis.second_channel is None:
                axis.second_channel = own(axis, next(free))
        elif axis.second_channel is not None:
            own(axis, axis.second_channel)
