"""Counts in and volts out, through the arrays of the loop."""

from __future__ import annotations

from functools import partial, reduce
from operator import or_

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import CODE_MASK, Status
from motorctl.hal.conformance.driver_bench import Bench, at_rest, opened
from motorctl.hal.conformance.rig import Rig, needs, offers

KNOWN_BITS = int(reduce(or_, Status)) | CODE_MASK
CANARIES = 3
"""Entries of other drivers on both sides of this driver's slice."""


class CountsAndVoltsChecks:
    """What goes through is what was given, and nothing else."""

    def test_arrays_are_filled_in_place(self, rig: Rig) -> None:
        """The same arrays, of the same types; what is written is not changed."""
        with opened(rig) as bench:
            inputs, outputs = bench.inputs, bench.outputs
            names = ("counts", "index_counts", "status")
            before = [(getattr(inputs, name), getattr(inputs, name).dtype) for name in names]
            volts, enable = outputs.volts, outputs.enable
            bench.exchange(3)
            for name, (array, dtype) in zip(names, before, strict=True):
                assert getattr(inputs, name) is array, f"inputs.{name} was replaced"
                assert array.dtype == dtype
            assert outputs.volts is volts, "outputs.volts was replaced"
            assert outputs.enable is enable, "outputs.enable was replaced"
            # Volts only where the rig shows what becomes of them: this may be a machine.
            asked = bench.volts(3.0) if offers(rig, "received") else np.zeros(bench.size)
            bench.ask(asked, 0)
            bench.exchange(2)
            assert np.array_equal(volts, asked), "write changed outputs.volts"
            assert not enable.any(), "write changed outputs.enable"

    def test_the_status_has_no_bits_but_those_of_the_contract(self, rig: Rig) -> None:
        """The loop keeps the others for itself: they would make it forget where the axis is."""
        with opened(rig) as bench:
            for _ in range(5):
                bench.exchange()
                told = int(np.bitwise_or.reduce(bench.inputs.status))
                assert not told & ~KNOWN_BITS, f"bits of no meaning: {told & ~KNOWN_BITS:#x}"

    def test_only_its_own_slices_are_touched(self, rig: Rig) -> None:
        """The loop gives each driver slices of arrays that all drivers share."""
        needs(rig, "start", "move_to")
        with opened(rig) as bench:
            size = bench.size
            whole = _give_slices(bench)
            guard = [array.copy() for array in whole]
            wanted = bench.random_counts()
            rig.move_to(wanted)
            bench.until_at(wanted)
            bench.exchange(5)
            for array, before in zip(whole, guard, strict=True):
                assert np.array_equal(array[:CANARIES], before[:CANARIES])
                assert np.array_equal(array[CANARIES + size :], before[CANARIES + size :])
            # Other arrays on the next call: whoever keeps the first ones fills the wrong place.
            first = whole[0].copy()
            _give_slices(bench)
            bench.until_at(wanted)
            assert np.array_equal(whole[0], first)

    def test_counts_come_through_over_the_whole_width_of_the_counter(self, rig: Rig) -> None:
        """Also where the counter wraps; each channel its own."""
        needs(rig, "start", "move_to")
        with opened(rig) as bench:
            halves = [2 ** (channel.counter_bits - 1) for channel in rig.channels]
            for place in (0.0, 1.0, -1.0, 0.5, -0.5, 0.999):
                for step in (0, 1, -1, 2):
                    counts = [_wrapped(int(place * half) + step, half) for half in halves]
                    wanted = np.array(counts, np.int64)
                    rig.move_to(wanted)
                    bench.until_at(wanted)
            for _ in range(20):
                wanted = bench.random_counts()
                rig.move_to(wanted)
                bench.until_at(wanted)

    def test_volts_arrive_within_quantisation(self, rig: Rig) -> None:
        """Each channel its own, of both signs, over the whole range."""
        needs(rig, "start", "received")
        with opened(rig) as bench:
            for share in (0.0, 1e-3, -0.1, 0.5, -0.999, 1.0, -1.0):
                bench.until_obeyed(bench.volts(share))

    def test_outputs_are_zero_and_disabled_until_they_are_written(self, rig: Rig) -> None:
        """Opening moves nothing, nor does reading, the first time and the second."""
        needs(rig, "start", "received")
        rig.start()
        bench = Bench(rig)
        for _ in range(2):
            bench.open()
            try:
                for _ in range(5):
                    bench.read()
                    rig.pass_period(bench.driver)
                    assert at_rest(rig.received()), str(rig.received())
                bench.until_obeyed(bench.volts(0.5))
                bench.safe()
                for _ in range(rig.within_exchanges):
                    rig.pass_period(bench.driver)
            finally:
                bench.safe()
                bench.close()

    def test_a_disabled_channel_gets_zero_whatever_volts_says(self, rig: Rig) -> None:
        """And only that channel."""
        needs(rig, "start", "received")
        with opened(rig) as bench:
            volts = bench.volts(0.7)
            patterns = [np.eye(bench.size, dtype=np.uint8)[i] for i in range(bench.size)]
            for enable in (*patterns, np.zeros(bench.size, np.uint8), 1 - patterns[0]):
                bench.until_obeyed(volts, enable)
                assert not rig.received().volts[enable == 0].any(), "disabled, but not zero"

    def test_volts_beyond_the_range_are_clamped_and_never_wrap(self, rig: Rig) -> None:
        """A command of full thrust never becomes one of full thrust the other way."""
        needs(rig, "start", "received")
        with opened(rig) as bench:
            limits = np.array([channel.max_voltage_v for channel in rig.channels])
            for factor in (1.001, 1.9, 2.1, -3.0, 65.6, -6553.7, 1e6, -1e12, 1e300):
                asked = np.sign(bench.volts()) * limits * factor
                bench.ask(asked)
                bench.until(
                    partial(_clamped, rig, asked, limits),
                    f"volts {asked.tolist()} clamped to {limits.tolist()} or full scale",
                )

    def test_volts_that_are_no_number_never_reach_the_amplifier(self, rig: Rig) -> None:
        """NaN gives zero and disable; infinity does that or is clamped."""
        needs(rig, "start", "received")
        with opened(rig) as bench:
            for i in range(bench.size):
                for bad in (np.nan, np.inf, -np.inf):
                    bench.until_obeyed(bench.volts(0.3))
                    bench.outputs.volts[i] = bad
                    bench.until(
                        partial(_harmless, rig, i, bad),
                        f"zero and disable for {bad} on channel {i}",
                    )


