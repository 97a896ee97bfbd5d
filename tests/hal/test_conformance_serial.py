"""The serial driver passes the conformance suite on a pseudo-terminal, in each of its modes."""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path

import pytest
from peer_rig import PeerRig
from serial_peer import FULL_SCALE_V, SerialPeer

from motorctl.hal import Channel, Driver
from motorctl.hal.conformance import DriverConformance
from motorctl_serial import SerialDriver

pytestmark = pytest.mark.wall_clock(lanes=3)


class SerialRig(PeerRig):
    """The driver on a box behind a pseudo-terminal."""

    driver_class = SerialDriver
    type_name = "serial"
    channels = (Channel("x", 0, 0.5e-6, 32, 10.0), Channel("y", 1, 0.5e-6, 32, 10.0))
    period_s = 5e-3
    volts_tolerance_v = 0.5 * FULL_SCALE_V / 32767 + 1e-9
    full_scale_v = FULL_SCALE_V
    exchanges = 400
    mode = "poll"
    samples_a_fault = 1

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp())
        port = self.folder / "port"
        self.absent = str(port)
        self.options = {
            "port": str(port),
            "baud": None,
            "mode": self.mode,
            "watchdog_s": 20.0,
            "connect_s": 1.0,
            "turnaround_s": 0.15e-3,
        }
        self.peer = SerialPeer(port)
        self.heard = 0

    def stop(self) -> None:
        self.peer.end()
        shutil.rmtree(self.folder)

    def start(self) -> None:
        self.peer.begin()

    def pass_period(self, driver: Driver) -> None:
        # In mode poll the driver waits for its answers; this is for the commands.
        self.wait_until_heard()

    def wait_until_heard(self) -> None:
        """Wait until the box has heard something new, a period at most."""
        deadline = time.monotonic() + self.period_s
        while self.peer.heard == self.heard and time.monotonic() < deadline:
            time.sleep(0.1e-3)
        self.heard = self.peer.heard


class ExchangeRig(SerialRig):
    mode = "exchange"


class StreamRig(SerialRig):
    mode = "stream"
    period_s = 2e-3
    # Two clocks: a read that finds one sample damaged may find the next one, which is good.
    samples_a_fault = 4

    def pass_period(self, driver: Driver) -> None:
        time.sleep(self.period_s)


class TestPoll(DriverConformance):
    @pytest.fixture
    def rig(self):
        with SerialRig() as rig:
            yield rig


@pytest.mark.slow
class TestExchange(DriverConformance):
    @pytest.fixture
    def rig(self):
        with ExchangeRig() as rig:
            yield rig


@pytest.mark.slow
class TestStream(DriverConformance):
    @pytest.fixture
    def rig(self):
        with StreamRig() as rig:
            yield rig
