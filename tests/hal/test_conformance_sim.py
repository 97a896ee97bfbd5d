"""The simulated gantry passes the conformance suite, in virtual time and on the wall clock."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from sim_bench import HEAVY_V_S2_M, bare

from motorctl.hal import Channel, Driver
from motorctl.hal.conformance import DriverConformance, Received, Rig
from motorctl_sim import SimDriver

STANDING = bare(inertia_v_s2_m=HEAVY_V_S2_M)
"""A carriage too heavy to be moved, so that its encoder stands where it is put."""


class SimRig(Rig):
    """The machine is in the driver: there is no line to fail, and it cannot be absent."""

    driver_class = SimDriver
    type_name = "sim"
    options: ClassVar = {
        "preset": "published_gantry_clean",
        "plants": {0: STANDING, 1: STANDING},
    }
    # Within its travel of 10 m the carriage sees the whole counter.
    channels = (Channel("x", 0, 0.5e-6, 24, 10.0), Channel("y", 1, 0.1e-3, 16, 10.0))
    period_s = 1e-3
    virtual = True
    own_device = True
    full_scale_v = 10.0
    driver: SimDriver

    def make_driver(self) -> SimDriver:
        driver = super().make_driver()
        assert isinstance(driver, SimDriver)
        self.driver = driver
        return driver

    def start(self) -> None:
        """Do nothing: it is always there."""

    def move_to(self, counts) -> None:
        resolution = np.array([channel.resolution_m for channel in self.channels])
        self.driver._states["position"] = counts * resolution
        self.driver._states["velocity"] = 0.0

    def received(self) -> Received:
        # Behind a converter without steps, dead zone, delay or lag: what the amplifier gives.
        return Received(self.driver.true_state().current_v, None)


class WallClockRig(SimRig):
    virtual = False
    exchanges = 3000

    def pass_period(self, driver: Driver) -> None:
        super().pass_period(driver)
        # Else its time passes only as far as somebody reads.
        self.driver.advance()


class TestInVirtualTime(DriverConformance):
    @pytest.fixture
    def rig(self):
        with SimRig() as rig:
            yield rig


@pytest.mark.wall_clock(lanes=3)
class TestOnTheWallClock(DriverConformance):
    @pytest.fixture
    def rig(self):
        with WallClockRig() as rig:
            yield rig


class MovingRig(SimRig):
    """Carriages that move, with noise, detents and switches: the published machine."""

    options: ClassVar = {"preset": "published_gantry", "seed": 5}
    move_to = Rig.move_to
    received = Rig.received


def test_the_published_machine_gives_the_same_run_twice():
    with MovingRig() as rig:
        DriverConformance().test_virtual_time_gives_the_same_run_twice(rig)
