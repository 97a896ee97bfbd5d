"""A beam behind a bus that its bus cannot bring is refused, with file, key and what to change."""

import copy

import pytest
import yaml

from motorctl.config import load
from motorctl.errors import ConfigError
from motorctl_benchmarks.buses.beams import BEAM_BUSES, beam_host, can_frames

ENDPOINTS = {"modbus tcp": "127.0.0.1:1502"}


def host(name):
    return beam_host(BEAM_BUSES[name], ENDPOINTS.get(name, "/dev/beam"), 43200)


def refusals(folder, data) -> str:
    path = folder / "beam.yaml"
    path.write_text(yaml.safe_dump(data))
    try:
        load(path)
    except ConfigError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", BEAM_BUSES)
def test_the_beam_of_the_tests_is_accepted_on_every_bus(tmp_path, name):
    assert refusals(tmp_path, host(name)) == ""


def without_home_of_the_second_end(name):
    data = host(name)
    driver = data["drivers"]["gantry"]
    if name == "can":
        del driver["frames"]["end_2"]["signals"]["home_switch"]
    elif name == "canopen":
        inputs = driver["nodes"]["x.2"]["inputs"]
        driver["nodes"]["x.2"]["inputs"] = {k: v for k, v in inputs.items() if k != "home_switch"}
    else:
        del driver["channels"][1]["status"]["home_switch"]
    return data


@pytest.mark.parametrize("name", ["can", "canopen", "modbus tcp"])
def test_an_end_whose_home_switch_the_bus_does_not_tell_is_refused(tmp_path, name):
    said = refusals(tmp_path, without_home_of_the_second_end(name))
    assert said.count("\n") == 0, said
    assert "axes.x.homing.method: found 'switch'" in said
    assert "no home switch (home_switch) of 'x.2', the second end" in said


@pytest.mark.parametrize("name", ["can", "canopen", "modbus tcp"])
def test_marks_that_the_bus_does_not_tell_are_refused_for_each_end(tmp_path, name):
    data = host(name)
    data["axes"]["x"]["homing"]["method"] = "index"
    said = refusals(tmp_path, data)
    assert said.count("no index mark (index_latched)") == 2
    assert "of 'x':" in said
    assert "of 'x.2', the second end:" in said


def test_ends_that_are_sampled_at_different_moments_are_refused(tmp_path):
    data = host("can")
    del data["drivers"]["gantry"]["sync"]
    said = refusals(tmp_path, data)
    assert "axes.x.guards.skew.limit_m: found 0.002, would trip in ordinary motion" in said
    assert "4 ms apart" in said
    assert "0.004 m at limits.max_velocity_m_s 1" in said
    data["axes"]["x"]["limits"] |= {"max_velocity_m_s": 0.49}
    data["axes"]["x"]["limits"]["stop"]["acceleration_m_s2"] = 4
    assert "guards.skew" not in refusals(tmp_path, data)


def test_a_layout_without_the_second_end_is_refused_with_its_name(tmp_path):
    data = host("can")
    frames = copy.deepcopy(can_frames())
    del frames["end_2"]
    for key in ("volts_1", "enable_1"):
        del frames["command"]["signals"][key]
    data["drivers"]["gantry"]["frames"] = frames
    assert "has no volts and counts for axis 'x.2'" in refusals(tmp_path, data)

    data = host("modbus tcp")
    del data["drivers"]["gantry"]["channels"][1]
    assert "has no entry 1, which axis 'x.2' uses" in refusals(tmp_path, data)

    data = host("canopen")
    del data["drivers"]["gantry"]["nodes"]["x.2"]
    assert "x.2" in refusals(tmp_path, data)


@pytest.mark.parametrize("name", BEAM_BUSES)
def test_both_ends_on_one_channel_are_refused(tmp_path, name):
    data = host(name)
    data["axes"]["x"]["dual_drive"]["channel"] = 0
    assert "found 0, which axis 'x' uses already" in refusals(tmp_path, data)
