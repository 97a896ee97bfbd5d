"""The driver of CiA 402 drives on CANopen: one SYNC, its answers and the commands a period."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from operator import or_
from typing import Any, ClassVar

from motorctl.hal import (
    Channel,
    DriverOptions,
    FirstAxis,
    FirstOptions,
    FoundDevice,
    Inputs,
    NetworkInterface,
    Outputs,
    RateBudget,
    Status,
    unseen_limit_switches,
)
from motorctl_can import budget
from motorctl_can.bus import link_settings
from motorctl_can.bus_driver import CLOSED, SAFE_REPEATS, BusDriver
from motorctl_can.link import Link
from motorctl_canopen import fits, objects
from motorctl_canopen.exchange import Exchange, heartbeat_periods
from motorctl_canopen.first_options import first_options
from motorctl_canopen.look import look
from motorctl_canopen.node import Node
from motorctl_canopen.opening import Opening
from motorctl_canopen.options import CanopenOptions
from motorctl_canopen.sdo import download_command, put_request, request_message

HEARTBEATS_LOST = 3
"""So many heartbeats of a drive in a row are missing where it is silent."""


class CanopenDriver(BusDriver):
    """CiA 402 drives in torque mode; see `CanopenOptions` and docs/drivers/canopen.md."""

    Options: ClassVar[type[DriverOptions]] = CanopenOptions
    clears_faults: ClassVar[bool] = True

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        assert isinstance(options, CanopenOptions)
        self._canopen = options
        # A command that waits for the next SYNC acts a period after what it answers was sampled.
        self.exchange_delay_periods = 1.0 if options.command_at == "sync" else 0.0
        self.longest_wait_s = options.sync.wait_s
        # A pause may begin when the next heartbeat was almost due.
        between_s = heartbeat_periods(options.watchdog_s, period_s) * period_s
        self.watchdog_s = options.watchdog_s - between_s
        self._nodes: list[Node] = []

    @classmethod
    def first_options(cls, axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
        """Return drives by the numbers of their channels."""
        return first_options(axes, period_s)

    @classmethod
    def look(cls, options: Mapping[str, Any]) -> FoundDevice:
        """Return the drives that answer on the bus."""
        return look(options)

    def rate_budget(self) -> RateBudget:
        """Compute the rate that the bus carries; docs/drivers/canopen.md has the arithmetic."""
        return budget.rate_budget(fits.traffic(self._canopen, self.channels))

    def problems(self) -> Sequence[tuple[tuple[str | int, ...], str]]:
        """Tell where drives, axes and period do not fit together."""
        return tuple(fits.problems(self._canopen, self.channels, self.period_s))

    def advice(self) -> Sequence[str]:
        """Tell whose limit switches are not among the inputs that the drives send."""
        inputs = {axis: node.inputs for axis, node in self._canopen.nodes.items()}
        return tuple(
            unseen_limit_switches({axis: of.named() if of else {} for axis, of in inputs.items()})
        )

    def switches(self) -> Sequence[Status]:
        """Tell which switches are among the inputs that the drives send; none has a mark."""
        found = []
        for channel in self.channels:
            inputs = self._canopen.nodes[channel.axis].inputs
            names = inputs.named() if inputs else {}
            found.append(reduce(or_, (Status[name.upper()] for name in names), Status(0)))
        return found

    def network_interfaces(self) -> Sequence[NetworkInterface]:
        """Tell the SocketCAN interface, and the bit rate that it has to have."""
        if self._canopen.interface != "socketcan":
            return ()
        return (NetworkInterface(self._canopen.channel, link_settings(self._canopen)),)

    def prepare(self) -> None:
        """Make every frame that is sent, and what is kept of the drives."""
        options = self._canopen
        silence_s = HEARTBEATS_LOST * options.heartbeat_s
        self._nodes = [
            Node(
                options.nodes[channel.axis],
                channel,
                self.period_s,
                options.enable_timeout_s,
                silence_s,
            )
            for channel in self.channels
        ]
        self._exchange = Exchange(options, self._nodes, self.period_s)

    def _begin(self, link: Link) -> None:
        """Set up every drive, start it, and wait until it tells its state."""
        exchange, nodes, options = self._exchange, self._nodes, self._canopen
        openings = [Opening(options, node, exchange) for node in nodes]
        # What takes a drive its time, all of them do at once.
        for opening in openings:
            opening.restart_communication()
        for opening in openings:
            opening.await_boot()
            opening.configure()
        for opening in openings:
            opening.start()
        exchange.run(
            lambda: all(opening.started for opening in openings),
            options.open_timeout_s + options.heartbeat_s,
        )
        for opening in openings:
            opening.insist_on_start()
        for opening in openings:
            opening.await_mode()
            opening.clear_fault()
        now_s = time.monotonic()
        for node in nodes:
            node.begin(now_s)
        exchange.start_over()
        link.lost = link.passing = 0
        self.notes = tuple(note for opening in openings for note in opening.notes)

    def _linked(self, settle_s: float) -> Link:
        link = self._exchange.link = Link(self._canopen, self._exchange.wanted, settle_s)
        return link

    def _leave(self, link: Link) -> None:
        """Let the drives wait for no heartbeat any more."""
        for node in self._nodes:
            self._tell(link, node, objects.CONSUMER_HEARTBEAT, 0)
            self._exchange.send_nmt(objects.NMT_PRE_OPERATIONAL, node.number)

    def _sent(self) -> Iterable[str]:
        numbers = [objects.RPDO1_ID + node.number for node in self._nodes]
        return [f"0x{number:X}" for number in (*numbers, objects.SYNC_ID)]

    def read(self, inputs: Inputs) -> None:
        """Fill `inputs` with what the drives tell of this period."""
        link = self._link
        if link is None:
            inputs.status[:] = CLOSED
            return
        self._exchange.ask()
        common = link.status
        link.passing = 0
        asked_s = self._exchange.asked_s
        for i, node in enumerate(self._nodes):
            inputs.status[i] = node.status(asked_s) | common
            inputs.counts[i] = node.shown

    def write(self, outputs: Outputs) -> None:
        """Send every drive's command."""
        if self._link is not None:
            self._exchange.send(outputs)

    def clear_fault(self, channel: int) -> None:
        """Let the next commands reset a drive's fault, and start it where it is not operational."""
        if self._link is not None:
            self._nodes[channel].clear_fault()

    def _send_off(self, link: Link) -> bool:
        whole = [self._exchange.send_off() for _ in range(SAFE_REPEATS)]
        # Many drives fill a socket's queue: this is for those that obey no PDO.
        written = [self._tell(link, node, objects.CONTROLWORD, 0) for node in self._nodes]
        return any(whole) or all(written)

    def _tell(self, link: Link, node: Node, entry: objects.Object, value: int) -> bool:
        """Write an entry without waiting for the answer; return whether the bus took it."""
        request = request_message(node.number)
        put_request(request, download_command(entry), entry, value)
        return link.send(request)
