"""The JSON Schema that editors check configurations by knows the options of every driver."""

import copy
from functools import cache

import jsonschema
import pytest

from motorctl.config import config_schema, shipped_configs
from motorctl.hal.registry import installed_drivers
from motorctl.located_yaml import read_document


@cache
def validator():
    return jsonschema.Draft202012Validator(config_schema())


@pytest.mark.parametrize("name", sorted(shipped_configs()))
def test_every_shipped_configuration_is_right_by_the_schema(name):
    data = read_document(shipped_configs()[name]).data
    assert [f"{e.json_path}: {e.message}" for e in validator().iter_errors(data)] == []


def test_every_installed_driver_has_its_options_in_the_schema():
    definitions = config_schema()["$defs"]
    for entry in installed_drivers():
        told = definitions[f"driver_{entry.name}"]["properties"]
        assert set(told) == {"type", "rate_hz", "late", *entry.driver.Options.model_fields}


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("canopen_gantry", {"nodes": {"x": {"node": 1, "rated_torque": 10}}}),
        ("can_gantry", {"bit_rate": 500000}),
        ("modbus_gantry", {"tcp": {"host": "10.0.0.2", "prot": 502}}),
        ("published_gantry", {"plants": {0: {"coging": None}}}),
        ("small_stage", {"faults": [{"kind": "estop"}]}),
    ],
)
def test_a_driver_option_that_is_misspelled_or_missing_is_seen_while_typing(name, wrong):
    data = copy.deepcopy(read_document(shipped_configs()[name]).data)
    (driver,) = data["drivers"].values()
    driver |= wrong
    assert not validator().is_valid(data)


def test_the_options_of_a_driver_that_is_named_by_its_class_stay_open():
    data = copy.deepcopy(read_document(shipped_configs()["small_stage"]).data)
    data["drivers"]["stage"] = {"type": "my_box:MyBox", "colour": "blue"}
    assert validator().is_valid(data)
