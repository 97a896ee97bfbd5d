"""A million exchanges with each driver leave no memory behind: minutes each, however busy it is."""

from __future__ import annotations

import pytest
from test_conformance_can import FdRig
from test_conformance_modbus import TcpRig
from test_conformance_serial import SerialRig
from test_conformance_sim import SimRig

from motorctl.hal.conformance import DriverConformance, Rig


@pytest.mark.slow
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("rig_class", [FdRig, SerialRig, TcpRig, SimRig])
def test_a_million_exchanges_leave_no_memory_behind(rig_class: type[Rig]):
    with rig_class() as rig:
        rig.exchanges = 1_000_000
        DriverConformance().test_memory_does_not_grow(rig)
