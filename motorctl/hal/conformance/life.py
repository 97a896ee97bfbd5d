"""From open to close, again and again, and for a long time."""

from __future__ import annotations

import gc
import threading
import time
import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray

from motorctl.hal import RunError, Status
from motorctl.hal.conformance.driver_bench import Bench, at_rest, opened
from motorctl.hal.conformance.rig import Rig, needs, offers

WARM_UP = 300
FREE_BYTES = 4096
"""Growth that one pass of the garbage collector more or less explains."""
LOCKED_S = 0.05
"""The longest that `open` may keep Python's lock. Pure Python gives it up every 5 ms; what is
longer than this is a computation, or a wait, that never does."""
TRIES = 3
BYTES_AN_EXCHANGE = 1.0
"""The smallest thing that can be kept for each exchange takes 8 bytes."""
MOST_BYTES = 65536
"""However many exchanges there are."""


class LifeChecks:
    """Opening, closing, safety, endurance, virtual time."""

    def test_open_names_the_device_that_is_absent(self, rig: Rig) -> None:
        """One line that a person can act on, soon; and nothing is left in the way of a retry."""
        if rig.absent is None:
            pytest.skip(f"{type(rig).__name__} does not say what is `absent`")
        bench = Bench(rig)
        start = time.monotonic()
        with pytest.raises(RunError) as refused:
            bench.open()
        took_s = time.monotonic() - start
        assert rig.absent in str(refused.value)
        assert "\n" not in str(refused.value)
        assert took_s < 10.0, f"open took {took_s:.1f} s to fail"
        bench.safe()
        needs(rig, "start")
        rig.start()
        bench.open()
        bench.until_fresh()
        bench.safe()
        bench.close()

    def test_safe_ends_at_zero_and_disabled(self, rig: Rig) -> None:
        """Once, twice, and in between a write."""
        needs(rig, "start", "received")
        with opened(rig) as bench:
            for times in (1, 2):
                bench.until_obeyed(bench.volts(0.5))
                for _ in range(times):
                    bench.safe()
                bench.until_at_rest()
                told = bench.driver.safe_sent
                assert told in (None, True), f"safe_sent is {told!r}, but the device was told"

    def test_safe_reaches_the_device_without_open(self, rig: Rig) -> None:
        """Where the process that drove the machine has died, another one makes it safe."""
        if rig.own_device:
            pytest.skip("no other driver reaches its device")
        needs(rig, "start", "received")
        with opened(rig) as bench:
            other = Bench(rig)
            bench.until_obeyed(bench.volts(0.5))
            _let_go(bench)
            if at_rest(rig.received()):
                pytest.skip("its close makes the device safe by itself")
            other.safe()
            other.until_at_rest()

    def test_safe_after_vanishing_never_raises(self, rig: Rig) -> None:
        """Nothing can be sent, which is no reason to fail or to linger."""
        needs(rig, "start", "vanish")
        with opened(rig) as bench:
            rig.vanish()
            bench.safe()
            bench.until(lambda: bench.all_have(Status.COMMUNICATION_LOST), "COMMUNICATION_LOST")
            bench.safe()
            bench.close()
            bench.safe()

    def test_closing_leaves_the_device_at_zero_and_disabled(self, rig: Rig) -> None:
        """After `close` nothing raises, and nothing can move the machine."""
        needs(rig, "start", "received")
        with opened(rig) as bench:
            bench.until_obeyed(bench.volts(0.5))
            bench.safe()
            bench.close()
            bench.until_at_rest()
            bench.safe()
            bench.read()
            bench.write()
            bench.safe()
            bench.until_at_rest()

    def test_it_opens_again_after_closing(self, rig: Rig) -> None:
        """With the same object, disabled as the first time."""
        with opened(rig) as bench:
            for _ in range(3):
                bench.exchange(3)
                bench.safe()
                bench.close()
                bench.open()
                bench.ask(0.0, 0)
                bench.until_fresh()

    def test_it_opens_anew_in_another_thread(self, rig: Rig) -> None:
        """As on `motorctl reset` after its bus was lost, while other drivers' axes go on."""
        with opened(rig) as bench:
            for _ in range(TRIES):
                bench.exchange(3)
                _opened_anew_beside(bench)
                bench.ask(0.0, 0)
                bench.until_fresh()

    def test_opening_anew_leaves_other_threads_their_turn(self, rig: Rig) -> None:
        """It may wait as long as it likes, but not with Python's lock in its hand."""
        with opened(rig) as bench:
            pauses_s = [_opened_anew_beside(bench) for _ in range(TRIES)]
            said = f"opening kept Python's lock for {min(pauses_s):.3f} s; limit {LOCKED_S:g} s"
            print(said)
            assert min(pauses_s) <= LOCKED_S, said

    def test_memory_does_not_grow(self, rig: Rig) -> None:
        """A daemon runs for months; `Rig.exchanges` says how many exchanges this makes."""
        needs(rig, "start")
        most = min(FREE_BYTES + BYTES_AN_EXCHANGE * rig.exchanges, MOST_BYTES)
        with opened(rig) as bench:
            tracemalloc.start()
            try:
                bench.exchange(WARM_UP)
                # A leak grows every time; what Python sets aside once does not.
                for _ in range(TRIES):
                    grown = _growth(bench)
                    if grown <= most:
                        break
            finally:
                tracemalloc.stop()
            said = f"{rig.exchanges} exchanges made memory grow by {grown} bytes, limit {most:.0f}"
            print(said)
            assert grown <= most, said
            bench.until_fresh()  # it was no silence that took no memory

    def test_virtual_time_gives_the_same_run_twice(self, rig: Rig) -> None:
        """Bit for bit, however busy the machine is."""
        if not rig.driver_class.supports_virtual_time:
            pytest.skip("it does not support virtual time")
        needs(rig, "start")
        rig.start()
        first, second = _virtual_run(rig, 0.0), _virtual_run(rig, 2e-3)
        assert np.array_equal(first, second)


