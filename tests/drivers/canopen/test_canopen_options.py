"""What `check` refuses of a CANopen bus and its drives, and how fast it says that the bus is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from canopen_bench import data, driver
from pydantic import ValidationError

from motorctl.hal import Channel
from motorctl_canopen import CanopenDriver, CanopenOptions
from motorctl_canopen.options import InputsOptions, NodeOptions

PAGE = (Path(__file__).parents[3] / "docs/drivers/canopen.md").read_text()
REAL = {"interface": "socketcan", "channel": "can0"}


def node(number: int = 1, rated_torque_v: float = 10.0) -> dict[str, float]:
    return {"node": number, "rated_torque_v": rated_torque_v}


def refused(**given: object) -> str:
    with pytest.raises(ValidationError) as no:
        CanopenOptions.model_validate(data(**given))
    return str(no.value)


def problems(period_s: float = 1e-3, bits: int = 32, **given: object) -> list[str]:
    options = CanopenOptions.model_validate(data(**given))
    made = CanopenDriver(options, [Channel("x", 0, 0.5e-6, bits, 10.0)], period_s)
    return [f"{'.'.join(map(str, where))}: {told}" for where, told in made.problems()]


def test_two_drives_of_one_number_are_refused():
    told = refused(nodes={"x": node(3), "y": node(3)})
    assert told.count("is the number of two drives") == 2


@pytest.mark.parametrize(
    ("inputs", "missed"),
    [
        (None, ["no limit_negative and limit_positive for x"]),
        ({"home_switch": 2}, ["no limit_negative and limit_positive for x"]),
        ({"limit_negative": 0}, ["no limit_positive for x"]),
        ({"limit_negative": 0, "limit_positive": 1}, []),
    ],
)
def test_limit_switches_that_a_drive_does_not_send_are_told(inputs, missed):
    made = driver(data(nodes={"x": node() | {"inputs": inputs}}))
    assert list(made.problems()) == []
    assert [said.partition(":")[0] for said in made.advice()] == missed


def test_the_host_needs_a_number_of_its_own():
    assert "is host_node" in refused(nodes={"x": node(127)})


@pytest.mark.parametrize("number", [0, 128])
def test_a_node_number_is_1_to_127(number):
    assert "nodes.x.node" in refused(nodes={"x": node(number)})


def test_an_axis_without_a_drive_and_a_drive_without_an_axis_are_refused():
    told = problems(nodes={"y": node()})
    assert "nodes: has no drive for axis 'x'" in told
    assert any(line.startswith("nodes.y: names axis 'y'") for line in told)


def test_a_counter_of_another_width_is_refused():
    (told,) = problems(bits=24)
    assert "counter_bits 24, but the position of a CiA 402 drive (6064h) has 32" in told


@pytest.mark.parametrize(
    ("rated_v", "message"), [(1000.0, "a step of 1/1000 is 1 V"), (0.2, "takes up to 6.5534 V")]
)
def test_a_scale_that_cannot_carry_the_voltage_is_refused(rated_v, message):
    (told,) = problems(nodes={"x": node(1, rated_v)})
    assert told.startswith("nodes.x.rated_torque_v")
    assert message in told


def test_a_watchdog_that_one_late_heartbeat_would_trip_is_refused():
    (told,) = problems(period_s=2e-3, watchdog_s=5e-3)
    assert "must be at least 4 periods of 0.002 s" in told


def test_a_wait_too_short_for_the_answers_is_refused():
    (told,) = problems(**REAL, sync={"wait_s": 100e-6})
    assert "SYNC and its answers take up to" in told


@pytest.mark.parametrize(("count", "total_us", "rate_hz"), [(1, 330, 2424), (2, 540, 1481),
                                                            (3, 750, 1066)])  # fmt: skip
def test_the_table_of_rates_is_what_the_driver_computes(count, total_us, rate_hz):
    nodes = {axis: node(i + 1) for i, axis in enumerate("xyz"[:count])}
    budget = driver(data(**REAL, nodes=nodes, sync={"wait_s": 1e-4})).rate_budget()
    assert int(budget.max_rate_hz) == rate_hz
    assert f"= {total_us:.1f} us a period" in budget.arithmetic
    assert re.search(rf"\| {total_us} us \| {rate_hz} Hz \|", PAGE)


def test_every_option_stands_on_the_page():
    for model in (CanopenOptions, NodeOptions, InputsOptions):
        for name in model.model_fields:
            assert f"`{name}" in PAGE or f"`{{{name}" in PAGE, name


def test_a_socketcan_interface_is_set_up_with_its_bit_rate():
    made = driver(data(**REAL, bitrate=500000))
    (network,) = made.network_interfaces()
    assert (network.name, network.settings) == ("can0", "type can bitrate 500000 restart-ms 100")


def test_other_drivers_know_the_bus_by_the_same_words():
    assert driver(data(**REAL)).medium == "CAN socketcan channel 'can0'"
