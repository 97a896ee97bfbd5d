"""Replies that are lost, damaged or missing; devices that restart or vanish."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import FAULT_BITS, Status
from motorctl.hal.conformance.driver_bench import NOT_FRESH, Bench, opened
from motorctl.hal.conformance.rig import Rig, needs, offers

RESTARTED = Status.DEVICE_RESTARTED | Status.ENCODER_LOST
WAITS = 200
"""Exchanges whose calls are timed."""
DAMAGED_EVERY = 100
"""Exchanges after which a reply is damaged anew: one that this computer's pause made late is no
longer waited for, and tells nothing. Larger waits longer, smaller damages several. Convention."""


class FaultChecks:
    """Trouble becomes status bits, never an exception, a wait, or a wrong count."""

    def test_a_lost_reply_is_stale(self, rig: Rig) -> None:
        """The count repeats and the status says that it does; then all is well again."""
        needs(rig, "start", "move_to", "lose_next_reply")
        with opened(rig) as bench:
            for _ in range(5):
                _stale_after(bench, rig.lose_next_reply, Status.STALE)

    def test_a_damaged_reply_never_becomes_a_count(self, rig: Rig) -> None:
        """Whatever is damaged: the count repeats, as for a lost one."""
        needs(rig, "start", "move_to", "garble_next_reply")
        with opened(rig) as bench:
            for _ in range(50):
                _stale_after(bench, lambda: rig.garble_next_reply(bench.random), Status.STALE)

    def test_a_damaged_reply_is_told_as_corrupt(self, rig: Rig) -> None:
        """Whoever looks for the cause can tell a bad line from a slow device."""
        needs(rig, "start", "garble_next_reply")
        with opened(rig) as bench:
            for _ in range(10):
                bench.until(_told(bench, rig), "CORRUPT after a damaged reply")
                bench.until_fresh()

    def test_silence_is_stale_for_as_long_as_it_lasts(self, rig: Rig) -> None:
        """It is no fault by itself: how long it may last is the loop's business."""
        needs(rig, "start", "move_to", "go_silent", "speak_again")
        with opened(rig) as bench:
            before, after = bench.random_counts(), bench.random_counts()
            rig.move_to(before)
            bench.until_at(before)
            rig.go_silent()
            bench.exchange(rig.in_flight)
            rig.move_to(after)
            for _ in range(50):
                bench.exchange()
                assert bench.all_have(Status.STALE), f"not STALE while silent: {bench}"
                assert not bench.has(FAULT_BITS), f"silence alone is no fault: {bench}"
                assert bench.shows(before), f"not the last count {before.tolist()}: {bench}"
            rig.speak_again()
            bench.until_at(after)

    def test_no_call_waits_for_a_silent_device(self, rig: Rig) -> None:
        """Time-outs lie within the period; a machine that is busy for a moment is forgiven."""
        needs(rig, "start", "go_silent")
        with opened(rig) as bench:
            rig.go_silent()
            bench.exchange(rig.in_flight)
            _calls_are_short(bench)

    def test_a_vanished_device_is_communication_lost(self, rig: Rig) -> None:
        """Without an exception or a wait, and the count stands."""
        needs(rig, "start", "vanish")
        with opened(rig) as bench:
            before = bench.inputs.counts.copy()
            rig.vanish()
            bench.until(lambda: bench.all_have(Status.COMMUNICATION_LOST), "COMMUNICATION_LOST")
            assert bench.shows(before), f"not the last count {before.tolist()}: {bench}"
            _calls_are_short(bench)
            assert bench.all_have(Status.COMMUNICATION_LOST), str(bench)

    def test_close_and_open_bring_a_vanished_device_back(self, rig: Rig) -> None:
        """Nothing of the old connection is in the way."""
        needs(rig, "start", "vanish", "come_back")
        with opened(rig) as bench:
            rig.vanish()
            bench.until(lambda: bench.all_have(Status.COMMUNICATION_LOST), "COMMUNICATION_LOST")
            bench.safe()
            bench.close()
            rig.come_back()
            bench.open()
            bench.until_fresh()

    def test_a_restarted_device_is_never_taken_for_the_old_one(self, rig: Rig) -> None:
        """Its count began anew, so no count of it is good until the driver is opened again."""
        needs(rig, "start", "move_to", "restart")
        with opened(rig) as bench:
            before = bench.random_counts()
            rig.move_to(before)
            bench.until_at(before)
            rig.restart()

            def told() -> bool:
                good = not bench.has(FAULT_BITS)
                assert not good or bench.shows(before), f"a new count without a fault: {bench}"
                return bench.all_have(RESTARTED)

            bench.until(told, "DEVICE_RESTARTED and ENCODER_LOST")
            bench.safe()
            bench.close()
            bench.open()
            bench.until_fresh()

    def test_nothing_that_happens_makes_it_raise(self, rig: Rig) -> None:
        """All faults that the rig offers, mixed, with all kinds of volts."""
        needs(rig, "start", "received")
        with opened(rig) as bench:
            random = bench.random
            single: list[Callable[[], None]] = []
            if offers(rig, "lose_next_reply"):
                single.append(rig.lose_next_reply)
            if offers(rig, "garble_next_reply"):
                single.append(lambda: rig.garble_next_reply(random))
            if offers(rig, "go_silent") and offers(rig, "speak_again"):
                single += [rig.go_silent, rig.speak_again]
            # The last ones are for good.
            final = [rig.restart] if offers(rig, "restart") else []
            final += [rig.vanish] if offers(rig, "vanish") else []
            for last in (None, *final):
                if last is not None:
                    last()
                for _ in range(100):
                    if single and random.random() < 0.3:
                        single[random.integers(len(single))]()
                    bench.ask(
                        _any_volts(random, bench.size), random.integers(0, 3, bench.size, np.uint8)
                    )
                    bench.exchange()
                    assert np.isfinite(rig.received().volts).all()


