"""Every mistake is told with its key, its line, what stands there and what would be right."""

import copy

import pytest
from config_bench import MACHINE, drop, line_of, machine, problems, write

from motorctl.config import load
from motorctl.errors import ConfigError

EM_POSITIVE = {"initial": -0.05, "bounds": [-0.06, 0.0]}

# where, what stands there, the key of the problem (None: the same), what the message says
MISTAKES = [
    ("rate_hz", "fast", None, ["'fast'", "number"]),
    ("rate_hz", True, None, ["true", "number"]),
    ("rate_hz", 0, None, ["0", "greater than 0"]),
    ("name", "two words", None, ["'two words'", "match"]),
    ("axes", {}, None, ["at least 1"]),
    ("axes.x.driver", "lime", None, ["'lime'", "did you mean 'line'?"]),
    ("axes.x.channel", 1.5, None, ["1.5", "whole number"]),
    ("axes.x.controller", "C3", None, ["'C3'", "'C1' or 'C2'"]),
    ("axes.x.encoder", 5, None, ["5", "mapping"]),
    ("axes.x.encoder.direction", 0, None, ["0", "-1 or 1"]),
    ("axes.x.encoder.resolution", 1e-6, None, ["unknown key", "'resolution_m'"]),
    ("axes.x.encoder.counter_bits", 8, None, ["found 8", "500 a tick", "12 bits"]),
    ("axes.x.encoder.counter_bits", 65, None, ["65", "64"]),
    ("axes.x.limits.travel_m", [0.3, -0.1], None, ["[0.3, -0.1]", "lower"]),
    ("axes.x.limits.travel_m", [0.3], "axes.x.limits.travel_m[1]", ["missing"]),
    ("axes.x.limits.travel_m", [1, "2"], "axes.x.limits.travel_m[1]", ["'2'", "number"]),
    ("axes.x.limits.max_jerk_m_s3", float("inf"), None, [".inf", "finite"]),
    ("axes.x.limits.stop.acceleration_m_s2", 21.0, None, ["21", "max_acceleration_m_s2: 20"]),
    ("axes.x.limits.stop.jerk_m_s3", 2001, None, ["2001", "max_jerk_m_s3: 2000"]),
    ("axes.x.limits.stop.acceleration_m_s2", 1.0, "axes.x.limits.stop", ["0.5 m", "0.4 m"]),
    ("axes.x.limits.following_error.minimum_m", 1e-6, None, ["1e-06", "2 encoder counts", "2e-06"]),
    ("axes.x.limits.following_error.minimum_m", 0.5, None, ["0.5", "travel of 0.4 m"]),
    ("axes.x.limits.following_error.minimum_m", 0.2, None, ["0.2", "middle", "travel of 0.4 m"]),
    ("axes.x.limits.following_error.filter_time_s", 0.5, None, ["0.5 m", "0.4 m"]),
    ("axes.x.gains.k1_1_s", 2000, None, ["2000", "rate of 2000"]),
    ("axes.x.gains.gamma_d", 80_001, None, ["gamma_d / ks", "below 80000"]),
    ("axes.x.gains.ks_v_s_m", 4000.0, "axes.x.gains", ["unstable", "ks 4000", "2000 Hz"]),
    ("axes.x.adaptation.filter_rad_s", 6284, None, ["6284", "6283.19"]),
    ("axes.x.adaptation.forgetting_1_s", 200, None, ["200", "filter_rad_s 200"]),
    ("axes.x.adaptation.input_delay_s", 0.05, None, ["0.05", "at most"]),
    ("axes.x.adaptation.enabled", "yes", None, ["'yes'", "true or false"]),
    ("axes.x.homing.method", "swich", None, ["'swich'", "did you mean 'switch'?"]),
    ("axes.x.homing.home_position_m", 0.4, None, ["0.4", "-0.1 to 0.3"]),
    ("axes.x.homing.search_velocity_m_s", 0, None, ["not be 0"]),
    ("axes.x.homing.latch_velocity_m_s", -2.0, None, ["-2", "at most 1 m/s"]),
    ("axes.x.homing.timeout_s", 2.0, None, ["found 2", "above 8 s", "0.05 m/s"]),
    ("axes.x.homing.timeout_s", 1e9, None, ["found 1e+09", "given up", "at most 400 s"]),
    ("axes.x.model.inertia.bounds", [0.4, 0.1], None, ["[0.4, 0.1]", "lower"]),
    ("axes.x.model.inertia.bounds", [-1.0, 1.0], None, ["[-1.0, 1.0]", "1e-07 to 1000 V*s^2/m"]),
    ("axes.x.model.inertia.initial", 0.5, None, ["0.5", "0.1 to 0.4 V*s^2/m"]),
    ("axes.x.model.inertia.covariance", 0, None, ["greater than 0"]),
    ("axes.x.model.cogging_", {}, None, ["unknown effect", "type: package.module:Class"]),
    ("axes.x.model.coulomb_friction.slope", 900, None, ["unknown key", "'slope_s_m'"]),
    ("axes.x.model.coulomb_friction.slope_s_m", "900", None, ["'900'", "number"]),
    ("axes.x.model.coulomb_friction.inital", 0.1, None, ["unknown key", "'initial'"]),
    ("axes.x.model.inertia.parameters", {"mass": {}}, "axes.x.model.inertia.parameters.mass",
     ["unknown parameter"]),
    ("axes.x.model.inertia.[key]", 1, None, ["unknown key"]),
    ("axes.x.model.inertia", {"[key]": None}, "axes.x.model.inertia.[key]", ["unknown key"]),
    ("axes.x.model.spring", {"type": "config_bench:Spring", "initial": 1.0},
     "axes.x.model.spring.initial", ["parameters", "linear, cubic"]),
    ("axes.x.model.spring", {"type": "config_bench:Nothing"}, "axes.x.model.spring.type",
     ["failed to import", "Nothing"]),
    ("axes.x.model.sprung", {"type": "config_bench:Spring"}, "axes.x.model.sprung.type",
     ["calls itself 'spring'"]),
    ("axes.x.model.em_quadratic", EM_POSITIVE, "axes.x.model.em_quadratic",
     ["Assumption 2", "dv/du is -0.15 at u = 10 V", "0.05"]),
    ("axes.x.model", {"offset": {}}, None, ["no inertia"]),
    ("axes.x.program", "their", None, ["'their'", "did you mean 'there'?"]),
    ("axes.x.programme", "there", None, ["unknown key", "'program'"]),
    ("programs.there.axis", "z", None, ["'z'", "known: x"]),
    ("programs.there.target_m", "0.2", None, ["'0.2'", "number"]),
    ("programs.there.kind", "jump", None, ["'jump'", "point_to_point"]),
    ("programs.there.target_m", 0.31, "programs.there", ["position 0.31 m", "0.3 m"]),
    ("programs.there.max_velocity_m_s", 1.1, "programs.there", ["velocity 1.1 m/s", "1 m/s"]),
    ("axes.x.limits.max_acceleration_m_s2", 9.5, "programs.there",
     ["acceleration 10 m/s^2", "9.5 m/s^2"]),
    ("programs.there.max_jerk_m_s3", 2500, "programs.there", ["jerk 2500", "2000 m/s^3"]),
    ("axes.x.limits.max_voltage_v", 2.0, "programs.there", ["voltage 2.2", "2 V"]),
    ("loop.spin_s", 0.0005, None, ["0.0005", "period of 0.0005 s"]),
    ("loop.priority", 0, None, ["0", "1"]),
    ("drivers.line.type", "sym", None, ["unknown driver 'sym'", "sim"]),
    ("drivers.line.type", "nowhere:Driver", None,
     ["driver 'nowhere:Driver' failed to import", "nowhere"]),
    ("drivers.line.type", "config_bench:MACHINE", None, ["not a subclass"]),
    ("drivers.line.prot", "x", None, ["unknown key", "'port'"]),
    ("drivers.line.baud", "fast", None, ["'fast'", "whole number"]),
    ("drivers.line.baud", "1000000", None, ["'1000000'", "whole number"]),
    ("drivers.line.refuse", True, "drivers.line", ["port is in use"]),
    ("drivers.line.baud", 200_000, "rate_hz", ["2000", "1666.67 Hz", "120 bits at 200000 baud"]),
    ("drivers.spare", {"type": "sim"}, None, ["serves no axis"]),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "key", "parts"), MISTAKES)
