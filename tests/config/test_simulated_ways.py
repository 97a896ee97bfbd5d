"""What always or never trips on the way of a simulated machine is refused: it knows its ends."""

import pytest
import yaml
from config_bench import BenchDriver, machine, problems, write

from motorctl.config import load, shipped_config


def shipped(name, **plant):
    """Return a shipped machine as plain data, with these keys of its first plant."""
    data = yaml.safe_load(shipped_config(name).read_text())
    (driver,) = data["drivers"].values()
    driver.setdefault("plants", {}).setdefault(0, {}).update(plant)
    return data


def tells(tmp_path, data, **parts):
    """Check that each key is refused with these parts of its message, and no other one."""
    told = {problem.key: problem for problem in problems(tmp_path, data)}
    assert sorted(told) == sorted(key.replace("__", ".") for key in parts)
    for key, words in parts.items():
        problem = told[key.replace("__", ".")]
        assert problem.line is not None
        assert all(word in problem.message for word in words), problem.message


@pytest.mark.parametrize("name", ["published_gantry", "small_stage", "dual_gantry"])
def test_soft_limits_behind_the_end_stops_of_a_simulated_axis_are_refused(tmp_path, name):
    data = shipped(name)
    data["axes"]["x"]["limits"]["travel_m"] = [-100.0, 100.0]
    told = {p.key: p.message for p in problems(tmp_path, data)}
    for side, end in enumerate(("lower", "upper")):
        message = told[f"axes.x.limits.travel_m[{side}]"]
        assert f"guards.soft_limit can never trip at the {end} end" in message
        assert "end stops let its full command press the axis no further than" in message


def test_a_soft_limit_counts_from_the_place_that_homing_gives_the_axis(tmp_path):
    # 10 V over 0.21 m press 1e5 V/m by 6.7 mm: the stops at 105 mm end at 111.7 mm; home is at -70.
    data = shipped("small_stage")
    data["axes"]["x"]["limits"]["travel_m"] = [-0.2, 0.111]
    assert problems(tmp_path, data) == ()
    data["axes"]["x"]["limits"]["travel_m"] = [-0.2, 0.113]
    _, told = problems(tmp_path, data)
    assert told.key == "axes.x.limits.travel_m[1]"
    assert "found 0.113" in told.message
    assert "no further than 0.112 m" in told.message
    data["axes"]["x"]["homing"]["home_position_m"] = -0.068  # all is 2 mm further up
    assert problems(tmp_path, data) == ()


def test_an_obstacle_within_the_travel_may_be_simulated(tmp_path):
    data = shipped("published_gantry")
    data["axes"]["x"]["limits"]["travel_m"][1] = 100.0
    assert problems(tmp_path, data) == ()


def test_limit_switches_within_the_program_of_a_simulated_axis_are_refused(tmp_path):
    data = shipped("published_gantry", limit_switches_m=[-0.06, 0.3])
    words = ["found 'published_x'", "always trip", "goes to 0.4 m", "pressed from 0.3 m on"]
    tells(tmp_path, data, axes__x__program=words)
    data = shipped("published_gantry", limit_switches_m=[-0.06, 0.3995])
    assert problems(tmp_path, data) == ()  # 1 mm of following error may keep it off the switch
    data = shipped("published_gantry", limit_switches_m=[-0.06, 0.3])
    data["axes"]["x"]["encoder"]["offset_m"] = -0.01  # all is told 10 mm further down
    words = ["goes to 0.4 m", "pressed from 0.29 m on"]
    tells(tmp_path, data, axes__x__program=words)


def test_a_search_that_meets_the_limit_switch_before_the_home_switch_is_refused(tmp_path):
    data = shipped("small_stage", home_switch={"to_m": -0.101})
    words = [
        "always end in a fault",
        "-0.05 m/s",
        "limit switch at -0.1 m",
        "pressed from -0.101 m on",
    ]
    tells(tmp_path, data, axes__x__homing__method=words)
    data = shipped("small_stage", home_switch={"to_m": -0.099})
    assert problems(tmp_path, data) == ()


