"""SYNC: which answer is of this period, and what is told where none is."""

import threading
import time

import pytest
from can_bench import (
    STATE,
    STATE_Y,
    bus,
    frames_apart,
    lone_bytes,
    message,
    on_sync,
    opened,
    state_bytes,
)

from motorctl.hal import Status

pytestmark = pytest.mark.wall_clock(lanes=3)

STALE, CORRUPT = int(Status.STALE), int(Status.CORRUPT)


def test_each_read_brings_the_sample_of_its_own_sync():
    with on_sync() as (bench, device):
        for _ in range(50):
            (x, y), status = bench.read()
            assert (x, y, status) == (10 * device.samples, 20 * device.samples, [0, 0])


def test_a_read_waits_for_every_state_frame():
    def answer(k):
        return [message(lone_bytes(k, k), STATE), message(lone_bytes(-k, k), STATE_Y)]

    with on_sync(answer, frames=frames_apart()) as (bench, device):
        for _ in range(20):
            assert bench.read() == ([device.samples, -device.samples], [0, 0])


def test_a_device_that_does_not_answer_holds_a_read_no_longer_than_wait_s():
    mute = threading.Event()

    def answer(k):
        return [] if mute.is_set() else [message(state_bytes(k, k, k))]

    with on_sync(answer, wait_s=0.02) as (bench, _):
        mute.set()
        took = []
        for _ in range(10):
            start = time.monotonic()
            assert bench.read()[1] == [STALE, STALE]
            took.append(time.monotonic() - start)
        assert min(took) >= 0.02
        assert min(took) < 0.035  # that nothing else held up; twice the wait would be 0.04


def test_an_axis_whose_answer_is_missing_is_stale_and_the_other_is_not():
    def answer(k):
        out = [message(lone_bytes(k, k), STATE)]
        return out if k % 5 == 0 else [*out, message(lone_bytes(k, k), STATE_Y)]

    with on_sync(answer, wait_s=0.1, frames=frames_apart()) as (bench, device):
        for _ in range(20):
            (x, y), status = bench.read()
            k = device.samples
            lost = k % 5 == 0
            assert (x, y) == (k, k - 1 if lost else k)
            assert status == [0, STALE if lost else 0]


def test_an_answer_after_the_wait_is_no_sample_of_this_period_nor_of_the_next():
    may_answer = threading.Event()

    def answer(k):
        may_answer.wait(5.0)
        return [message(state_bytes(k, k, k))]

    may_answer.set()
    with on_sync(answer, wait_s=0.1) as (bench, device):
        assert bench.read()[1] == [0, 0]
        fresh = device.samples
        with bus(bench.driver.options.channel) as spy:
            for _ in range(4):
                may_answer.clear()
                counts, status = bench.read()
                assert counts == [fresh, fresh]
                assert status == [STALE, STALE]
                may_answer.set()
                while spy.recv(5.0).arbitration_id != STATE:
                    pass
        assert bench.read() == ([device.samples] * 2, [0, 0])


def test_where_the_answer_to_an_earlier_sync_comes_first_the_right_one_is_waited_for():
    held = []

    def answer(k):
        held.append(message(state_bytes(k, k, k)))
        if keeps and k % 2:
            return []
        out = held[:]
        held.clear()
        return out

    keeps = False
    with on_sync(answer, wait_s=0.1) as (bench, device):
        keeps = True
        for _ in range(10):
            counts, status = bench.read()
            k = device.samples
            even = k - k % 2
            assert counts == [even, even]
            assert status == [STALE if k % 2 else 0] * 2


def test_after_a_lost_sync_the_samples_are_taken_again():
    """The device misses one SYNC: its sequence falls behind what was asked, and that is settled."""

    class Deaf:
        misses = 0

    def answer(k):
        if Deaf.misses:
            Deaf.misses -= 1
            device.samples -= 1
            return []
        return [message(state_bytes(k, k, k))]

    with on_sync(answer, wait_s=0.1) as (bench, device):
        assert bench.read()[1] == [0, 0]
        Deaf.misses = 1
        stale = [bool(bench.read()[1][0] & STALE) for _ in range(8)]
        assert stale[0]
        assert stale.index(False) <= 3
        assert not any(stale[stale.index(False) :])
        assert bench.read() == ([device.samples] * 2, [0, 0])


def test_flags_of_a_late_answer_count_though_its_position_does_not():
    with on_sync(wait_s=0.05) as (bench, device):
        assert bench.read()[1] == [0, 0]
        k = device.samples
        device.answer = lambda _: []
        bench.peer.send(message(state_bytes(999, 999, k + 1, chain=0)))
        counts, status = bench.read()
        assert counts == [10 * k, 20 * k]
        assert status == [STALE | int(Status.ESTOP)] * 2