def test_a_mistake_is_told_with_key_line_value_and_what_is_right(tmp_path, path, value, key, parts):
    data = machine(**{path.replace(".", "__"): value})
    found = problems(tmp_path, data)
    told = [p for p in found if p.key == (key or path) and all(t in p.message for t in parts)]
    assert told, "\n".join(map(str, found))
    standing = (key or path).split(".")[-1].split("[")[0]
    if standing in ("rate_hz", "spin_s", "priority", "travel_m", "k1_1_s", "there"):
        lines = (tmp_path / "machine.yaml").read_text().splitlines()
        assert lines[told[0].line - 1].strip().startswith(f"{standing}:") or "[" in (key or "")
    assert all(p.line is not None for p in found if p.key != "axes")


def test_the_valid_machine_has_no_problem(tmp_path):
    assert problems(tmp_path, MACHINE) == ()


@pytest.mark.parametrize(
    "path",
    ["name", "rate_hz", "axes", "axes.x.gains", "axes.x.limits.stop", "axes.x.homing.timeout_s",
     "axes.x.encoder.resolution_m", "axes.x.channel", "drivers.line.type", "programs.there.axis"],
)  # fmt: skip
def test_a_missing_key_is_told_at_the_mapping_that_lacks_it(tmp_path, path):
    data = machine()
    drop(data, path)
    (told,) = [p for p in problems(tmp_path, data) if p.key == path]
    assert "missing" in told.message
    parent = path.split(".")[-2:-1]
    if parent:
        assert told.line == line_of(tmp_path / "machine.yaml", parent[0])


