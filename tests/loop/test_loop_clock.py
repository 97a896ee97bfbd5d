"""The clock never wakes early, and the runner skips whole periods and says by how much."""

import itertools
import time
from types import SimpleNamespace

import numpy as np
import pytest

from motorctl.loop.clock import WallClock
from motorctl.loop.runner import START_DELAY_NS, run_wall

PERIOD_NS = 200_000


@pytest.mark.parametrize("spin_s", [0.0, 60e-6, 1e-3])
def test_the_wall_clock_never_returns_before_its_deadline(spin_s):
    clock = WallClock(spin_s)
    for ahead in np.random.default_rng(1).integers(-100_000, 2_000_000, 150):
        deadline = clock.now_ns() + int(ahead)
        woke = clock.wait_until_ns(deadline)
        assert woke >= deadline
        assert woke <= time.monotonic_ns()


class ScriptedClock:
    """Wakes as late as the script says; every step takes as long as the script says."""

    def __init__(self, late_ns: list[int], step_ns: list[int]) -> None:
        self._late, self._step = iter(late_ns), itertools.chain(step_ns, itertools.repeat(0))
        self.time_ns = 1_000_000_000

    def now_ns(self) -> int:
        return self.time_ns

    def wait_until_ns(self, deadline_ns: int) -> int:
        self.time_ns = max(deadline_ns, self.time_ns) + next(self._late)
        return self.time_ns

    def work(self) -> None:
        self.time_ns += next(self._step)


waited: list[int] = []
"""Periods that each run has waited."""


def run(
    late_ns: list[int], step_ns: list[int] = (), *, waits: bool = False
) -> list[tuple[int, int, bool, int]]:
    """Return (number, elapsed, overran, lateness) of every tick."""
    clock = ScriptedClock(late_ns, list(step_ns))
    seen: list[tuple[int, int, bool, int]] = []

    def step(number, elapsed, overran, scheduled_ns, woke_ns):
        seen.append((number, elapsed, overran, woke_ns - scheduled_ns))
        clock.work()
        return len(seen) == len(late_ns)

    machine = SimpleNamespace(period_s=PERIOD_NS * 1e-9)
    memory = SimpleNamespace(status={"skipped_periods": np.zeros(1, np.int64)})
    tick = SimpleNamespace(machine=machine, step=step, waits=waits, memory=memory, successor=None)
    run_wall(tick, clock)
    waited.append(int(memory.status["skipped_periods"][0]))
    return seen


def test_ticks_in_time_are_numbered_one_after_the_other():
    assert run([0, 10, 20]) == [(0, 1, False, 0), (1, 1, False, 10), (2, 1, False, 20)]


def test_a_tick_that_is_late_by_less_than_a_period_is_only_late():
    assert run([0, PERIOD_NS - 1, 0])[1:] == [(1, 1, False, PERIOD_NS - 1), (2, 1, False, 0)]


def test_a_wake_up_that_misses_periods_skips_them_and_keeps_the_rhythm():
    late = 3 * PERIOD_NS + 70
    ticks = run([0, late, 0, 0])
    # Ticks 1 to 3 are missed; the tick stands for number 4, and is as late as its wake-up was.
    assert ticks[1] == (4, 4, False, late)
    assert ticks[2] == (5, 1, False, 0)
    assert ticks[3] == (6, 1, False, 0)


def test_a_machine_that_waits_misses_no_period_and_its_wait_is_counted():
    late = 3 * PERIOD_NS + 70
    ticks = run([0, late, 0, 0], waits=True)
    assert [tick[:2] for tick in ticks] == [(0, 1), (1, 1), (2, 1), (3, 1)]
    assert [tick[3] for tick in ticks] == [0, late, 0, 0]  # how late it was is told all the same
    assert waited[-1] == 3


def test_a_step_longer_than_its_period_is_an_overrun():
    ticks = run([0, 0, 0], [PERIOD_NS + 5, 10])
    assert ticks[0][2] is False
    assert ticks[1] == (1, 1, True, 5)
    assert ticks[2] == (2, 1, False, 0)


def test_a_step_longer_than_two_periods_is_an_overrun_and_skips():
    ticks = run([0, 0, 0], [2 * PERIOD_NS + 5, 10])
    assert ticks[1] == (2, 2, True, PERIOD_NS + 5)
    assert ticks[2] == (3, 1, False, 0)


def test_the_first_deadline_leaves_time_to_come_to_it():
    assert run([0])[0] == (0, 1, False, 0)
    assert START_DELAY_NS > 0
