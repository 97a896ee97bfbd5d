"""Serial lines that garble, devices that fall silent, restart or vanish, and hosts that stop."""

import os
import time

import numpy as np
import pytest
from serial_bench import (
    PERIOD_S,
    POLL,
    box_running,
    driver_for,
    framed,
    rig_open,
    state_body,
    until,
)

from motorctl.hal import Inputs, Status

pytestmark = pytest.mark.wall_clock(lanes=3)

MODES = ["poll", "exchange", "stream"]
GONE = Status.BUS_OFF | Status.COMMUNICATION_LOST
RESTARTED = Status.DEVICE_RESTARTED | Status.ENCODER_LOST
WAIT_S = 1.5e-3


def exchange_until(rig, bits, timeout_s=2.0):
    """Exchange until every channel has these bits; give the status words and counts."""
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        counts, status = rig.read()
        if all(word & bits == bits for word in status):
            return counts, status
        rig.write(0.0, enable=0)
        time.sleep(1e-3)
    raise AssertionError(f"never {bits!r}, last {[Status(word) for word in status]}")


def settled(rig, counts):
    """Let the encoders stand at counts and read until these have come."""
    rig.box.counts = counts
    deadline_s = time.monotonic() + 2.0
    while rig.read()[0] != counts:
        assert time.monotonic() < deadline_s
        rig.write(0.0, enable=0)
        time.sleep(1e-3)


@pytest.mark.parametrize("mode", MODES)
def test_a_silent_device_is_stale_and_no_fault(mode):
    with rig_open(mode=mode) as rig:
        settled(rig, [3, 4])
        rig.box.mute = True
        rig.box.counts = [5, 6]
        exchange_until(rig, Status.STALE)
        time.sleep(5e-3)
        rig.read()
        assert rig.read() == ([3, 4], [Status.STALE] * 2)
        rig.box.mute = False
        settled(rig, [5, 6])


@pytest.mark.parametrize("mode", MODES)
def test_a_box_that_refuses_every_command_is_told(mode):
    with rig_open(mode=mode) as rig:
        settled(rig, [3, 4])
        rig.box.refuses = True
        if mode == "exchange":  # an ERROR in place of the STATE
            exchange_until(rig, Status.CORRUPT | Status.STALE)
            return
        # its watchdog waits for nothing while it has enabled nothing
        counts, _ = exchange_until(rig, Status.CORRUPT | Status.COMMUNICATION_LOST)
        assert counts == [3, 4]
        assert not rig.box.watchdog_tripped
        rig.box.refuses = False
        until(lambda: exchange_once(rig) == 0)


def exchange_once(rig):
    rig.write(0.0, enable=0)
    time.sleep(1e-3)
    return rig.read()[1][0]


def test_a_read_waits_for_a_silent_device_no_longer_than_it_may():
    with rig_open(mode="poll", wait_s=WAIT_S) as rig:
        rig.box.mute = True
        took_s = []
        for _ in range(30):
            start = time.perf_counter()
            rig.read()
            took_s.append(time.perf_counter() - start)
        assert min(took_s) >= 1.4e-3
        assert sorted(took_s)[7] < 2 * WAIT_S  # a busy machine holds up some, not all


@pytest.mark.parametrize("mode", ["exchange", "stream"])
def test_the_other_modes_do_not_wait_at_all(mode):
    with rig_open(mode=mode) as rig:
        rig.box.mute = True
        took_s = []
        for _ in range(100):
            start = time.perf_counter()
            rig.read()
            took_s.append(time.perf_counter() - start)
        assert sorted(took_s)[25] < WAIT_S / 2  # what a read in mode poll waits is longer


def test_a_flood_holds_no_read_longer_than_it_may():
    with rig_open(mode="poll", wait_s=WAIT_S) as rig:
        rig.box.mute = True
        os.set_blocking(rig.box.master, False)
        took_s = []
        for _ in range(30):
            try:
                while True:
                    os.write(rig.box.master, bytes(range(256)) * 8)
            except BlockingIOError:
                pass
            start = time.perf_counter()
            rig.read()
            took_s.append(time.perf_counter() - start)
        assert sorted(took_s)[7] < 2 * WAIT_S  # a busy machine holds up some, not all
        rig.box.mute = False
        rig.box.counts = [8, 9]
        assert rig.read_fresh()[0] == [8, 9]


