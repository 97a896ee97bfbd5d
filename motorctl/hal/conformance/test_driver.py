"""The suite for a driver that the command line names."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pydantic import ValidationError

from motorctl.errors import UsageError
from motorctl.hal import Channel, driver_class
from motorctl.hal.conformance import DriverConformance, Rig


class NamedRig(Rig):
    """A driver by its name, without hooks."""


class OpenedRig(NamedRig):
    """The same, with its device there."""

    def start(self) -> None:
        """Do nothing: it is there."""


def rig_maker(config: pytest.Config) -> Callable[[], Rig]:
    """Return what makes the rig that the options ask for.

    Raises pytest.UsageError where they are wrong; `conftest.py` asks once, before the first check.
    """
    target, name = config.getoption("driver_rig", None), config.getoption("driver", None)
    if (target is None) == (name is None):
        raise pytest.UsageError(
            "give -p motorctl.hal.conformance and either --driver-rig or --driver"
        )
    return _named_rig(config, name) if target is None else _own_rig(target)


def _named_rig(config: pytest.Config, name: str) -> Callable[[], Rig]:
    channels, rate_hz = config.getoption("driver_channels"), config.getoption("driver_rate_hz")
    if channels < 1 or not rate_hz > 0.0:
        raise pytest.UsageError("--driver-channels and --driver-rate-hz should be greater than 0")
    try:
        found = driver_class(name)
    except UsageError as error:
        raise pytest.UsageError(f"--driver: {error}") from error
    given = _options(config.getoption("driver_options"))

    def make() -> Rig:
        rig = OpenedRig() if config.getoption("driver_opens") else NamedRig()
        rig.driver_class, rig.type_name = found, None if ":" in name else name
        rig.options = given
        rig.channels = tuple(Channel(f"axis{i}", i, 0.5e-6, 32, 10.0) for i in range(channels))
        rig.period_s = 1.0 / rate_hz
        return rig

    try:
        found.Options.model_validate(dict(given), context=dict(make().directory_context()))
    except ValidationError as error:
        wrong = "; ".join(
            f"{'.'.join(map(str, detail['loc']))}: {detail['msg']}" for detail in error.errors()
        )
        raise pytest.UsageError(f"--driver-options: {wrong}") from error
    return make


def _options(text: str) -> dict[str, Any]:
    try:
        given = json.loads(text)
    except json.JSONDecodeError as error:
        raise pytest.UsageError(f"--driver-options: found {text}, no JSON: {error}") from error
    if not isinstance(given, dict):
        raise pytest.UsageError(f"--driver-options: found {text}, should be an object")
    return given


def _own_rig(target: str) -> Callable[[], Rig]:
    module, _, attribute = target.partition(":")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:  # a third party's module may fail in any way
        cause = f"{type(error).__name__}: {error}"
        raise pytest.UsageError(f"--driver-rig {target}: {cause}") from error
    if not (isinstance(found, type) and issubclass(found, Rig)):
        raise pytest.UsageError(f"--driver-rig {target}: is not a subclass of Rig")
    return found


class TestDriver(DriverConformance):
    """The driver of the command line."""

    @pytest.fixture
    def rig(self, request: pytest.FixtureRequest) -> Iterator[Rig]:
        """Return the rig that the command line names."""
        config = request.config
        with rig_maker(config)() as rig:
            rig.exchanges = config.getoption("driver_exchanges") or rig.exchanges
            yield rig