def test_switches_of_two_ends_that_no_beam_can_be_squared_by_are_refused(tmp_path):
    # 0.4 mm apart; 10 V skew 500 V/m by 20 mm, and 2 mm are allowed.
    data = shipped("dual_gantry")
    data["axes"]["x"]["dual_drive"]["square_offset_m"] = 0.1
    words = ["found 0.1", "not_square", "0.0004 m apart", "0.0996 m off", "0.02 m", "0.002 m"]
    tells(tmp_path, data, axes__x__dual_drive__square_offset_m=words)
    data["axes"]["x"]["dual_drive"]["square_offset_m"] = 0.0223
    assert problems(tmp_path, data) == ()


@pytest.mark.parametrize("name", ["small_stage", "dual_gantry"])
def test_a_search_away_from_the_home_switch_is_refused(tmp_path, name):
    data = shipped(name)
    data["axes"]["x"]["homing"]["search_velocity_m_s"] = 0.05
    words = ["found 0.05", "always end in a fault", "leads away from", "pressed from -0.08 m on"]
    tells(tmp_path, data, axes__x__homing__search_velocity_m_s=words)


def test_a_home_switch_behind_an_end_stop_is_refused(tmp_path):
    data = shipped("small_stage", home_switch={"to_m": -0.2}, limit_switches_m=None)
    words = ["always end in a fault", "end stop lets it, -0.1117 m", "pressed from -0.2 m on"]
    tells(tmp_path, data, axes__x__homing__method=words)


@pytest.mark.parametrize("mark_m", [-0.2, -0.09, 0.1001])
def test_index_marks_that_are_not_on_the_way_from_the_switch_are_refused(tmp_path, mark_m):
    data = shipped("small_stage", encoder={"index_marks_m": [mark_m]})
    data["axes"]["x"]["program"] = None
    words = ["found 0.01", "always end in a fault", "edge at -0.08 m", "before 0.1 m"]
    tells(tmp_path, data, axes__x__homing__latch_velocity_m_s=words)


def test_homing_that_is_given_up_before_it_comes_to_the_index_mark_is_refused(tmp_path):
    data = shipped("small_stage")
    data["axes"]["x"]["homing"] |= {"latch_velocity_m_s": 2e-4, "timeout_s": 49.0}
    words = ["found 49", "should be above 50 s", "0.01 m from the home switch's edge", "0.0002 m/s"]
    tells(tmp_path, data, axes__x__homing__timeout_s=words)
    data["axes"]["x"]["homing"]["timeout_s"] = 51.0
    assert problems(tmp_path, data) == ()


SWITCH = {"from_m": -0.01, "to_m": 0.01}
"""In the middle of the way: met from either side, at the edge that is nearer."""


@pytest.mark.parametrize(
    ("search", "latch", "mark_m"),
    [
        (-0.05, 0.01, 0.011),  # at 0.01 m, and on upwards
        (-0.05, -0.01, 0.009),
        (0.05, 0.01, -0.009),  # at -0.01 m
        (0.05, -0.01, -0.011),
    ],
)
def test_a_mark_is_sought_from_the_edge_that_the_search_meets_the_way_that_is_latched(
    tmp_path, search, latch, mark_m
):
    def at(mark):
        seen = {"home_switch": SWITCH, "encoder": {"index_marks_m": [mark]}}
        data = shipped("small_stage", **seen)
        data["axes"]["x"]["homing"] |= {"search_velocity_m_s": search, "latch_velocity_m_s": latch}
        data["axes"]["x"]["program"] = None
        return data

    assert problems(tmp_path, at(mark_m)) == ()
    beside = mark_m - 0.002 if latch > 0.0 else mark_m + 0.002
    words = [f"found {latch:g}", "has no index mark before", "latch the other way"]
    tells(tmp_path, at(beside), axes__x__homing__latch_velocity_m_s=words)