@pytest.mark.parametrize("next_number", [0, 128])
def test_a_backlog_beyond_what_a_read_takes_is_thrown_away(next_number):
    with rig_open(mode="stream") as rig:
        rig.read()
        rig.box.mute = True  # what it streams by itself would come before or after by chance
        os.set_blocking(rig.box.master, False)
        old = b"".join(framed(state_body(n, n, [n, n])) for n in range(2, 2500))
        sent = 0
        while sent < len(old):
            try:
                sent += os.write(rig.box.master, old[sent : sent + 2048])
            except BlockingIOError:
                break
        assert sent > 2 * 4096
        time.sleep(5e-3)
        counts, status = rig.read()
        assert Status(status[0]) == Status.STALE | Status.CORRUPT
        assert rig.read() == (counts, [Status.STALE] * 2)
        # Half a round apart: one of them would be a step back from any number in the backlog.
        rig.box.send_raw(b"\0" + framed(state_body(next_number, 3000, [70, 71])))
        assert rig.read_fresh()[0] == [70, 71]


@pytest.mark.parametrize("mode", ["exchange", "stream"])
def test_a_first_read_long_after_open_does_not_hang_on_old_samples(mode):
    with rig_open(mode=mode) as rig:
        # As if the device had gone on for so long that its numbers came round.
        rig.box.sample += 40_000
        rig.box.sequence += 150
        rig.read()
        settled(rig, [5, 6])


@pytest.mark.parametrize("mode", MODES)
def test_a_frame_with_a_wrong_crc_is_never_accepted(mode):
    with rig_open(mode=mode) as rig:
        settled(rig, [3, 4])
        rig.box.mangle = lambda wire: bytes((*wire[:-2], wire[-2] ^ 1 or 2, 0))
        rig.box.counts = [50, 60]
        counts, _ = exchange_until(rig, Status.STALE | Status.CORRUPT)
        assert counts == [3, 4]
        rig.box.mangle = lambda wire: wire
        settled(rig, [50, 60])


def test_random_damage_never_becomes_a_count():
    random = np.random.default_rng(5)
    good = [[n * 1000 + 7, -n * 1000 - 3] for n in range(100)]
    with rig_open(mode="poll", wait_s=0.5e-3) as rig:

        def damage(wire):
            kind, at = random.integers(6), random.integers(len(wire))
            if kind == 0:
                return wire[:at] + bytes((wire[at] ^ 1 << random.integers(8),)) + wire[at + 1 :]
            if kind == 1:
                return wire[:at] + wire[at + 1 :]
            if kind == 2:
                return wire[:at] + random.bytes(random.integers(1, 9)) + wire[at:]
            return random.bytes(random.integers(300)) + b"\0" + wire if kind == 3 else wire

        rig.box.mangle = damage
        fresh = corrupt = 0
        for counts in good:
            rig.box.counts = counts
            for _ in range(4):
                seen, status = rig.read()
                assert seen in [*good, [0, 0]]
                fresh += not status[0] & Status.STALE
                corrupt += bool(status[0] & Status.CORRUPT)
        assert fresh > 20
        assert corrupt > 20


def test_an_answer_that_comes_too_late_is_not_taken_for_a_fresh_one():
    with rig_open(mode="poll", wait_s=1e-3) as rig:
        settled(rig, [1, 2])
        rig.box.delay_s = 15e-3
        rig.box.counts = [3, 4]
        rig.read()
        time.sleep(30e-3)
        rig.box.mute = True
        counts, status = rig.read()
        assert counts == [1, 2]
        assert status[0] & Status.STALE


@pytest.mark.parametrize("mode", MODES)
def test_a_port_that_vanishes_is_bus_off_and_keeps_the_count(mode):
    with rig_open(mode=mode) as rig:
        settled(rig, [3, 4])
        rig.box.vanish()
        counts, status = exchange_until(rig, GONE)
        assert counts == [3, 4]
        assert all(word & Status.STALE for word in status)
        took_s = []
        for _ in range(100):
            start = time.perf_counter()
            rig.read()
            rig.write(1.0)
            took_s.append(time.perf_counter() - start)
        # However busy the machine is, many are not held up; poll would wait 0.9 periods, each time.
        assert sorted(took_s)[25] < PERIOD_S / 2
        assert rig.read() == (counts, status)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("announce", [False, True])
def test_a_restart_is_told_until_the_driver_is_opened_again(mode, announce):
    with rig_open(mode=mode) as rig:
        settled(rig, [3, 4])
        rig.box.counts = [0, 0]
        rig.box.restart(announce=announce)
        counts, _ = exchange_until(rig, RESTARTED)
        assert counts == [3, 4]
        for _ in range(5):
            rig.write(1.0)
            time.sleep(1e-3)
            counts, status = rig.read()
            assert counts == [3, 4]
            assert all(word & RESTARTED == RESTARTED for word in status)
        assert rig.box.enabled == [False, False]
        rig.driver.close()
        rig.driver.open()
        assert rig.read_fresh() == ([0, 0], [0, 0])


