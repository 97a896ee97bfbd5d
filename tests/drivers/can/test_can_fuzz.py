"""Random frames: no exception, no wrong acceptance, no growth."""

import gc
import tracemalloc

import can
import numpy as np
import pytest
from can_bench import (
    PERIOD_S,
    STATE,
    bits,
    channels,
    frames_of_both,
    message,
    on_sync,
    opened,
    options,
    random_bytes,
    state_bytes,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.hal import Inputs, Status
from motorctl_can import CanDriver, CanOptions, kernels

pytestmark = pytest.mark.wall_clock(lanes=3)

STALE = int(Status.STALE)


def random_message(random):
    length = int(random.integers(0, 65 if random.random() < 0.2 else 9))
    near = random.random() < 0.7
    return can.Message(
        arbitration_id=STATE if near else int(random.integers(0, 1 << 29)),
        is_extended_id=random.random() < 0.1,
        is_remote_frame=random.random() < 0.05,
        is_error_frame=random.random() < 0.02,
        is_fd=random.random() < 0.2,
        data=random.bytes(8 if random.random() < 0.6 else length),
        dlc=int(random.integers(0, 16)) if random.random() < 0.1 else None,
    )


def test_random_frames_raise_nothing_and_only_frames_in_sequence_are_accepted():
    random = np.random.default_rng(1)
    with opened() as bench:
        last, accepted, silent = 0, 0, 0
        for _ in range(4000):
            sent = random_message(random)
            bench.peer.send(sent)
            before = bench.inputs.counts.tolist()
            counts, status = bench.read()
            fits = (
                sent.arbitration_id == STATE
                and not (sent.is_extended_id or sent.is_remote_frame or sent.is_error_frame)
                and len(sent.data) == sent.dlc == 8
            )
            silent += 1
            if not status[0] & STALE:
                assert fits
                step = (sent.data[7] - last) % 256
                restarted = status[0] & Status.DEVICE_RESTARTED
                assert 0 < step < 128 or restarted or silent > 128
                assert counts[0] == int.from_bytes(sent.data[:3], "little", signed=True)
                last, accepted, silent = sent.data[7], accepted + 1, 0
            else:
                assert counts == before
        assert accepted > 500
        assert bench.driver._link is not None


class Numbers:
    """What docs/drivers/can.md promises of sequence numbers of 8 bits, as sets of numbers."""

    def __init__(self) -> None:
        self.resynchronised = 0
        self.begin(0, 0)

    def begin(self, newest, right):
        self.newest, self.right, self.refused = newest, right, []

    def takes(self, number):
        if number == self.newest:
            return False
        if number in {(self.newest + k) % 256 for k in range(1, 128)}:
            self.begin(number, self.newest)
            return True
        self.refused.append(number)
        due = {(self.right + k) % 256 for k in range(1, 17)}
        may_be_old = {(self.newest - k) % 256 for k in range(17)}
        in_a_row = self.refused[-3:] == [(number - k) % 256 for k in (2, 1, 0)]
        if in_a_row and number in due - may_be_old:
            self.resynchronised += 1
            self.begin(number, (number - 1) % 256)
            return True
        return False


@pytest.mark.slow
def test_a_million_random_frames_at_the_decoder():
    """Each accepted count is the frame's own; a sequence goes forward or is refused."""
    frames = random_bytes(2, 1_000_000, 8)
    frames[:, 6] &= 0x0F  # a device that does not restart
    # numbers that follow one another would be rare
    begin = np.arange(0, len(frames) - 2, 50)
    for k in (1, 2):
        frames[begin + k, 7] = frames[begin, 7] + k
    numbers = frames[:, 7].astype(np.int64)
    x = frames[:, :3].astype(np.int64) @ np.array([1, 1 << 8, 1 << 16])
    x -= (x >> 23) << 24
    with opened({STATE: state_bytes(0, 0, 0, boot=0)}) as bench:
        driver, wanted, silent = bench.driver, Numbers(), 0
        tables = (driver._state_signals, driver._states, driver._records)
        inputs = Inputs(2)
        shown = (inputs.counts, inputs.index_counts, inputs.status)
        results = {kernels.ACCEPTED: 0, kernels.DUPLICATE: 0, kernels.BACKWARDS: 0}
        for row, number, count in zip(frames, numbers.tolist(), x.tolist(), strict=True):
            found = driver._took(*tables, 0, row, kernels.FREE)
            results[found] += 1
            repeats = number == wanted.newest
            if silent >= 128:
                wanted.begin(number, number)
                assert found == kernels.ACCEPTED
            elif wanted.takes(number):
                assert found == kernels.ACCEPTED
            else:
                assert found == (kernels.DUPLICATE if repeats else kernels.BACKWARDS)
            driver._deliver(driver._states, driver._records, 0, *shown)
            silent += 1
            if found == kernels.ACCEPTED:
                assert inputs.counts[0] == count
                silent = 0
        assert wanted.resynchronised > 200
        assert min(results.values()) > 2_000


DEEDS = st.tuples(st.sampled_from(["send", "lose", "send again"]), st.integers(1, 17))


@pytest.mark.slow
@settings(max_examples=200)
@given(st.integers(4, 12), st.sampled_from([kernels.FREE, kernels.AFTER_SYNC]), st.lists(DEEDS))
def test_samples_that_come_again_are_never_taken_for_new_ones(width, phase, deeds):
    """Whatever was lost before: the last 17 may come again, or late, in their order."""
    frames = frames_of_both()
    frames["positions"]["length"] = 12
    frames["positions"]["signals"]["sequence"] = bits("sequence", 64, width)
    driver = CanDriver(options(frames=frames, fd=True), channels(), PERIOD_S)
    driver.prepare()
    tables = (driver._state_signals, driver._states, driver._records)
    k, taken = 0, []
    for deed, many in deeds:
        if deed == "send again":  # in a narrower counter, what is older looks new
            first = max(1, k + 1 - min(many, 1 << width - 1))
        else:
            first, k = k + 1, k + many
        if deed == "lose":
            continue
        for number in range(first, k + 1):
            if phase == kernels.AFTER_SYNC:
                driver._sync_sent(driver._states, driver._records)
            row = np.zeros(12, np.uint8)
            row[8:10] = divmod(number % (1 << width), 256)[::-1]
            if driver._took(*tables, 0, row, phase) == kernels.ACCEPTED:
                taken.append(number)
    assert taken == sorted(set(taken))


@pytest.mark.slow
def test_memory_does_not_grow_over_many_exchanges():
    with opened() as bench:

        def exchanges(first, many):
            for k in range(first, first + many):
                bench.peer.send(message(state_bytes(k, k, k)))
                bench.peer.send(message(b"", 0x7FF))
                bench.peer.send(message(state_bytes(k, k, k)[:3]))
                bench.driver.read(bench.inputs)
                bench.outputs.volts[0] = k % 10
                bench.driver.write(bench.outputs)
                bench.sent()

        exchanges(1, 500)
        tracemalloc.start()
        try:
            exchanges(501, 200)
            gc.collect()
            before, _ = tracemalloc.get_traced_memory()
            exchanges(701, 3000)
            gc.collect()
            after, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert after - before < 3000  # less than a byte an exchange


def test_the_garbage_collector_is_not_needed():
    """The loop runs without it: neither good exchanges nor failing ones leave cycles."""
    with on_sync(wait_s=0.02) as (bench, _):
        for _ in range(20):
            bench.read()
            bench.driver.write(bench.outputs)
    with opened() as bench:
        bench.driver._link._bus.shutdown()
        gc.collect()
        gc.disable()
        try:
            for _ in range(200):
                bench.read()
                bench.driver.write(bench.outputs)
            assert gc.collect() < 50
        finally:
            gc.enable()


def test_the_driver_is_what_type_can_names():
    assert CanDriver.Options is CanOptions
