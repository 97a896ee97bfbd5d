"""Options of the Modbus driver: what is refused, by which key, and what a bus can carry."""

import copy
import re
from pathlib import Path

import pytest
import yaml
from config_bench import MACHINE
from config_bench import problems as config_problems
from modbus_bench import CHANNELS, channels, make, options
from pydantic import ValidationError

from motorctl_modbus import ModbusDriver, ModbusOptions

PAGE = Path(__file__).parents[3] / "docs" / "drivers" / "modbus.md"
RTU = {"port": "/dev/ttyUSB0", "baud": 115200}


def changed(*path, **values):
    part = result = copy.deepcopy(CHANNELS)
    for key in path:
        part = part.setdefault(key, {})
    part.update(values)
    return result


def with_mark(bits):
    result = changed(0, "index_counts", address=6, bits=bits)
    result[0].setdefault("status", {})["index_latched"] = {"address": 9, "bit": 0}
    return result


def without(number, key):
    result = copy.deepcopy(CHANNELS)
    del result[number][key]
    return result


def refused(**changes):
    with pytest.raises(ValidationError) as caught:
        options(**changes)
    (error,) = caught.value.errors()
    return ".".join(str(part) for part in error["loc"]), error["msg"]


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"tcp": {"host": "h"}, "rtu": RTU}, "rtu", "either tcp"),
        ({"coupler": "beckhoff_bk9000", "rtu": RTU}, "rtu", "is on tcp"),
        ({"coupler": "beckhoff_bk73x0"}, "rtu", "is on rtu"),
        ({"coupler": "wago"}, "coupler", "beckhoff_bk9000"),
        ({"unit": 248}, "unit", "0 to 247"),
        ({"unit": -1}, "unit", "greater than or equal to 0"),
        ({"unit": 0, "rtu": RTU}, "unit", "broadcast"),
        ({"unit": 255, "rtu": RTU}, "unit", "0 to 247"),
        ({"rtu": {**RTU, "baud": 0}}, "rtu.baud", "300"),
        ({"rtu": {**RTU, "parity": "mark"}}, "rtu.parity", "even"),
        ({"watchdog_s": 0.1}, "watchdog_s", "coupler"),
        ({"tcp": {"host": "h", "port": 65536}}, "tcp.port", "65535"),
        ({"channels": {}}, "channels", "at least 1"),
        ({"channels": without(0, "volts")}, "channels.0.volts", "required"),
        ({"channels": without(1, "counts")}, "channels.1.counts", "required"),
        ({"channels": without(1, "enable")}, "channels.1.enable", "required"),
        ({"channels": changed(0, "volts", volts_per_count=0)}, "channels.0.volts.volts_per_count",
         "greater than 0"),
        ({"channels": changed(0, "volts", bits=64)}, "channels.0.volts.bits", "16 or 32"),
        ({"channels": changed(0, "counts", bits=24)}, "channels.0.counts.bits", "16, 32 or 64"),
        ({"channels": changed(0, "enable", bit=16)}, "channels.0.enable.bit", "15"),
        ({"channels": changed(0, "volts", address=65536)}, "channels.0.volts.address", "65535"),
        ({"channels": changed(0, "volts", zero_count=40000)}, "channels.0.volts.zero_count",
         "expected -32768 to 32767, which 16 bit signed carry"),
        ({"channels": changed(0, "volts", signed=False, zero_count=-1)},
         "channels.0.volts.zero_count", "expected 0 to 65535"),
        ({"rtu": {**RTU, "port": "/dev/tty\0USB0"}}, "rtu.port", "NUL"),
        ({"tcp": {"host": "a\0b"}}, "tcp.host", "NUL"),
        ({"retries": 3}, "retries", "not permitted"),
    ],
)  # fmt: skip
def test_what_cannot_work_is_refused_by_its_key(changes, key, words):
    said, message = refused(**changes)
    assert said == key
    assert re.search(words, message), message


