"""Many exchanges with each driver leave no memory behind: half a minute each, however busy it is.

A million are asked for with `--driver-exchanges`, as docs/drivers/your_own.md shows.
"""

from __future__ import annotations

import pytest
import real_time
from test_conformance_can import FdRig
from test_conformance_modbus import TcpRig
from test_conformance_serial import SerialRig
from test_conformance_sim import SimRig
from tiers import few_of

from motorctl.hal import Driver
from motorctl.hal.conformance import DriverConformance, Rig

EXCHANGES = 100_000


class HurriedCanRig(FdRig):
    """Its next SYNC finds the device done with the commands before: they are in one queue."""

    def pass_period(self, driver: Driver) -> None:
        pass


@pytest.mark.slow
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("rig_class", few_of([HurriedCanRig, SerialRig, TcpRig, SimRig], 1))
def test_many_exchanges_leave_no_memory_behind(rig_class: type[Rig]):
    real_time.does_not_matter()
    with rig_class() as rig:
        rig.exchanges = EXCHANGES
        DriverConformance().test_memory_does_not_grow(rig)
