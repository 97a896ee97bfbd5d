"""The CAN driver passes the conformance suite: CAN FD with SYNC, and classic CAN free-running."""

from __future__ import annotations

import itertools
import time

import pytest
from can_peer import ClassicPeer, FdPeer, Peer, classic_options, fd_options
from peer_rig import PeerRig

from motorctl.hal import Channel, Driver
from motorctl.hal.conformance import DriverConformance
from motorctl_can import CanDriver

pytestmark = pytest.mark.wall_clock(lanes=3)

NUMBERS = itertools.count()


class CanRig(PeerRig):
    """The driver on a virtual bus of its own."""

    driver_class = CanDriver
    type_name = "can"
    volts_tolerance_v = 0.5 * 0.0005 + 1e-9
    full_scale_v = 32768 * 0.0005
    exchanges = 400
    peer_class: type[Peer]
    peer: Peer | None = None

    def stop(self) -> None:
        if self.peer:
            self.peer.end()

    def start(self) -> None:
        self.peer = self.peer_class(self.absent, self.period_s)

    def vanish(self) -> None:
        self.peer.go_off_the_bus()

    def come_back(self) -> None:
        self.peer.restart()
        self.peer.silent = False


class FdRig(CanRig):
    peer_class = FdPeer
    channels = (Channel("x", 0, 0.5e-6, 32, 10.0), Channel("y", 1, 0.5e-6, 32, 10.0))
    period_s = 5e-3

    def __init__(self) -> None:
        self.absent = f"conformance{next(NUMBERS)}"
        self.options = fd_options(self.absent)

    def pass_period(self, driver: Driver) -> None:
        # The driver itself waits for the answer to SYNC; this is for the commands.
        time.sleep(0.2e-3)


class ClassicRig(CanRig):
    peer_class = ClassicPeer
    channels = (Channel("x", 0, 0.5e-6, 16, 10.0), Channel("y", 1, 0.5e-6, 16, 10.0))
    period_s = 2e-3
    # Two clocks: a read that finds one sample damaged may find the next one, which is good.
    samples_a_fault = 4

    def __init__(self) -> None:
        self.absent = f"conformance{next(NUMBERS)}"
        self.options = classic_options(self.absent)


@pytest.mark.slow
class TestCanFdWithSync(DriverConformance):
    @pytest.fixture
    def rig(self):
        with FdRig() as rig:
            yield rig


class TestClassicCanFreeRunning(DriverConformance):
    @pytest.fixture
    def rig(self):
        with ClassicRig() as rig:
            yield rig
