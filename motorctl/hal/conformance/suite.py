"""All checks together."""

from __future__ import annotations

import pytest

from motorctl.hal.conformance.counts_and_volts import CountsAndVoltsChecks
from motorctl.hal.conformance.declarations import DeclarationChecks
from motorctl.hal.conformance.faults import FaultChecks
from motorctl.hal.conformance.life import LifeChecks
from motorctl.hal.conformance.rig import Rig


class DriverConformance(DeclarationChecks, CountsAndVoltsChecks, FaultChecks, LifeChecks):
    """Inherit it, and define the fixture `rig`."""

    @pytest.fixture
    def rig(self) -> Rig:
        """Override it: give a new rig, and stop it in the end."""
        pytest.fail(f"{type(self).__name__} needs a fixture `rig` that yields a Rig")
