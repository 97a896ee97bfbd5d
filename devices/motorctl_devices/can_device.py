"""What a device file says of CAN, the only bus here that takes libraries beside motorctl's own.

So `load` imports this module where the file has such a bus, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from motorctl.errors import Problem
from motorctl.located_yaml import Document, KeyPath
from motorctl_devices.can_bus import CanBus, LibraryBus, SlcanAdapter
from motorctl_devices.can_layout import CanShape, FrameLayout, LayoutError, layouts
from motorctl_devices.can_node import CanNode, channels_of
from motorctl_devices.machine import Machine
from motorctl_devices.schedule import Schedule

TOP: KeyPath = ("serve", "can")


class CanDevice:
    """The bus of a device file: its shape, and its frames once `lay_out` has made them."""

    def __init__(self, shape: CanShape) -> None:
        self._shape = shape
        self._frames: list[FrameLayout] = []

    @property
    def has_port(self) -> bool:
        """Whether a host finds it on a serial port."""
        return self._shape.interface == "slcan"

    def lay_out(
        self, document: Document, names: Sequence[str], bits: Sequence[int], folder: Path
    ) -> list[Problem]:
        """Make the frames, and find what does not fit the channels.

        Parameters
        ----------
        document
            The device file, for the places of problems.
        names, bits
            Name and counter width [bits] of each channel.
        folder
            Where the device file is: paths in it are relative to that.

        Returns
        -------
        list of Problem
            Empty where everything fits.
        """
        problems: list[Problem] = []
        try:
            self._frames = layouts(self._shape, names, folder)
        except LayoutError as error:
            problems.append(document.problem((*TOP, *error.where), str(error)))
        for layout in self._frames:
            for meant in layout.meant:
                if meant.means not in ("counts", "index_counts") or meant.channel is None:
                    continue
                if meant.bits != bits[meant.channel]:
                    message = (
                        f"{meant.signal} has {meant.bits} bits, the channel's counter_bits are"
                    )
                    where = "signals" if self._shape.frames is None else "frames"
                    told = f"{message} {bits[meant.channel]}"
                    problems.append(document.problem((*TOP, where), told))
        return problems

    def heard_apart(self) -> set[int]:
        """Return the channels whose drives have state frames of their own."""
        told = [channels_of(layout) for layout in self._frames if not layout.command]
        return {channels[0] for channels in told if len(channels) == 1}

    def signed_counters(self) -> dict[int, bool]:
        """Tell of each channel whether the bus shows its counter as a signed number."""
        return {
            meant.channel: layout.message.get_signal_by_name(meant.signal).is_signed
            for layout in self._frames
            for meant in layout.meant
            if meant.means == "counts" and meant.channel is not None
        }

    def node(
        self, machine: Machine, schedule: Schedule, rate_hz: float, link: Path | None
    ) -> CanNode:
        """Connect a machine to the bus.

        Parameters
        ----------
        machine
            The simulated gantry.
        schedule
            The faults ordered.
        rate_hz
            Of the device's sampling clock [Hz].
        link
            Symbolic link to make to the serial port of an slcan adapter; None: none.
        """
        shape = self._shape
        bus: CanBus
        if shape.interface == "slcan":
            bus = SlcanAdapter(link)
        else:
            assert shape.channel is not None
            settings: dict[str, Any] = {}
            if shape.interface == "socketcan":
                settings = {"fd": shape.fd}
            elif shape.interface == "udp_multicast":
                settings = {"fd": shape.fd, "port": shape.port, "hop_limit": 0}
            bus = LibraryBus(shape.interface, shape.channel, **settings)
        return CanNode(machine, schedule.faults, bus, self._frames, shape.sync, rate_hz, shape.fd)
