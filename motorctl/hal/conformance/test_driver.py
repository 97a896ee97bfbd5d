"""The suite for a driver that the command line names."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator

import pytest

from motorctl.hal import Channel, driver_class
from motorctl.hal.conformance import DriverConformance, Rig


class NamedRig(Rig):
    """A driver by its name, without hooks."""


class OpenedRig(NamedRig):
    """The same, with its device there."""

    def start(self) -> None:
        """Do nothing: it is there."""


def rig_of(config: pytest.Config) -> Rig:
    """Make the rig that the options ask for. Raises pytest.UsageError where they are wrong."""
    target, name = config.getoption("driver_rig", None), config.getoption("driver", None)
    if (target is None) == (name is None):
        raise pytest.UsageError(
            "give -p motorctl.hal.conformance and either --driver-rig or --driver"
        )
    if target is None:
        rig: Rig = OpenedRig() if config.getoption("driver_opens") else NamedRig()
        rig.driver_class, rig.type_name = driver_class(name), None if ":" in name else name
        rig.options = json.loads(config.getoption("driver_options"))
        numbers = range(config.getoption("driver_channels"))
        rig.channels = tuple(Channel(f"axis{i}", i, 0.5e-6, 32, 10.0) for i in numbers)
        rig.period_s = 1.0 / config.getoption("driver_rate_hz")
    else:
        module, _, attribute = target.partition(":")
        rig = getattr(importlib.import_module(module), attribute)()
    rig.exchanges = config.getoption("driver_exchanges") or rig.exchanges
    return rig


class TestDriver(DriverConformance):
    """The driver of the command line."""

    @pytest.fixture
    def rig(self, request: pytest.FixtureRequest) -> Iterator[Rig]:
        """Give the rig that the command line names."""
        with rig_of(request.config) as rig:
            yield rig
