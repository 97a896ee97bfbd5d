"""Many exchanges with a driver leave no memory behind, however busy the computer is.

A million are asked for with `--driver-exchanges`, as docs/drivers/your_own.md shows.
"""

from __future__ import annotations

import pytest
import real_time
from test_conformance_can import FdRig
from test_conformance_modbus import TcpRig
from test_conformance_serial import SerialRig
from test_conformance_sim import SimRig

from motorctl.hal import Driver
from motorctl.hal.conformance import DriverConformance, Rig

FEW = 20_000
"""What is kept at every seventh exchange shows."""
MANY = 100_000
"""At every twelfth; half a minute with each driver."""


class HurriedCanRig(FdRig):
    """Its next SYNC finds the device done with the commands before: they are in one queue."""

    def pass_period(self, driver: Driver) -> None:
        pass


@pytest.mark.slow
@pytest.mark.timeout(2400)
@pytest.mark.parametrize(
    ("rig_class", "exchanges"),
    [
        (HurriedCanRig, FEW),
        *(
            pytest.param(rig_class, MANY, marks=pytest.mark.long)
            for rig_class in (HurriedCanRig, SerialRig, TcpRig, SimRig)
        ),
    ],
)
def test_many_exchanges_leave_no_memory_behind(rig_class: type[Rig], exchanges: int):
    real_time.does_not_matter()
    with rig_class() as rig:
        rig.exchanges = exchanges
        DriverConformance().test_memory_does_not_grow(rig)
