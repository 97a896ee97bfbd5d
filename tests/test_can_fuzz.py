"""Random frames: no exception, no wrong acceptance, no growth."""

import gc
import tracemalloc

import can
import numpy as np
import pytest
from can_bench import STATE, message, on_sync, opened, random_bytes, state_bytes

from motorctl.hal import Inputs, Status
from motorctl_can import CanDriver, CanOptions, kernels

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


@pytest.mark.slow
def test_five_million_random_frames_at_the_decoder():
    """Each accepted count is the frame's own; a sequence goes forward or is refused."""
    frames = random_bytes(2, 5_000_000, 8)
    frames[:, 6] &= 0x0F  # a device that does not restart
    numbers = frames[:, 7].astype(np.int64)
    x = frames[:, :3].astype(np.int64) @ np.array([1, 1 << 8, 1 << 16])
    x -= (x >> 23) << 24
    with opened({STATE: state_bytes(0, 0, 0, boot=0)}) as bench:
        driver, last, silent = bench.driver, 0, 0
        behind = behind_last = before = resynchronised = 0
        tables = (driver._state_signals, driver._states, driver._records)
        inputs = Inputs(2)
        shown = (inputs.counts, inputs.index_counts, inputs.status)
        results = {kernels.ACCEPTED: 0, kernels.DUPLICATE: 0, kernels.BACKWARDS: 0}
        for row, number, count in zip(frames, numbers.tolist(), x.tolist(), strict=True):
            found = driver._took(*tables, 0, row, kernels.FREE)
            step = (number - last) % 256
            wanted = (
                kernels.DUPLICATE
                if step == 0
                else kernels.ACCEPTED
                if step < 128
                else kernels.BACKWARDS
            )
            if silent >= 128:
                wanted = kernels.ACCEPTED
            if wanted == kernels.BACKWARDS:
                behind = behind + 1 if number == (behind_last + 1) % 256 and behind else 1
                behind_last = number
                if behind >= 3 and (number - before) % 256 <= 16:
                    wanted = kernels.ACCEPTED
                    resynchronised += 1
            assert found == wanted
            results[found] += 1
            driver._deliver(driver._states, driver._records, 0, *shown)
            began_anew, silent = silent >= 128, silent + 1
            if found == kernels.ACCEPTED:
                assert inputs.counts[0] == count
                before = number if began_anew else last
                last, silent, behind = number, 0, 0
        assert resynchronised < 100  # three numbers that follow each other, by chance
        assert min(results.values()) > 10_000


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
