"""Run ticks on a clock: skip whole periods after an overrun, count what happened."""

from __future__ import annotations

from motorctl.loop.clock import NS_PER_S, Clock, VirtualClock
from motorctl.loop.tick import Tick

START_DELAY_NS = 5_000_000


def run_wall(tick: Tick, clock: Clock) -> None:
    """Tick in wall-clock time until the loop may end: shut down and every axis at rest.

    Periods that the computer missed are skipped; where the machine's time waits they are not, and
    begin later.
    """
    period_ns = round(tick.machine.period_s * NS_PER_S)
    step, wait, now = tick.step, clock.wait_until_ns, clock.now_ns
    deadline = now() + START_DELAY_NS
    number, elapsed, overran = 0, 1, False
    while True:
        woke = wait(deadline)
        missed, late = deadline, woke - deadline
        if late >= period_ns:
            skipped = late // period_ns
            deadline += skipped * period_ns
            if tick.waits:
                tick.memory.status["skipped_periods"] += skipped
            else:
                number += skipped
                elapsed = skipped + 1
        # Lateness counts from the deadline that was missed: a long gap shows as what it was.
        if step(number, elapsed, overran, missed, woke):
            return
        number += 1
        if tick.successor is not None:
            tick = tick.successor(number)
            step = tick.step
        deadline += period_ns
        elapsed = 1
        overran = now() > deadline


class VirtualRun:
    """Ticks in virtual time, in this process, as fast as they go."""

    def __init__(self, tick: Tick) -> None:
        self.tick = tick
        self.number = 0
        self._clock = VirtualClock()

    def advance(self, ticks: int) -> bool:
        """Do so many ticks and return True as soon as the loop may end."""
        tick, wait = self.tick, self._clock.wait_until_ns
        step = tick.step
        for number in range(self.number, self.number + ticks):
            self.number = number + 1
            if step(number, 1, False, 0, wait(0)):
                return True
            if tick.successor is not None:
                self.tick = tick = tick.successor(self.number)
                step = tick.step
        return False
