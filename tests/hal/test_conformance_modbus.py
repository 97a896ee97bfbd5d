"""The Modbus driver passes the conformance suite: TCP on the loopback, RTU on a pseudo-terminal."""

from __future__ import annotations

import shutil
import socket
import tempfile
import time
from pathlib import Path

import pytest
from modbus_peer import VOLTS_PER_COUNT, Coupler, RtuPeer, TcpPeer, layout
from peer_rig import PeerRig

from motorctl.hal import Channel, Driver
from motorctl.hal.conformance import DriverConformance
from motorctl_modbus import ModbusDriver

pytestmark = pytest.mark.wall_clock(lanes=3)


class ModbusRig(PeerRig):
    """The driver on a coupler."""

    driver_class = ModbusDriver
    type_name = "modbus"
    channels = (Channel("x", 0, 0.5e-6, 32, 10.0), Channel("y", 1, 0.5e-6, 32, 10.0))
    volts_tolerance_v = 0.5 * VOLTS_PER_COUNT + 1e-9
    full_scale_v = 32768 * VOLTS_PER_COUNT
    exchanges = 400
    peer: Coupler
    heard = 0

    def stop(self) -> None:
        self.peer.end()

    def start(self) -> None:
        self.peer.begin()

    def pass_period(self, driver: Driver) -> None:
        deadline = time.monotonic() + self.period_s
        # The newest request, that is: one period that was too short must not shift all others.
        while time.monotonic() < deadline and (
            self.peer.heard == self.heard or self.peer.outputs[3] != driver._sequence
        ):
            time.sleep(0.1e-3)
        self.heard = self.peer.heard


class TcpRig(ModbusRig):
    period_s = 2e-3

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self.absent = "127.0.0.1"
        self.options = {"tcp": {"host": "127.0.0.1", "port": port}, **layout()}
        self.peer = TcpPeer(port)


class RtuRig(ModbusRig):
    period_s = 10e-3

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp())
        port = self.folder / "port"
        self.absent = str(port)
        line = {"port": self.absent, "baud": 1_000_000, "parity": "none"}
        line |= {"silence_s": 0.2e-3, "timeout_s": 8e-3}
        self.options = {"rtu": line, **layout()}
        self.peer = RtuPeer(port)

    def stop(self) -> None:
        super().stop()
        shutil.rmtree(self.folder)


class TestTcp(DriverConformance):
    @pytest.fixture
    def rig(self):
        with TcpRig() as rig:
            yield rig


@pytest.mark.slow
class TestRtu(DriverConformance):
    @pytest.fixture
    def rig(self):
        with RtuRig() as rig:
            yield rig
