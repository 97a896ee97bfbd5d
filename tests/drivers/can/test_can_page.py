"""What docs/drivers/can.md shows is what the driver takes, byte by byte."""

import re
from pathlib import Path

import pytest
from can_bench import options

from motorctl.hal import Channel
from motorctl.located_yaml import read_document
from motorctl_can import CanDriver, CanOptions
from motorctl_can.budget import Wire, slcan_characters
from motorctl_can.layout import Means

PAGE = (Path(__file__).parents[3] / "docs/drivers/can.md").read_text()


def blocks(language):
    found = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    return [text for kind, text in found if kind == language]


def shown(number, folder):
    """Return the options in one of the page's YAML examples."""
    file = folder / "example.yaml"
    file.write_text(blocks("yaml")[number])
    given = dict(read_document(file).data["drivers"]["bench"])
    assert given.pop("type") == "can"
    return CanOptions.model_validate(given, context={"directory": folder})


def driver(chosen, counter_bits, period_s=0.2e-3):
    channels = [Channel(a, i, 0.5e-6, counter_bits, 10.0) for i, a in enumerate("xy")]
    return CanDriver(chosen, channels, period_s)


def test_the_complete_example_carries_5_khz(tmp_path):
    made = driver(shown(0, tmp_path), 32)
    assert not made.problems()
    assert made.rate_budget().max_rate_hz >= 5000


def test_the_dbc_example_carries_2_5_khz(tmp_path):
    (text,) = (b for b in blocks("") if b.startswith("VERSION"))
    (tmp_path / "bench.dbc").write_text(text)
    made = driver(shown(1, tmp_path), 24, 0.4e-3)
    assert not made.problems()
    assert made.rate_budget().max_rate_hz >= 2500


def test_every_option_and_every_meaning_stands_on_the_page():
    for name in CanOptions.model_fields:
        assert f"`{name}`" in PAGE, name
    for means in Means:
        assert f"`{means}`" in PAGE, means


@pytest.mark.parametrize(
    ("lengths", "wire", "total_us", "rate_hz"),
    [
        ((4, 8), Wire(1000000), 230, 3478),
        ((0, 4, 8), Wire(1000000), 285, 2807),
        ((2, 4), Wire(1000000), 170, 4705),
        ((4, 8), Wire(1000000, True, 5000000), 105.2, 7604),
    ],
)
def test_the_table_of_rates_is_what_the_driver_computes(lengths, wire, total_us, rate_hz):
    total_s = sum(wire.frame_s(n) for n in lengths)
    assert total_s * 1e6 == pytest.approx(total_us, abs=0.05)
    assert int(0.8 / total_s) == rate_hz
    assert f"{total_us} us" in PAGE
    assert f"{rate_hz} Hz" in PAGE


def test_the_figure_of_a_serial_adapter_is_what_the_driver_computes():
    assert slcan_characters(8) * 10 / 115200 == pytest.approx(1.9e-3, abs=0.05e-3)
    assert options().max_frames_per_read == 64