def _give_slices(bench: Bench) -> list[NDArray[np.int64] | NDArray[np.uint32]]:
    """Replace the bench's arrays by slices of larger ones; return the larger ones."""
    size, total = bench.size, bench.size + 2 * CANARIES
    own = slice(CANARIES, CANARIES + size)
    counts = np.full(total, 0x5A5A5A5A5A5A, np.int64)
    index_counts = np.full(total, -0x5A5A5A5A5A5A, np.int64)
    status = np.full(total, 0xFFFFFFFF, np.uint32)
    # What stands beside is enabled at full volts: whoever takes the wrong place is noticed.
    volts, enable = np.full(total, 1e3), np.ones(total, np.uint8)
    volts[own], enable[own] = 0.0, 0
    inputs, outputs = bench.inputs, bench.outputs
    inputs.counts, inputs.index_counts, inputs.status = counts[own], index_counts[own], status[own]
    outputs.volts, outputs.enable = volts[own], enable[own]
    return [counts, index_counts, status]


def _wrapped(count: int, half: int) -> int:
    return (count + half) % (2 * half) - half


def _clamped(rig: Rig, asked: NDArray[np.float64], limits: NDArray[np.float64]) -> bool:
    received = rig.received()
    size, slack = np.abs(received.volts), rig.volts_tolerance_v
    highest = np.minimum(np.abs(asked), rig.full_scale_v) + slack
    right_way = np.sign(received.volts) == np.sign(asked)
    return bool((right_way & (size >= limits - slack) & (size <= highest)).all())


def _harmless(rig: Rig, i: int, bad: float) -> bool:
    received = rig.received()
    assert np.isfinite(received.volts).all(), f"the amplifiers got {received.volts.tolist()}"
    volts = received.volts[i]
    off = volts == 0.0 and (received.enabled is None or not received.enabled[i])
    if np.isnan(bad):
        return bool(off)
    limit = rig.channels[i].max_voltage_v - rig.volts_tolerance_v
    return bool(off or (np.sign(volts) == np.sign(bad) and limit <= abs(volts) < np.inf))