def test_all_problems_are_told_at_once_in_order_of_lines(tmp_path):
    data = machine(
        name="a b",
        axes__x__gains__k1_1_s="250",
        axes__x__model__inertia={"initial": 9, "bounds": [0.1, 0.4], "covariance": -1},
        axes__x__homing__method="none",
        programs__there__target_m=5,
        loop__priority=100,
    )
    found = problems(tmp_path, data)
    assert [p.key for p in found] == [
        "name",
        "axes.x.gains.k1_1_s",
        "axes.x.model.inertia.initial",
        "axes.x.model.inertia.covariance",
        "axes.x.homing.method",
        "programs.there",
        "loop.priority",
    ]
    assert [p.line for p in found] == sorted(p.line for p in found)


def test_a_mistake_in_one_axis_hides_none_in_another(tmp_path):
    data = machine(axes__x__gains="none")
    data["axes"]["y"] = copy.deepcopy(MACHINE["axes"]["x"])
    data["axes"]["y"] |= {"channel": 1, "program": None}
    data["axes"]["y"]["limits"]["following_error"]["minimum_m"] = 3.0
    keys = {p.key for p in problems(tmp_path, data)}
    assert keys == {"axes.x.gains", "axes.y.limits.following_error.minimum_m"}


def test_a_channel_belongs_to_one_axis(tmp_path):
    data = machine()
    data["axes"]["y"] = copy.deepcopy(MACHINE["axes"]["x"]) | {"program": None}
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.y.channel"
    assert "axis 'x'" in told.message


def test_an_axis_may_only_follow_a_program_that_moves_it(tmp_path):
    data = machine()
    data["axes"]["y"] = copy.deepcopy(MACHINE["axes"]["x"]) | {"channel": 1}
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.y.program"
    assert "moves x" in told.message


def test_an_absolute_encoder_must_know_the_whole_travel(tmp_path):
    data = machine(axes__x__homing={"method": "absolute"}, axes__x__encoder__counter_bits=18)
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.x.homing.method"
    assert "0.262144 m" in told.message


def test_a_driver_that_fails_gives_its_reason_not_a_traceback(tmp_path):
    (told,) = problems(tmp_path, machine(drivers__line__type="config_bench:BrokenDriver"))
    assert told.key == "drivers.line"
    assert "ZeroDivisionError" in told.message


def test_a_file_of_points_is_told_with_its_own_line(tmp_path):
    points = tmp_path / "points.csv"
    points.write_text("time_s,x_m\n0,0\n0.1,zero\n")
    data = machine(programs__rec={"kind": "points", "axes": ["x"], "file": "points.csv"})
    (told,) = problems(tmp_path, data)
    assert (told.file, told.line, told.key) == (str(points), 3, "x_m")


def test_a_file_of_points_that_is_not_there_is_told_where_it_is_named(tmp_path):
    data = machine(programs__rec={"kind": "points", "axes": ["x"], "file": "points.csv"})
    (told,) = problems(tmp_path, data)
    assert told.key == "programs.rec.file"
    assert told.line == line_of(tmp_path / "machine.yaml", "file")
    assert "points.csv" in told.message


def test_the_voltage_of_a_program_counts_the_saturation_of_the_motor(tmp_path):
    limits = {"axes__x__limits__max_voltage_v": 2.22}
    assert problems(tmp_path, machine(**limits)), "C2 needs more than the straight line"
    path = write(tmp_path, machine(**limits))
    assert load(path, controller="C1").axes["x"].controller == "C1"


def test_the_message_is_one_line_a_problem(tmp_path):
    with pytest.raises(ConfigError) as raised:
        load(write(tmp_path, machine(name="a b", rate_hz=None)))
    assert len(str(raised.value).splitlines()) == 2
    assert str(raised.value).startswith(f"{tmp_path / 'machine.yaml'}:1: name: found 'a b'")
