"""The two examples of docs/drivers/can.md as they stand there, on vcan0."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from motorctl.hal import Channel
from motorctl_can import CanDriver, CanOptions

PAGE = Path("/job/motorctl/docs/drivers/can.md")
PERIOD_S = 0.1


def _blocks() -> list[tuple[str, str]]:
    return re.findall(r"^```(\w*)\n(.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE)


def _example(number: int) -> dict[str, Any]:
    text = [text for kind, text in _blocks() if kind == "yaml"][number]
    found: dict[str, Any] = yaml.safe_load(text)["drivers"]["bench"]
    assert found.pop("type") == "can"
    return found


def classic_driver(**changes: Any) -> CanDriver:
    """Return the driver of the DBC example: classic frames, free-running, counts of 24 bits."""
    (dbc,) = (text for _, text in _blocks() if text.startswith("VERSION"))
    Path("/tmp/bench.dbc").write_text(dbc)
    data = {**_example(1), "channel": "vcan0", "open_timeout_s": 20, "max_age_s": 3, **changes}
    return _driver(data, 24)


def fd_driver(**changes: Any) -> CanDriver:
    """Return the driver of the complete example: CAN FD with SYNC, counts of 32 bits."""
    sync = {"id": 0x80, "wait_s": 1.0}
    data = {**_example(0), "channel": "vcan0", "open_timeout_s": 20, "max_age_s": 3}
    return _driver({**data, "sync": sync, **changes}, 32)


def _driver(data: dict[str, Any], counter_bits: int) -> CanDriver:
    options = CanOptions.model_validate(data, context={"directory": Path("/tmp")})
    channels = [Channel(axis, i, 0.5e-6, counter_bits, 10.0) for i, axis in enumerate("xy")]
    return CanDriver(options, channels, PERIOD_S)
