"""Which of the ordered faults are in force now."""

from __future__ import annotations

import random
from collections.abc import Sequence

from motorctl_devices.orders import FaultOrder

NEVER = 2**63 - 1
NS = 1_000_000_000


class Fault:
    """One ordered fault with its own random numbers, so that no other changes what it does."""

    __slots__ = (
        "_counts",
        "active",
        "amount_ns",
        "began_ns",
        "fired",
        "longest_pause_ns",
        "order",
        "random",
        "start_ns",
        "stop_ns",
        "to_device",
        "watchdog_trips",
    )

    def __init__(self, order: FaultOrder, seed: int, number: int) -> None:
        self.order = order
        self.random = random.Random(f"{seed}/{number}")
        self.start_ns = round((order.at_s or 0.0) * NS)
        length = order.duration_s
        self.stop_ns = NEVER if length is None else self.start_ns + max(1, round(length * NS))
        self.amount_ns = round((order.amount_s or 0.0) * NS)
        self.active = False
        self.began_ns: int | None = None
        """When it came into force, None where it has not yet."""
        self.fired = 0
        self.watchdog_trips = 0
        """From its begin to that of the next fault; so is `longest_pause_ns`."""
        self.longest_pause_ns = 0
        """As `Device.longest_pause_ns`."""
        self.to_device = False
        """The direction of the message that is passing: `every` counts each by itself."""
        self._counts = [0, 0]

    def strikes(self) -> bool:
        """Tell whether the next message is hit; to be asked once a message."""
        order = self.order
        if order.every is not None:
            self._counts[self.to_device] += 1
            hit = self._counts[self.to_device] % order.every == 0
        else:
            hit = order.share is None or self.random.random() < order.share
        self.fired += hit
        return hit


class Schedule:
    """All faults of a device; its clock starts with the first command that enables an axis."""

    def __init__(self, orders: Sequence[FaultOrder], seed: int) -> None:
        self.faults = tuple(
            Fault(order, seed, number)
            for number, order in enumerate(orders)
            if order.kind != "counter_wrap"
        )
        self.next_change_ns = NEVER
        self.newest: Fault | None = None
        """The one that began last."""
        self._zero_ns: int | None = None

    @property
    def started(self) -> bool:
        """Whether its clock runs."""
        return self._zero_ns is not None

    def start(self, now_ns: int) -> None:
        """Start its clock, once."""
        if self._zero_ns is None:
            self._zero_ns = now_ns
            self.next_change_ns = now_ns

    def update(self, now_ns: int) -> Sequence[Fault]:
        """Update which faults are active; return those changed. Call from `next_change_ns` on."""
        if self._zero_ns is None:
            return ()
        elapsed = now_ns - self._zero_ns
        changed = []
        upcoming = NEVER
        for fault in self.faults:
            active = fault.start_ns <= elapsed < fault.stop_ns
            if active != fault.active:
                fault.active = active
                if active:
                    fault.began_ns = now_ns
                    self.newest = fault
                changed.append(fault)
            for edge in (fault.start_ns, fault.stop_ns):
                if elapsed < edge < upcoming:
                    upcoming = edge
        self.next_change_ns = NEVER if upcoming == NEVER else self._zero_ns + upcoming
        return changed