def test_commands_reach_the_device_and_sync_alone_asks_for_samples():
    with on_sync() as (bench, device):
        before = device.samples
        for _ in range(5):
            bench.driver.write(bench.outputs)
        for _ in range(3):
            bench.read()
        assert device.samples == before + 3
        assert len(device.commands) >= 5


def test_the_loop_is_told_when_samples_are_older_than_the_read():
    with on_sync() as (bench, _):
        assert bench.driver.exchange_delay_periods == 0.0
    with opened() as bench:
        assert bench.driver.exchange_delay_periods == 0.5


def test_an_answer_that_is_late_by_several_periods_is_never_a_sample_of_this_one():
    late: list[threading.Timer] = []

    def answer(k):
        frame = state_bytes(k, k, k)
        if not delayed:
            return [message(frame)]
        late.append(threading.Timer(0.1, bench.send, (frame,)))
        late[-1].start()
        return []

    delayed = False
    with on_sync(answer, wait_s=0.2) as (bench, _):
        assert bench.read()[1] == [0, 0]
    with on_sync(answer, wait_s=0.005) as (bench, _):
        delayed = True
        try:
            for _ in range(30):
                assert bench.read()[1][0] & STALE
                time.sleep(0.015)
        finally:
            for timer in late:
                timer.join()
    assert len(late) > 5


def test_old_answers_that_follow_one_another_are_no_samples():
    again = {15: 11, 16: 12, 17: 13}

    def answer(k):
        number = again.get(k, k)
        return [message(state_bytes(number, number, number))]

    with on_sync(answer, wait_s=0.1) as (bench, device):
        fresh = []
        while device.samples < 30:
            counts, status = bench.read()
            if not status[0] & STALE:
                assert counts[0] == device.samples
                fresh.append(counts[0])
        assert not set(again) & set(fresh)
        assert fresh[-1] == 30


def test_a_sync_without_room_is_told_and_counts_like_a_command():
    with on_sync(wait_s=0.01) as (bench, device):
        device.answer = lambda _: []
        with bus(bench.driver.options.channel, rx_queue_size=1) as slow:
            bench.send(b"", identifier=0x7FF)
            told = []
            for _ in range(5):
                told.append(bench.read()[1][0] & ~STALE)
                while slow.recv(0):
                    pass
                bench.driver.write(bench.outputs)  # leaves no room for SYNC
            lost = CORRUPT | int(Status.COMMUNICATION_LOST)
            assert told == [CORRUPT, CORRUPT, CORRUPT, lost, lost]


@pytest.mark.parametrize("late", [False, True])
def test_after_a_long_silence_no_answer_is_taken_before_it_is_known_which_sync_it_answers(late):
    mute, held = threading.Event(), []

    def answer(k):
        now, held[:] = held[:], []
        if mute.is_set():
            return []
        (held if lags else now).append(message(state_bytes(k, k, k)))
        return now

    lags = False
    with on_sync(answer) as (bench, device):
        assert bench.read()[1] == [0, 0]
        mute.set()
        wait_s, bench.driver._wait_s = bench.driver._wait_s, 1e-3
        for _ in range(130):
            assert bench.read()[1] == [STALE, STALE]
        mute.clear()
        bench.driver._wait_s, lags = 0.02 if late else wait_s, late
        told = []
        for _ in range(30):
            before = device.samples
            counts, status = bench.read()
            told.append(status[0])
            assert status[0] or counts == [device.samples] * 2
            if device.samples == before:  # no SYNC: what was held comes in this period
                for frame in held:
                    bench.peer.send(frame)
                held.clear()
        assert told[0] == STALE
        assert set(told[6:]) == {STALE if late else 0}


@pytest.mark.parametrize("lost", [(), (24,), (22, 24)])
def test_after_a_wrong_number_the_right_ones_are_taken_again_at_once(lost):
    wrong = 20

    def answer(k):
        return [] if k in lost else [message(state_bytes(k, k, k + 90 if k == wrong else k))]

    with on_sync(answer) as (bench, device):
        fresh = {}
        while device.samples < wrong + 12:
            counts, status = bench.read()
            if status == [0, 0]:
                fresh[device.samples] = counts[0]
        assert all(count == k for k, count in fresh.items())  # each of its own SYNC
        assert set(range(1, wrong)) - set(fresh) <= {1}
        assert set(range(wrong + 8, wrong + 12)) <= set(fresh)
        assert not {wrong + 1, wrong + 2} & set(fresh)
