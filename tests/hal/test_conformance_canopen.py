"""The CANopen driver passes the conformance suite, against nodes of the `canopen` package."""

from __future__ import annotations

import itertools
import time

import can
import numpy as np
import pytest
from canopen_peer import RATED_V, Peer

from motorctl.hal import Channel, Driver
from motorctl.hal.conformance import DriverConformance, Received, Rig
from motorctl_canopen import CanopenDriver

pytestmark = pytest.mark.wall_clock(lanes=3)

NUMBERS = itertools.count()


class CanopenRig(Rig):
    """Two drives on a virtual bus of its own."""

    driver_class = CanopenDriver
    type_name = "canopen"
    channels = (Channel("x", 0, 0.5e-6, 32, 10.0), Channel("y", 1, 0.5e-6, 32, 10.0))
    volts_tolerance_v = 0.5 * RATED_V / 1000 + 1e-9
    full_scale_v = 32.767 * RATED_V
    exchanges = 400
    command_at = "sync"
    peer: Peer | None = None

    def __init__(self) -> None:
        self.absent = f"canopen-conformance{next(NUMBERS)}"
        nodes = {
            axis: {"node": i + 1, "rated_torque_v": RATED_V, "inputs": {"home_switch": 2}}
            for i, axis in enumerate("xy")
        }
        self.options = {
            "interface": "virtual",
            "channel": self.absent,
            "sync": {"wait_s": 2e-3},
            "nodes": nodes,
            "command_at": self.command_at,
            "watchdog_s": 2.0,
            "heartbeat_s": 0.1,
            "open_timeout_s": 1.0,
        }

    def start(self) -> None:
        self.peer = Peer(self.absent)

    def stop(self) -> None:
        if self.peer:
            self.peer.end()

    def pass_period(self, driver: Driver) -> None:
        # The driver itself waits for the answer to SYNC; this is for the commands.
        time.sleep(0.5e-3)

    def move_to(self, counts) -> None:
        for drive, count in zip(self.peer.drives, counts.tolist(), strict=True):
            drive.position = count

    def received(self) -> Received:
        volts = [drive.torque * RATED_V / 1000 for drive in self.peer.drives]
        return Received(np.array(volts), np.array([d.enabled for d in self.peer.drives]))

    def lose_next_reply(self) -> None:
        for drive in self.peer.drives:
            drive.faults.append(None)

    def garble_next_reply(self, random) -> None:
        for drive in self.peer.drives:
            drive.faults.append(random)

    def go_silent(self) -> None:
        for drive in self.peer.drives:
            drive.silent = True

    def speak_again(self) -> None:
        for drive in self.peer.drives:
            drive.silent = False

    def restart(self) -> None:
        for drive in self.peer.drives:
            drive.restart()

    def vanish(self) -> None:
        self.go_silent()
        for drive in self.peer.drives:
            drive.node.nmt.stop_heartbeat()
        off = can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8))
        self.peer.network.bus.send(off)

    def come_back(self) -> None:
        self.restart()
        self.speak_again()


class OnArrivalRig(CanopenRig):
    command_at = "arrival"


class TestCommandsAtSync(DriverConformance):
    @pytest.fixture
    def rig(self):
        with CanopenRig() as rig:
            yield rig


@pytest.mark.slow
class TestCommandsOnArrival(DriverConformance):
    @pytest.fixture
    def rig(self):
        with OnArrivalRig() as rig:
            yield rig