def test_one_estop_may_serve_every_channel_but_no_other_status():
    bit = {"address": 9, "bit": 3}
    both = changed(0, "status", estop=bit)
    both[1]["status"] = {"estop": bit}
    assert make(channels=both).problems() == []
    for other in ({"home_switch": bit}, {"estop": {**bit, "inverted": True}}):
        both[1]["status"] = other
        ((path, message),) = make(channels=both).problems()
        assert path == ("channels", "1", "status", *other)
        assert message == (
            "is on input register 9 bit 3, which channels.0.status.estop uses already"
        )


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"channels": changed(1, "volts", address=0)}, "channels.1.volts",
         "is on output register 0, which channels.0.volts uses already"),
        ({"channels": changed(1, "counts", address=1)}, "channels.1.counts",
         "is on input register 1, which channels.0.counts uses already"),
        ({"channels": changed(1, "enable", bit=0)}, "channels.1.enable",
         "is on output register 2 bit 0, which channels.0.enable uses already"),
        ({"channels": changed(1, "enable", address=0)}, "channels.1.enable",
         "is on output register 0, which channels.0.volts uses already"),
        ({"sequence": {"output": 2, "input": 4}}, "sequence.output",
         "is on output register 2, which channels.0.enable uses already"),
        ({"channels": changed(1, "volts", address=200)}, "channels.1.volts",
         "from channels.0.volts to here are 201 in a row, and one request carries at most 121"),
        ({"channels": changed(1, "counts", address=124)}, "channels.1.counts",
         "126 in a row, and one request carries at most 125"),
        ({"channels": changed(0, "status", "estop", address=1, bit=0)}, "channels.0.status.estop",
         "is on input register 1, which channels.0.counts uses already"),
        ({"channels": with_mark(bits=16)},
         "channels.0.index_counts.bits", "found 16, expected 32, as counts.bits"),
        ({"channels": changed(0, "index_counts", address=6, bits=32)},
         "channels.0.index_counts", "needs status.index_latched: a mark that is passed twice"),
        ({"channels": changed(0, "status", "index_latched", address=9, bit=0)},
         "channels.0.status.index_latched", "needs index_counts"),
        ({"output_base": 0xFFFD}, "sequence.output",
         "ends at output register 0x10000 with output_base, past 0xffff"),
        ({"sequence": {"output": 1, "input": 4}}, "sequence.output",
         "is on output register 1, which channels.1.volts uses already"),
        ({"sequence": {"output": 3, "input": 0}}, "sequence.input",
         "is on input register 0, which channels.0.counts uses already"),
        ({"boot_id": {"address": 4}}, "boot_id",
         "is on input register 4, which sequence.input uses already"),
        ({"boot_id": {"address": 400}}, "boot_id", "401 in a row"),
    ],
)  # fmt: skip
def test_registers_that_cannot_be_together_are_told_by_their_own_key(changes, key, words):
    ((path, message),) = make(n=2, **changes).problems()
    assert ".".join(path) == key
    assert words in message


def test_every_mistake_of_a_map_is_told_at_once_with_its_key_and_line(tmp_path):
    spoilt = changed(1, "volts", address=0)
    spoilt[0]["volts"]["volts_per_count"] = 1e6
    spoilt[1]["enable"]["bit"] = 0
    spoilt[1]["counts"]["bits"] = 64
    box = {"type": "modbus", "tcp": {"host": "h"}, "channels": spoilt, "boot_id": {"address": 1}}
    machine = copy.deepcopy(MACHINE)
    machine["drivers"] = {"box": box}
    axis = machine["axes"]["x"]
    axis["driver"], axis["encoder"]["counter_bits"] = "box", 32
    machine["axes"]["y"] = {**copy.deepcopy(axis), "channel": 1}
    del machine["axes"]["y"]["program"]
    found = [p for p in config_problems(tmp_path, machine) if p.key.startswith("drivers")]
    lines = (tmp_path / "machine.yaml").read_text().splitlines()
    assert [(p.key, lines[p.line - 1].strip()) for p in found] == [
        ("drivers.box.channels.0.volts.volts_per_count", "volts_per_count: 1000000.0"),
        ("drivers.box.channels.1.volts", "volts:"),
        ("drivers.box.channels.1.enable", "enable:"),
        ("drivers.box.channels.1.counts.bits", "bits: 64"),
        ("drivers.box.boot_id", "boot_id:"),
    ]
    assert not any("{" in p.message for p in found)


@pytest.mark.parametrize(
    ("driver", "path", "words"),
    [
        (lambda: make(n=3), ("channels",), "no entry 2, which axis 'z' uses"),
        (
            lambda: ModbusDriver(options(), channels(1, counter_bits=16), 0.01),
            ("channels", "0", "counts", "bits"),
            "found 32, but axis 'x' has encoder.counter_bits 16",
        ),
        (
            lambda: ModbusDriver(options(), channels(1, max_voltage_v=24.0), 0.01),
            ("channels", "0", "volts"),
            "carries -10.0003051851 to 10 V, but axis 'x' has limits.max_voltage_v 24",
        ),
        (
            lambda: make(channels=changed(0, "volts", signed=False)),
            ("channels", "0", "volts"),
            "carries 0 to 20.0003051851 V, but axis 'x'",
        ),
        (
            # Two steps short, at the lower end.
            lambda: make(channels=changed(0, "volts", signed=False, zero_count=32765)),
            ("channels", "0", "volts"),
            "carries -9.99938962981 to 10.0009155553 V",
        ),
        (
            lambda: make(channels=changed(0, "volts", volts_per_count=1e6)),
            ("channels", "0", "volts", "volts_per_count"),
            "found 1e+06, expected at most 0.2, as axis 'x' has limits.max_voltage_v 10",
        ),
        (
            lambda: make(0.01, rtu={**RTU, "timeout_s": 0.01}),
            ("rtu", "timeout_s"),
            "less than the period",
        ),
        (
            lambda: make(0.1, rtu={**RTU, "timeout_s": 0.004}),
            ("rtu", "timeout_s"),
            "found 0.004 s, but a reply takes 0.00569 s",
        ),
        (
            lambda: make(0.1, coupler="beckhoff_bk9000", watchdog_s=0.2),
            ("watchdog_s",),
            "more than two periods",
        ),
    ],
)
def test_what_does_not_fit_the_axes_or_the_period_is_told_by_its_key(driver, path, words):
    ((found, message),) = driver().problems()
    assert found == path
    assert words in message


