"""A bench for tests of the CANopen driver: options, and periods against a peer."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from canopen_peer import RATED_V, Drive, Peer

from motorctl.hal import Channel, Inputs, Outputs, Status, error_code
from motorctl_canopen import CanopenDriver, CanopenOptions

PERIOD_S = 2e-3
NUMBERS = itertools.count()
FAULT = Status.AMPLIFIER_FAULT


def data(**given: Any) -> dict[str, Any]:
    """Return options of one drive on a bus of its own, with what is given besides."""
    usual = {
        "interface": "virtual",
        "channel": f"canopen-{next(NUMBERS)}",
        "sync": {"wait_s": 0.2},  # the computer may be busy
        "nodes": {"x": {"node": 5, "rated_torque_v": RATED_V}},
        "watchdog_s": 2.0,
        "heartbeat_s": 0.1,
        "open_timeout_s": 1.0,
    }
    return usual | given


def driver(given: dict[str, Any], period_s: float = PERIOD_S) -> CanopenDriver:
    """Make a driver, not yet open."""
    options = CanopenOptions.model_validate(given)
    channels = [Channel(a, i, 0.5e-6, 32, 10.0) for i, a in enumerate(options.nodes)]
    return CanopenDriver(options, channels, period_s)


class Bench:
    """A driver that is open, and the drive at its other end."""

    def __init__(self, made: CanopenDriver, peer: Peer) -> None:
        self.driver, self.peer = made, peer
        size = len(made.channels)
        self.inputs, self.outputs = Inputs(size), Outputs(size)

    @property
    def drive(self) -> Drive:
        return self.peer.drives[0]

    @property
    def status(self) -> Status:
        """The first channel's, without error code."""
        return Status(int(self.inputs.status[0]) & 0xFFF)

    @property
    def code(self) -> int:
        return error_code(int(self.inputs.status[0]))

    def ask(self, volts: float, enable: int) -> None:
        self.outputs.volts[:], self.outputs.enable[:] = volts, enable

    def period(self) -> None:
        self.driver.read(self.inputs)
        self.driver.write(self.outputs)

    def periods(self, count: int) -> None:
        for _ in range(count):
            self.period()

    def until(self, reached: Callable[[], bool], timeout_s: float = 3.0) -> None:
        """Let periods pass until something is so."""
        deadline = time.monotonic() + timeout_s
        while not reached():
            assert time.monotonic() < deadline, f"{self.drive.state}, {self.status}, {self.code:x}"
            self.period()
            time.sleep(1e-4)

    def enable(self, volts: float = 0.0) -> None:
        self.ask(volts, 1)
        self.until(lambda: self.drive.enabled)
        self.periods(3)


@contextmanager
def peer_of(given: dict[str, Any]) -> Iterator[Peer]:
    numbers = tuple(node["node"] for node in given["nodes"].values())
    with Peer(given["channel"], numbers) as peer:
        yield peer


@contextmanager
def opened(**given: Any) -> Iterator[Bench]:
    """Open a driver against its peer."""
    chosen = data(**given)
    with peer_of(chosen) as peer:
        made = driver(chosen)
        made.open()
        try:
            bench = Bench(made, peer)
            bench.periods(2)
            yield bench
        finally:
            made.close()