def test_a_device_that_vanished_and_came_back_is_opened_again():
    with box_running() as first:
        driver = driver_for(first.port)
        driver.open()
        first.vanish()
        inputs = Inputs(2)
        driver.read(inputs)
        driver.read(inputs)
        assert all(word & GONE == GONE for word in inputs.status.tolist())
        driver.safe()
        driver.close()
    with box_running() as second:
        # A new pseudo-terminal takes the lowest free number, so mostly the old name.
        again = driver if second.port == first.port else driver_for(second.port)
        again.open()
        second.counts = [9, 9]
        for _ in range(50):
            again.read(inputs)
            if inputs.counts.tolist() == [9, 9]:
                break
        assert inputs.status.tolist() == [0, 0]
        again.close()


def test_a_watchdog_that_tripped_is_told_until_everything_is_disabled():
    with rig_open(mode="poll", watchdog_s=0.01) as rig:
        rig.write(1.0)
        until(lambda: rig.box.enabled == [True, True])
        until(lambda: rig.box.watchdog_tripped)
        assert rig.box.volts == [0.0, 0.0]
        assert rig.read_fresh()[1] == [Status.COMMUNICATION_LOST] * 2
        rig.write(1.0)
        assert rig.read_fresh()[1] == [Status.COMMUNICATION_LOST] * 2
        assert rig.box.enabled == [False, False]
        rig.write(0.0, enable=0)
        assert rig.read_fresh()[1] == [0, 0]


def test_a_command_that_the_line_cuts_does_not_spoil_the_next():
    with rig_open(mode="poll") as rig:
        real, cut = os.write, []

        def cutting(fd, data):
            if fd != rig.box.master and len(data) == 11 and not cut:
                cut.append(True)
                return real(fd, data[:5])
            return real(fd, data)

        # The kernel takes part of a write only when its buffer is full.
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(os, "write", cutting)
            rig.box._receive = _forgiving(rig.box)
            rig.write(1.0)
            rig.write(2.0)
            until(lambda: rig.box.enabled == [True, True])
        assert cut
        assert rig.box.volts == pytest.approx([2.0, 2.0], abs=2e-4)


def _forgiving(box):
    """Let a box drop what is damaged, as the page says; else it fails the test."""
    receive = box._receive

    def checked(wire):
        try:
            receive(wire)
        except AssertionError:
            box.mangled = True

    return checked


def test_a_poll_that_the_device_refuses_ends_the_wait():
    with rig_open(mode="poll", period_s=8e-3, wait_s=7e-3) as rig:
        rig.box.restart()
        exchange_until(rig, RESTARTED)
        took_s = []
        for _ in range(20):
            start = time.perf_counter()
            rig.read()
            took_s.append(time.perf_counter() - start)
        assert rig.box.heard[-1][0] == POLL
        assert np.median(took_s) < 5e-3


def test_random_bytes_on_the_line_never_raise_and_never_move_the_count():
    random = np.random.default_rng(11)
    with rig_open(mode="exchange") as rig:
        settled(rig, [3, 4])
        rig.box.mute = True
        for _ in range(300):
            rig.box.send_raw(random.bytes(random.integers(1, 200)))
            counts, status = rig.read()
            assert counts == [3, 4]
            assert not any(word & RESTARTED for word in status)
        rig.box.mute = False
        rig.box.send_raw(b"\0")
        settled(rig, [5, 6])


def test_the_period_of_these_tests_is_one_that_the_driver_carries():
    assert driver_for("/dev/pts/0").rate_budget().max_rate_hz > 1.0 / PERIOD_S


@pytest.mark.parametrize(("behind", "fresh"), [(0, True), (4, True), (5, False), (60, False)])
def test_a_stream_that_lags_behind_the_commands_is_stale(behind, fresh):
    with rig_open(mode="stream") as rig:
        rig.read()
        for _ in range(3):
            rig.write(0.0, enable=0)
        newest = rig.driver._sequence - 1
        rig.box.mute = True
        time.sleep(5e-3)
        rig.read()
        body = state_body(
            rig.box.sequence + 1,
            rig.box.sample + 1,
            [7, 8],
            in_force=newest - behind & 255,
            flags=1,
        )
        rig.box.send_raw(framed(body))
        assert rig.driver._port.wait(1.0)
        counts, status = rig.read()
        assert (status == [0, 0]) == fresh
        assert (counts == [7, 8]) == fresh
