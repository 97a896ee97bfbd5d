"""Every YAML example in docs/drivers loads as it is printed, and carries the rate that it names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from motorctl.hal import Channel, Driver, driver_class
from motorctl.located_yaml import read_document
from motorctl_devices.load import load_device

PAGES = Path(__file__).parents[2] / "docs/drivers"
OF_THE_LOOP = ("type", "late", "rate_hz")
"""Keys of a driver's entry that are not its own options."""
UNINSTALLED = {"box": "motorctl_box:BoxDriver"}


def blocks(page: Path, language: str) -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
    return [text for kind, text in found if kind == language]


EXAMPLES = [
    pytest.param(page, text, id=f"{page.stem}-{number}")
    for page in sorted(PAGES.glob("*.md"))
    for number, text in enumerate(blocks(page, "yaml"))
]


def made(entry: dict, counter_bits: int, rate_hz: float, folder: Path) -> Driver:
    """Make the driver of an entry under `drivers:`, with an axis on each of its channels."""
    given = {key: value for key, value in entry.items() if key not in OF_THE_LOOP}
    cls = driver_class(UNINSTALLED.get(entry["type"], entry["type"]))
    chosen = cls.Options.model_validate(given, context={"directory": folder})
    axes = "xy"[: len(given.get("channels", "xy"))]
    channels = [Channel(axis, i, 0.5e-6, counter_bits, 10.0) for i, axis in enumerate(axes)]
    return cls(chosen, channels, 1.0 / rate_hz)


@pytest.mark.parametrize(("page", "text"), EXAMPLES)
def test_an_example_loads_as_it_is_printed(page, text, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(PAGES / "example"))
    for plain in blocks(page, ""):
        if plain.startswith("VERSION"):
            (tmp_path / "bench.dbc").write_text(plain)
    file = tmp_path / "example.yaml"
    file.write_text(text)
    data = read_document(file).data
    if "drivers" not in data:
        load_device(file)
        return
    rate_hz = data.get("rate_hz", 1000)
    for entry in data["drivers"].values():
        drivers = [made(entry, bits, rate_hz, tmp_path) for bits in (32, 24)]
        fitting = [driver for driver in drivers if not driver.problems()]
        assert fitting, [driver.problems() for driver in drivers]
        if "rate_hz" in data:
            assert fitting[0].rate_budget().max_rate_hz >= rate_hz


def test_every_page_of_a_driver_has_an_example():
    shown = {param.values[0].stem for param in EXAMPLES}
    assert shown >= {"can", "canopen", "serial", "modbus", "gantry_device", "your_own"}
