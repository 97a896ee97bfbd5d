"""What drivers on a CAN bus share, whatever its frames mean: to open it, make it safe, leave it."""

from __future__ import annotations

import contextlib
from abc import abstractmethod
from collections.abc import Iterable, Sequence

from motorctl.hal import Channel, Claim, Driver, DriverOptions, Status
from motorctl_can.bus import BusOptions
from motorctl_can.link import Link

SAFE_REPEATS = 3
"""So often is sent what disables."""
SAFE_SETTLE_S = 1.5
"""How long `safe` lets an adapter settle that it opened itself [s], at most: other drivers' outputs
may wait for it, and the supervisor gives up after 2 s. One that needs more may lose what disables.
"""
CLOSED = int(Status.COMMUNICATION_LOST | Status.STALE)
"""The status of every axis on a bus that is not open."""


class BusDriver(Driver):
    """A driver of the axes on one bus.

    It claims what it sends, opens the bus, and sets up what is on it; it makes that safe before it
    leaves, and over a bus opened for that where none is.
    """

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        assert isinstance(options, BusOptions)
        self._bus = options
        self.medium = options.medium
        self._link: Link | None = None
        self._claim: Claim | None = None

    @abstractmethod
    def _sent(self) -> Iterable[str]:
        """Return the addresses of the frames that are sent, once `prepare` is through."""

    @abstractmethod
    def _linked(self, settle_s: float) -> Link:
        """Open the bus, and let its adapter settle for that long. Raises RunError."""

    @abstractmethod
    def _begin(self, link: Link) -> None:
        """Set up what is on the bus. Raises RunError."""

    @abstractmethod
    def _send_off(self, link: Link) -> bool:
        """Disable everything on the bus; return whether the bus took all that it needs."""

    def _leave(self, link: Link) -> None:
        """Do what else is to be done before a bus is left."""

    def open(self) -> None:
        """Open the bus and set up what is on it, everything disabled.

        Raises RunError, naming interface and channel, and what is wrong there.
        """
        if self._link is not None:
            self.close()
        self.prepare()
        self._claim = self._claimed()
        try:
            self._link = self._linked(self._bus.settle_s)
            self._begin(self._link)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disable everything on the bus, and release it."""
        link = self._link
        if link is not None:
            self.safe()
            with contextlib.suppress(Exception):
                self._leave(link)
            self._link = None
            link.close()
        if self._claim is not None:
            self._claim.release()
            self._claim = None

    def safe(self) -> None:
        """Disable everything, a few times; a bus that is not open is opened for that."""
        with self.telling_safe():
            if self._link is not None:
                self._make_safe(self._link)
                return
            self.prepare()
            # What another program drives is not this one's to make safe.
            claim = None if self._claim else self._claimed()
            try:
                settle_s = min(self._bus.settle_s, SAFE_SETTLE_S)
                link = self._linked(settle_s)
                try:
                    self._make_safe(link)
                finally:
                    link.close()
                if self.safe_sent and settle_s < self._bus.settle_s:
                    self.safe_sent = None  # the adapter may not have listened yet
            finally:
                if claim is not None:
                    claim.release()

    def _make_safe(self, link: Link) -> None:
        self.safe_sent = self._send_off(link)
        if not self.safe_sent:
            why = link.complaint or "it had no room for all frames"
            self.safe_failed = f"{self._bus.medium}: {why}"

    def _claimed(self) -> Claim | None:
        """Claim what is sent: a bus obeys everybody. A serial port is claimed by itself."""
        if self._bus.interface not in ("socketcan", "udp_multicast") or self.medium is None:
            return None
        return Claim(self.medium, [f"frame {address}" for address in self._sent()])