def _any_volts(random: np.random.Generator, size: int) -> NDArray[np.float64]:
    extremes = np.array([0.0, -0.0, 1.0, -10.0, 1e3, -1e300, 5e-324, np.nan, np.inf, -np.inf])
    return random.choice(extremes, size)


def _told(bench: Bench, rig: Rig) -> Callable[[], bool]:
    """Return what damages a reply now and then, until one is told as corrupt."""
    exchanges = itertools.count()

    def told() -> bool:
        if bench.has(Status.CORRUPT):
            return True
        if next(exchanges) % DAMAGED_EVERY == 0:
            rig.garble_next_reply(bench.random)
        return False

    return told


def _stale_after(bench: Bench, fault: Callable[[], None], bits: Status) -> None:
    """Make one reply fail while the encoder moves; see the count repeat, then the new one."""
    rig = bench.rig
    before, after = bench.random_counts(), bench.random_counts()
    rig.move_to(before)
    bench.until_at(before)
    fault()
    rig.move_to(after)
    last = before

    def repeated() -> bool:
        nonlocal last
        if bench.has(Status.STALE):
            assert bench.shows(last), f"STALE, but the count changed from {last.tolist()}: {bench}"
        else:
            good = bench.shows(before) or bench.shows(after)
            assert good, f"never at that place, but at {before.tolist()}, {after.tolist()}: {bench}"
        last = bench.inputs.counts.copy()
        return bench.all_have(bits)

    # The status of the read before the fault is none of its consequences.
    bench.exchange()
    bench.until(repeated, f"{bits!s} after the fault")
    assert not bench.has(NOT_FRESH & ~(Status.STALE | Status.CORRUPT)), str(bench)
    bench.until_at(after)


def _calls_are_short(bench: Bench) -> None:
    """Time read and write; most within the period, none far beyond it."""
    took_s = np.empty(WAITS)
    for i in range(WAITS):
        start = time.perf_counter()
        bench.read()
        bench.write()
        took_s[i] = time.perf_counter() - start
        bench.rig.pass_period(bench.driver)
    period_s = bench.rig.period_s
    median_s, late_s = float(np.median(took_s)), float(np.quantile(took_s, 0.98))
    said = (
        f"read and write took {median_s * 1e6:.0f} us (median), {late_s * 1e6:.0f} us (98 %), "
        f"{took_s.max() * 1e6:.0f} us (longest); the period is {period_s * 1e6:.0f} us"
    )
    print(said)
    assert median_s <= 1.5 * period_s + 0.5e-3, said
    assert late_s <= 1.5 * period_s + 50e-3, said