def _let_go(bench: Bench) -> None:
    """Release the line as a process does that is killed: nothing is made safe before."""
    vars(bench.driver)["safe"] = lambda: None  # `close` may call it
    bench.close()
    del vars(bench.driver)["safe"]
    for _ in range(bench.rig.in_flight + 1):
        bench.rig.pass_period(bench.driver)


def _growth(bench: Bench) -> int:
    """Return by how many bytes `Rig.exchanges` exchanges made Python's memory grow."""
    gc.collect()
    before, _ = tracemalloc.get_traced_memory()
    bench.exchange(bench.rig.exchanges)
    gc.collect()
    after, _ = tracemalloc.get_traced_memory()
    return after - before


def _opened_anew_beside(bench: Bench) -> float:
    """Close and open the driver in a thread; return this one's longest pause meanwhile [s]."""
    driver = bench.driver
    if not driver.reopens:
        pytest.skip("it says that it opens once in a process (`reopens`)")
    wrong: list[Exception] = []

    def anew() -> None:
        try:
            driver.safe()
            driver.close()
            driver.prepare()
            driver.open()
        except Exception as error:
            wrong.append(error)

    thread = threading.Thread(target=anew)
    longest_s, before_s = 0.0, time.perf_counter()
    thread.start()
    while thread.is_alive():
        time.sleep(1e-3)
        now_s = time.perf_counter()
        longest_s, before_s = max(longest_s, now_s - before_s), now_s
    assert not wrong, f"opened in a second thread: {wrong[0]!r}"
    return longest_s


def _virtual_run(rig: Rig, pause_s: float) -> NDArray[np.int64]:
    """Return counts and status of a run with random volts, a row a period."""
    bench = Bench(rig)
    bench.driver.start_virtual_time()
    bench.driver.open()
    volts = bench.volts() if offers(rig, "received") else np.zeros(bench.size)
    rows = np.zeros((300, 2 * bench.size), np.int64)
    for row in rows:
        bench.read()
        row[: bench.size], row[bench.size :] = bench.inputs.counts, bench.inputs.status
        bench.ask(bench.random.uniform(-1.0, 1.0, bench.size) * volts, int(volts.any()))
        bench.write()
        if bench.random.random() < 0.03:
            time.sleep(pause_s)
        bench.driver.advance()
    bench.driver.safe()
    bench.driver.close()
    return rows
