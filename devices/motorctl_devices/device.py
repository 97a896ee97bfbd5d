"""The device's life: wait, answer, send, and let the ordered faults happen."""

from __future__ import annotations

import os
import select
import time
from dataclasses import dataclass
from typing import Any

from motorctl_devices.endpoint import Endpoint
from motorctl_devices.machine import Machine
from motorctl_devices.schedule import NEVER, NS, Fault, Schedule

IDLE_NS = 20_000_000
"""The machine moves on at least this often, also where nobody asks."""
BABBLE_AT_ONCE = 16


@dataclass
class Device:
    """A machine, the bus it is on, and what shall go wrong."""

    machine: Machine
    endpoint: Endpoint[Any]
    schedule: Schedule
    spin_s: float = 0.0
    """The last part of a wait for the device's own sending, spent awake."""

    def __post_init__(self) -> None:
        self._stopping = False
        self._wake, self._waker = os.pipe()
        self._babblers: list[Fault] = []
        self._babble_ns = NEVER
        self.longest_pause_ns = 0
        """By how much the device woke too late at worst while an amplifier was on: a pause of this
        computer, and no fault."""

    def open(self) -> None:
        """Power on and get on the bus. Raises RunError."""
        self.machine.open()
        try:
            self.endpoint.open()
        except BaseException:
            self.machine.close()
            raise

    def close(self) -> None:
        """Leave the bus and power off."""
        self.endpoint.close()
        self.machine.close()
        self.release()

    def release(self) -> None:
        """Release the descriptors of a device that was never opened."""
        for number in (self._wake, self._waker):
            os.close(number)

    def stop(self) -> None:
        """Let `run` return; may be called from a signal handler or another thread."""
        self._stopping = True
        os.write(self._waker, b"\0")

    def run(self) -> None:
        """Serve until `stop`."""
        endpoint, machine, schedule = self.endpoint, self.machine, self.schedule
        clock = time.monotonic_ns
        spin_ns = int(self.spin_s * NS)
        idle_ns = clock() + IDLE_NS
        due_ns = NEVER
        while not self._stopping:
            now_ns = endpoint.now_ns = clock()
            if now_ns > due_ns and machine.any_enabled:
                self.longest_pause_ns = max(self.longest_pause_ns, now_ns - due_ns)
                if newest := schedule.newest:
                    newest.longest_pause_ns = max(newest.longest_pause_ns, now_ns - due_ns)
            if now_ns >= schedule.next_change_ns:
                self._change(now_ns)
            trips = machine.watchdog_trips
            if now_ns >= machine.due_ns:
                machine.check_watchdog(now_ns)
            if now_ns >= endpoint.due_ns:
                endpoint.on_due()
            if newest := schedule.newest:
                newest.watchdog_trips += machine.watchdog_trips - trips
            endpoint.flush()
            if now_ns >= self._babble_ns:
                self._babble(now_ns)
            if now_ns >= idle_ns:
                machine.catch_up(now_ns)
                idle_ns = now_ns + IDLE_NS
            own_ns = endpoint.earliest_ns()
            due_ns = min(
                own_ns - spin_ns,
                machine.due_ns,
                schedule.next_change_ns,
                self._babble_ns,
                idle_ns,
            )
            left_ns = due_ns - clock()
            filenos = endpoint.filenos()
            filenos.append(self._wake)
            ready = select.select(filenos, (), (), left_ns / NS if left_ns > 0 else 0.0)[0]
            if ready:
                endpoint.now_ns = clock()
                endpoint.hear(ready)
                if machine.any_enabled and not schedule.started:
                    schedule.start(endpoint.now_ns)

    def _change(self, now_ns: int) -> None:
        for fault in self.schedule.update(now_ns):
            kind = fault.order.kind
            if kind == "reset":
                fault.fired += fault.active
                self._reset(fault.active)
            elif kind == "unplug":
                fault.fired += fault.active
                self.endpoint.go_silent(fault.active)
                if fault.active:
                    self.endpoint.unplug()
                else:
                    self.endpoint.plug()
            elif kind in ("amplifier_fault", "counter_jump", "encoder_lost", "drive_silent"):
                fault.fired += fault.active
                self._break(fault)
        self.endpoint.settle()
        self._babblers = [
            f for f in self.schedule.faults if f.active and f.order.kind == "babbling"
        ]
        self._babble_ns = now_ns if self._babblers else NEVER

    def _break(self, fault: Fault) -> None:
        """Break an amplifier, an encoder or a drive's line, or mend it; or let a counter jump."""
        machine, order = self.machine, fault.order
        channels = range(machine.channels) if order.channel is None else (order.channel,)
        for channel in channels:
            if order.kind == "amplifier_fault":
                machine.break_amplifier(channel, fault.active)
            elif order.kind == "encoder_lost":
                machine.lose_encoder(channel, fault.active)
            elif order.kind == "drive_silent":
                machine.silence(channel, fault.active)
            elif fault.active:
                machine.shift_counter(channel, order.counts or 0)

    def _reset(self, begins: bool) -> None:
        """Restart at the fault's begin; the device is back on the bus at its end."""
        self.endpoint.go_silent(begins)
        if begins:
            self.machine.restart()
            self.endpoint.died()
        else:
            self.endpoint.booted()

    def _babble(self, now_ns: int) -> None:
        period_ns = NS
        for fault in self._babblers:
            period_ns = min(period_ns, int(NS / (fault.order.rate_hz or 1.0)))
            self.endpoint.babble(fault)
            fault.fired += 1
        # What could not be sent in time is left out: a flood must not starve the device itself.
        self._babble_ns = max(self._babble_ns + period_ns, now_ns + period_ns // BABBLE_AT_ONCE)