def test_an_index_mark_alone_is_found_from_wherever_the_axis_may_be(tmp_path):
    data = shipped("small_stage", encoder={"index_marks_m": [-0.1005]}, initial_position_m=-0.103)
    data["axes"]["x"]["homing"] |= {"method": "index", "timeout_s": 3.0}
    data["axes"]["x"]["program"] = None
    assert problems(tmp_path, data) == ()  # a limit switch behind it stops nothing that leads away
    data["axes"]["x"]["homing"]["latch_velocity_m_s"] = -0.01
    words = ["found -0.01", "no index mark before -0.1 m"]
    tells(tmp_path, data, axes__x__homing__latch_velocity_m_s=words)


def test_a_home_switch_that_is_pressed_wherever_the_axis_can_be_is_refused(tmp_path):
    data = shipped("small_stage", home_switch={"from_m": -5.0, "to_m": 5.0})
    words = ["always end in a fault", "is pressed wherever the axis can be"]
    tells(tmp_path, data, axes__x__homing__method=words)


def test_of_a_beam_whose_second_encoder_counts_the_other_way_no_search_is_refused(tmp_path):
    data = shipped("dual_gantry")
    data["axes"]["x"]["homing"]["search_velocity_m_s"] = 0.05
    data["axes"]["x"]["dual_drive"]["encoder_direction"] = -1
    assert not any("leads away" in problem.message for problem in problems(tmp_path, data))


def test_a_reaction_to_limit_switches_behind_the_end_stops_is_refused(tmp_path):
    data = shipped("published_gantry", limit_switches_m=[-5.0, 5.0])
    assert problems(tmp_path, data) == ()
    data["axes"]["x"]["guards"] = {"limit_switch": {"reaction": "quick_stop"}}
    words = ["can never trip", "limit_switches_m (-5.0, 5.0)", "behind its end stops"]
    tells(tmp_path, data, axes__x__guards__limit_switch=words)


def test_an_axis_whose_voltage_does_not_overcome_friction_is_refused(tmp_path):
    data = shipped("small_stage")
    data["axes"]["x"]["limits"]["max_voltage_v"] = 0.04
    data["axes"]["x"]["model"]["coulomb_friction"]["bounds"] = [0.045, 0.2]
    data["axes"]["x"]["program"] = None
    told = {problem.key: problem.message for problem in problems(tmp_path, data)}
    message = told["axes.x.limits.max_voltage_v"]
    assert "found 0.04" in message
    assert "friction alone needs 0.045 V" in message


def test_a_plant_whose_encoder_is_reversed_tells_of_no_ends(tmp_path):
    data = shipped("published_gantry", encoder={"reversed": True}, limit_switches_m=[-0.06, 0.3])
    data["axes"]["x"]["encoder"]["direction"] = -1
    assert load(write(tmp_path, data)).axes["x"].encoder.direction == -1


def test_a_real_machine_is_asked_for_no_ends(tmp_path):
    data = yaml.safe_load(shipped_config("can_gantry").read_text())
    data["axes"]["x"]["limits"]["travel_m"] = [-3.0, 3.0]
    data["axes"]["x"]["homing"] = {"method": "absolute"}
    assert problems(tmp_path, data) == ()


@pytest.mark.parametrize("told", [[], [1], [None, None]])
def test_a_driver_that_tells_ways_that_are_none_is_told_so(tmp_path, monkeypatch, told):
    monkeypatch.setattr(BenchDriver, "simulated", True)
    monkeypatch.setattr(BenchDriver, "ways", lambda driver: told)
    (problem,) = problems(tmp_path, machine())
    assert problem.key == "drivers.line"
    assert (
        f"the driver's ways() is {told}, should be a Way or None for each of 1" in problem.message
    )
