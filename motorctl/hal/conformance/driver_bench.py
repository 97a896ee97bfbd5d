"""A driver on its rig, with the arrays of the loop: exchanges, one after another."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from motorctl.hal import FAULT_BITS, Inputs, Outputs, Status
from motorctl.hal.conformance.rig import Received, Rig, needs

NOT_FRESH = FAULT_BITS | Status.STALE | Status.CORRUPT | Status.BUS_OFF | Status.DEVICE_RESTARTED


class Bench:
    """What the loop does with a driver, and what a test asks in between."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.driver = rig.make_driver()
        self.size = len(rig.channels)
        self.inputs, self.outputs = Inputs(self.size), Outputs(self.size)
        self.is_open = False
        self.random = np.random.default_rng(1)

    def open(self) -> None:
        """Open the driver as the loop does."""
        if self.rig.virtual:
            self.driver.start_virtual_time()
        self.driver.prepare()
        self.driver.open()
        self.is_open = True

    def read(self) -> None:
        """Read; a driver that raises fails the test."""
        try:
            self.driver.read(self.inputs)
        except Exception as error:
            pytest.fail(f"read raised {error!r}; it may never raise")

    def write(self) -> None:
        """Write; a driver that raises fails the test."""
        try:
            self.driver.write(self.outputs)
        except Exception as error:
            pytest.fail(f"write raised {error!r}; it may never raise")

    def close(self) -> None:
        """Close the driver as the loop does, once."""
        self.is_open = False
        self.driver.close()

    def safe(self) -> None:
        """Make the outputs safe; a driver that raises or lingers fails the test."""
        start = time.perf_counter()
        try:
            self.driver.safe()
        except Exception as error:
            pytest.fail(f"safe raised {error!r}; it may never raise")
        took = time.perf_counter() - start
        assert took <= self.rig.safe_s, f"safe took {took:.1f} s"

    def exchange(self, times: int = 1) -> None:
        """Read, write, and let a period pass."""
        for _ in range(times):
            self.read()
            self.write()
            self.rig.pass_period(self.driver)

    def ask(self, volts: float | NDArray[np.float64], enable: int | NDArray[np.uint8] = 1) -> None:
        """Set what the following exchanges write."""
        self.outputs.volts[:], self.outputs.enable[:] = volts, enable

    def until(self, reached: Callable[[], bool], what: str, *, exchange: bool = True) -> None:
        """Exchange until something is so; fails where that takes too long."""
        deadline = time.monotonic() + self.rig.patience_s
        tries = 0
        while not reached():
            tries += 1
            late = tries > self.rig.within_exchanges and time.monotonic() > deadline
            assert not late, f"{what}: not within {tries - 1} exchanges; {self}"
            if exchange:
                self.exchange()
            else:
                self.rig.pass_period(self.driver)

    def until_fresh(self) -> None:
        """Exchange until every channel has a new sample and no fault."""
        self.until(self.fresh, "a new sample on every channel, without a fault")

    def until_at_rest(self) -> None:
        """Wait, without exchanges, until the device has zero and disable on every channel."""
        self.until(lambda: at_rest(self.rig.received()), "zero and disabled", exchange=False)

    def until_at(self, counts: NDArray[np.int64]) -> None:
        """Exchange until every channel shows its count, fresh."""
        self.until(lambda: self.fresh() and self.shows(counts), f"counts {counts.tolist()}")

    def until_obeyed(
        self, volts: NDArray[np.float64], enable: NDArray[np.uint8] | None = None
    ) -> None:
        """Exchange until the device has these volts; those enabled if `enable` is given, else all.

        Disabled channels are given their volts too; they are to end at zero.
        """
        on = np.ones(self.size, np.uint8) if enable is None else enable
        wanted = np.where(on != 0, volts, 0.0)
        self.ask(volts, on)

        def obeyed() -> bool:
            received = self.rig.received()
            near = bool((np.abs(received.volts - wanted) <= self.rig.volts_tolerance_v).all())
            return near and (received.enabled is None or np.array_equal(received.enabled, on != 0))

        self.until(obeyed, f"volts {wanted.tolist()}, enable {on.tolist()}")

    def fresh(self) -> bool:
        """Return whether the last read brought a good new sample for every channel."""
        return not self.has(NOT_FRESH)

    def has(self, bits: Status) -> bool:
        """Return whether any channel has one of these bits."""
        return bool((self.inputs.status & np.uint32(bits)).any())

    def all_have(self, bits: Status) -> bool:
        """Return whether every channel has all of these bits."""
        return bool((self.inputs.status & np.uint32(bits) == np.uint32(bits)).all())

    def shows(self, counts: NDArray[np.int64]) -> bool:
        """Return whether the counts are these, modulo the width of each counter."""
        return all(
            (int(shown) - int(wanted)) % 2**channel.counter_bits == 0
            for shown, wanted, channel in zip(
                self.inputs.counts, counts, self.rig.channels, strict=True
            )
        )

    def random_counts(self) -> NDArray[np.int64]:
        """Return a count for each channel from the middle half of its range, none the same."""
        halves = [2 ** (channel.counter_bits - 2) for channel in self.rig.channels]
        counts = [int(self.random.integers(1, half)) for half in halves]
        return np.array([count ^ (i + 1) for i, count in enumerate(counts)], np.int64)

    def volts(self, share: float = 1.0) -> NDArray[np.float64]:
        """Return volts for each channel within a share of its limit, both signs, none the same."""
        limits = np.array([channel.max_voltage_v for channel in self.rig.channels])
        parts = (np.arange(self.size) + 1.0) / self.size * np.where(np.arange(self.size) % 2, -1, 1)
        return np.asarray(limits * parts * share)

    def __str__(self) -> str:
        status = [str(Status(int(word))) for word in self.inputs.status]
        return f"counts {self.inputs.counts.tolist()}, status {status}"


def at_rest(received: Received) -> bool:
    """Return whether every amplifier has zero volts and is disabled."""
    return not received.volts.any() and (received.enabled is None or not received.enabled.any())


@contextlib.contextmanager
def opened(rig: Rig) -> Iterator[Bench]:
    """Start the device, open the driver, exchange until all is well; close in the end."""
    needs(rig, "start")
    rig.start()
    bench = Bench(rig)
    bench.open()
    try:
        bench.until_fresh()
        yield bench
    finally:
        with contextlib.suppress(Exception):  # checks of `safe` call it themselves
            bench.driver.safe()
        if bench.is_open:
            bench.close()
