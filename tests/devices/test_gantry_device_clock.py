"""The device's own sampling clock: instants a period apart that settle on who asks."""

from __future__ import annotations

import time

import numpy as np
import pytest

from motorctl.hal import Driver, DriverOptions, RateBudget
from motorctl_devices.machine import PHASE, Machine

pytestmark = pytest.mark.wall_clock(lanes=3)

PERIOD_S = 1e-3
PERIOD_NS = 1_000_000


class Counting(Driver):
    """A machine whose count is the number of periods that have passed."""

    supports_virtual_time = True

    def rate_budget(self):
        return RateBudget(1e9, "")

    def start_virtual_time(self):
        self.passed = 0

    def advance(self):
        self.passed += 1

    def open(self):
        pass

    def read(self, inputs):
        inputs.counts[:] = self.passed

    def write(self, outputs):
        pass

    def close(self):
        pass

    def safe(self):
        pass


@pytest.fixture
def machine():
    made = Machine(Counting(DriverOptions(), (), PERIOD_S), [32], None, [None], [True])
    made.open()
    return made


def asked(machine, times_ns):
    """Ask at these times and give the counts."""
    counts = []
    for now_ns in times_ns:
        machine.sample(int(now_ns))
        counts.append(machine.counts[0])
    return np.array(counts)


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.5, 0.61, 0.63, 0.9])
def test_who_asks_once_a_period_gets_every_sample_once_whatever_the_phase(machine, phase):
    start_ns = time.monotonic_ns() + phase * PERIOD_NS
    counts = asked(machine, start_ns + PERIOD_NS * np.arange(1, 3000))
    steps = np.diff(counts)
    assert (steps[2000:] == 1).all()
    assert counts[-1] - counts[0] == pytest.approx(2998, abs=1)
    asks_ns = start_ns + PERIOD_NS * 2999
    settled = (asks_ns - machine._instant_ns) / PERIOD_NS % 1.0
    assert settled == pytest.approx(PHASE, abs=0.02)


@pytest.mark.parametrize("late", [0.2, 0.5, 0.8])
def test_a_late_message_finds_the_sample_that_was_taken_on_time(machine, late):
    on_time_ns = time.monotonic_ns() + PERIOD_NS * np.arange(1, 4000)
    times_ns = on_time_ns.astype(float)
    times_ns[2000::50] += late * PERIOD_NS
    steps = np.diff(asked(machine, times_ns))
    assert (steps[1500:] == 1).all()


def test_who_asks_again_before_the_next_instant_gets_the_same_sample(machine):
    # Reckoned from the device's own instant: how long a test takes to begin is nobody's business.
    start_ns = machine._instant_ns + 1.3 * PERIOD_NS
    first, again = asked(machine, [start_ns, start_ns + 0.3 * PERIOD_NS])
    assert first == again


def test_a_long_pause_is_caught_up_to_a_bound(machine):
    start_ns = time.monotonic_ns()
    first, last = asked(machine, [start_ns + PERIOD_NS, start_ns + 10_000 * PERIOD_NS])
    assert last - first == 1000


class Pushed(Counting):
    """Its count is the number of periods in which it had volts."""

    volts = 0.0

    def advance(self):
        self.passed += self.volts != 0.0

    def write(self, outputs):
        self.volts = float(outputs.volts[0])


def pushed(watchdog_s):
    made = Machine(Pushed(DriverOptions(), (), PERIOD_S), [32], watchdog_s, [None], [True])
    made.open()
    start_ns = time.monotonic_ns()
    made.command(0, 3.0, True, start_ns)
    made.apply(start_ns)
    return made, start_ns


def test_the_watchdog_ends_the_volts_when_it_is_due_however_late_the_process_is():
    machine, start_ns = pushed(watchdog_s=0.05)
    machine.check_watchdog(start_ns + 400 * PERIOD_NS)
    machine.catch_up(start_ns + 400 * PERIOD_NS)
    assert machine.counts[0] == pytest.approx(50, abs=1)
    assert machine.tripped == [True]
    assert machine.watchdog_trips == 1
    assert not machine.any_enabled


def test_what_moved_before_the_amplifiers_are_disabled_has_moved():
    machine, _ = pushed(watchdog_s=None)
    time.sleep(0.02)
    machine.disable_all()
    assert machine.counts[0] >= 19
    moved = machine.counts[0]
    machine.catch_up(time.monotonic_ns() + 10 * PERIOD_NS)
    assert machine.counts[0] == moved


def test_amplifiers_that_flicker_are_not_off_and_those_that_rested_were(monkeypatch):
    now_ns = [1_000_000_000]
    monkeypatch.setattr(time, "monotonic_ns", lambda: now_ns[0])
    machine, _ = pushed(watchdog_s=None)
    for off_s, on_s in ((0.1, 0.1), (0.29, 0.1), (0.5, 0.1), (2.0, 0.1)):
        machine.disable_all()
        now_ns[0] += round(off_s * 1e9)
        machine.command(0, 3.0, True, now_ns[0])
        machine.apply(now_ns[0])
        now_ns[0] += round(on_s * 1e9)
    lengths_s = [(on_ns - off_ns) / 1e9 for off_ns, on_ns in machine.rests_ns]
    assert lengths_s[-2:] == pytest.approx([0.5, 2.0])
    assert 0.29 not in lengths_s
    assert 0.1 not in lengths_s