def test_what_fits_has_no_problems():
    assert make().problems() == []
    assert make(0.02, rtu={**RTU, "timeout_s": 0.015}).problems() == []
    usual = changed(0, "volts", volts_per_count=10 / 32768)
    assert make(channels=usual).problems() == []
    offset_binary = changed(0, "volts", signed=False, zero_count=32768)
    assert make(channels=offset_binary).problems() == []
    half_a_step_short = changed(0, "volts", volts_per_count=10 / 32767.4)
    assert make(channels=half_a_step_short).problems() == []


def test_limit_switches_that_no_register_tells_are_no_problem_and_are_told():
    lower = {"limit_negative": {"address": 5, "bit": 0}}
    both = lower | {"limit_positive": {"address": 5, "bit": 1}}

    def said(status):
        driver = make(channels=changed(0, status=status))
        assert driver.problems() == []
        return [words.partition(":")[0] for words in driver.advice() if "limit_" in words]

    assert said({}) == ["no limit_negative and limit_positive for x, y"]
    assert said(lower) == [
        "no limit_positive for x",
        "no limit_negative and limit_positive for y",
    ]
    assert said(both) == ["no limit_negative and limit_positive for y"]


def test_a_coupler_brings_its_addresses_and_its_factory_watchdog():
    beckhoff = options(coupler="beckhoff_bk9000", output_base=None)
    assert (beckhoff.output_base, beckhoff.input_base, beckhoff.watchdog_s) == (0x0800, 0, 1.0)
    assert options(coupler="beckhoff_bk73x0", rtu=RTU, watchdog_s=0.5).watchdog_s == 0.5
    assert options().watchdog_s is None


def page_configurations():
    blocks = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    tcp, rtu = [yaml.safe_load(block) for block in blocks]
    tcp_options, rtu_options = tcp["drivers"]["coupler"], rtu["drivers"]["coupler"]
    rtu_options["channels"] = tcp_options["channels"]
    for key in ("sequence", "boot_id"):
        rtu_options[key] = tcp_options[key]
    for machine, told in ((tcp, tcp_options), (rtu, rtu_options)):
        assert told.pop("type") == "modbus"
        yield machine["rate_hz"], told


def test_the_configurations_of_the_page_are_accepted_at_their_rates():
    for rate_hz, told in page_configurations():
        driver = ModbusDriver(ModbusOptions.model_validate(told), channels(), 1 / rate_hz)
        assert driver.problems() == []
        assert driver.rate_budget().max_rate_hz >= rate_hz


def test_the_budget_table_of_the_page_is_what_the_driver_computes():
    (_, tcp), (_, rtu) = page_configurations()
    rows = re.findall(
        r"^\| (TCP|RTU (?:[\d]+|1 Mbaud), 8E1) \| ([\d.]+) ms.*?\| (\d+) Hz \|$",
        PAGE.read_text(),
        re.MULTILINE,
    )
    assert len(rows) == 9
    for bus, turnaround_ms, rate_hz in rows:
        told = tcp if bus == "TCP" else rtu
        if bus != "TCP":
            baud = int(bus.split()[1].rstrip(","))
            line = {"port": "p", "baud": 1_000_000 if baud == 1 else baud, "parity": "even"}
            told = {**told, "rtu": line}
        told = {**told, "device_turnaround_s": float(turnaround_ms) * 1e-3}
        budget = ModbusDriver(ModbusOptions.model_validate(told), channels(), 1.0).rate_budget()
        assert round(budget.max_rate_hz) == int(rate_hz)


def test_the_arithmetic_names_characters_silence_and_turnaround():
    budget = make(1.0, rtu={"port": "p", "baud": 9600, "parity": "none"}).rate_budget()
    assert "request 21 and reply 15 characters of 10 bit at 9600 baud are 37.50 ms" in (
        budget.arithmetic
    )
    assert "twice t3.5 of 3.65 ms" in budget.arithmetic
    assert budget.max_rate_hz == pytest.approx(0.9 / (36 * 10 / 9600 + 2 * 35 / 9600 + 0.5e-3))


def test_a_silence_of_the_devices_own_counts_in_the_budget():
    slow = make(1.0, rtu={**RTU, "silence_s": 3e-3}).rate_budget().max_rate_hz
    assert slow < make(1.0, rtu=RTU).rate_budget().max_rate_hz
