"""Groups of axes that stop together: what is refused, what is told."""

import copy

import pytest
from config_bench import MACHINE, machine, problems, write

from motorctl.config import load
from motorctl.config.summary import summarise


def two_axes(**changes):
    data = machine(**changes)
    data["axes"]["y"] = {**copy.deepcopy(MACHINE["axes"]["x"]), "channel": 1, "program": None}
    data["programs"] = {
        "ring": {
            "kind": "circle",
            "axes": ["x", "y"],
            "center_m": [0.1, 0.1],
            "radius_m": 0.05,
            "speed_m_s": 0.1,
            "max_acceleration_m_s2": 2.0,
            "max_jerk_m_s3": 200.0,
            "turns": 1,
        }
    }
    data["axes"]["x"]["program"] = None
    return data


MISTAKES = [
    ([["x", "z"]], "stop_together[0][1]", ["unknown axis 'z'"]),
    ([["x"]], "stop_together[0]", ["found 1", "two or more"]),
    ([["x", "x"]], "stop_together[0]", ["found 1", "two or more"]),
    ([["x", "y"], ["y", "x"]], "stop_together[1][0]", ["'y'", "another group", "join"]),
    (["x", "y"], "stop_together[0]", ["'x'", "list"]),
]


@pytest.mark.parametrize(("groups", "key", "parts"), MISTAKES)
def test_groups_that_name_no_axis_or_stop_none_are_refused(tmp_path, groups, key, parts):
    told = [p for p in problems(tmp_path, two_axes(stop_together=groups)) if p.key == key]
    assert told
    assert all(part in told[0].message for part in parts)
    assert told[0].line is not None


def test_groups_stand_in_the_machine_and_in_what_check_tells(tmp_path):
    loaded = load(write(tmp_path, two_axes(stop_together=[["x", "y"]])))
    assert loaded.stop_together == (("x", "y"),)
    summary = summarise(loaded)
    assert summary["stop_together"] == [["x", "y"]]
    assert not any("go on" in note for note in summary["notes"])
    assert summarise(load(write(tmp_path, two_axes())))["stop_together"] is None


def test_a_program_whose_axes_do_not_stop_together_is_told(tmp_path):
    notes = summarise(load(write(tmp_path, two_axes(stop_together=[]))))["notes"]
    assert any("ring moves x, y" in note and "others go on" in note for note in notes)
