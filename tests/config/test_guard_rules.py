"""A guard that can never trip, or always does, is refused with its arithmetic."""

import pytest
import yaml
from config_bench import machine, problems, write

from motorctl.config import load, load_resolved, shipped_config
from motorctl.config.guard_keys import NO_QUICK_STOP
from motorctl.config.summary import summarise

# The machine: travel 0.4 m, 1 m/s, 2 kHz, counts of 1 um, 10 V, following error 1 mm for 2 ms.
NEVER = [
    ("encoder_stuck", {"distance_m": 0.003}, "distance_m", ["0.003", "following error", "0.003 m",
                                                           "can never trip"]),
    ("encoder_noise", {"rms_m": 0.0041}, "rms_m", ["0.0041", "overspeed", "at most 0.000395",
                                                   "can hardly ever trip"]),
    ("thermal", {"continuous_voltage_v": 10.0, "time_constant_s": 20.0}, "continuous_voltage_v",
     ["found 10", "max_voltage_v 10 V", "can never trip"]),
    ("thermal", {"continuous_voltage_v": 9.99, "time_constant_s": 60.0}, "continuous_voltage_v",
     ["found 9.99", "10 V would have to stand for 373 s, 6.2 time constants", "at most 9.747 V",
      "can hardly ever trip"]),
    ("host_frozen", {"time_s": 1.0}, "time_s", ["found 1", "not ticked for 1 s", "can never trip"]),
    ("saturation", {"time_s": 1e6}, "time_s", ["1e+06", "at most 60 s", "can hardly ever trip"]),
    ("encoder_noise", {"rms_m": 1e-4, "filter_time_s": 1e4}, "filter_time_s",
     ["10000", "2.88e+03 s of rest", "at most 60 s", "can hardly ever trip"]),
]  # fmt: skip
ALWAYS = [
    ("encoder_stuck", {"distance_m": 2e-6}, "distance_m", ["2e-06", "2 encoder counts"]),
    ("encoder_noise", {"rms_m": 1.4e-5}, "rms_m", ["50 m/s^2", "0.0005 s", "1.45e-05 m"]),
    ("encoder_noise", {"rms_m": 1e-4, "filter_time_s": 1e-4}, "filter_time_s", ["0.0005 s"]),
    ("saturation", {"time_s": 5e-4}, "time_s", ["0.0005", "two periods", "0.001 s"]),
    ("host_frozen", {"time_s": 5e-4}, "time_s", ["0.0005", "two periods", "0.001 s"]),
    ("thermal", {"continuous_voltage_v": 0.2, "time_constant_s": 0.1}, "continuous_voltage_v",
     ["0.2", "always", "program 'there'"]),
    ("thermal", {"continuous_voltage_v": 0.05, "time_constant_s": 5e3}, "continuous_voltage_v",
     ["0.05", "always", "slow motion back and forth, at 0.1 m/s", "0.119 V rms"]),
]  # fmt: skip


@pytest.mark.parametrize(("guard", "keys", "key", "parts"), NEVER)
def test_a_guard_that_can_never_trip_is_refused(tmp_path, guard, keys, key, parts):
    refused(tmp_path, guard, keys, key, parts)


def test_a_stuck_encoder_that_is_only_seen_beyond_half_of_the_travel_is_refused(tmp_path):
    error = {"minimum_m": 0.15, "per_velocity_s": 0.05, "filter_time_s": 0.15}

    def with_distance(distance_m):
        guards = {"encoder_stuck": {"distance_m": distance_m}}
        return machine(axes__x__guards=guards, axes__x__limits__following_error=error)

    assert problems(tmp_path, with_distance(0.199)) == ()
    parts = ["found 0.2", "never trip from the middle", "travel of 0.4 m", "0.2 m, either way"]
    tells_one(tmp_path, with_distance(0.2), "axes.x.guards.encoder_stuck.distance_m", parts)


def test_a_motors_model_that_the_full_command_trips_after_an_hour_is_noted(tmp_path):
    def told(volts):
        thermal = {"continuous_voltage_v": volts, "time_constant_s": 7200.0}
        guards = {"thermal": thermal}
        return notes_with(tmp_path, "guards.thermal (", axes__x__guards=guards)

    assert told(6.27) == []  # 7200 s times -ln(1 - 0.627^2) is 0.9995 h
    (note,) = told(9.7)
    assert "continuous_voltage_v 9.7, time_constant_s 7200" in note
    assert "at max_voltage_v 10 V after 5.66 h only" in note


def test_a_model_of_heat_that_the_full_command_trips_in_time_is_accepted_as_told(tmp_path):
    thermal = {"continuous_voltage_v": 9.747, "time_constant_s": 60.0}
    told = load(write(tmp_path, machine(axes__x__guards={"thermal": thermal})))
    assert told.axes["x"].guards.thermal.continuous_voltage_v == 9.747


@pytest.mark.parametrize(("guard", "keys", "key", "parts"), ALWAYS)
def test_a_guard_that_always_trips_is_refused(tmp_path, guard, keys, key, parts):
    refused(tmp_path, guard, keys, key, parts)


def refused(tmp_path, guard, keys, key, parts):
    data = machine(axes__x__guards={guard: keys}, axes__x__program="there")
    tells_one(tmp_path, data, f"axes.x.guards.{guard}.{key}", parts)


def tells_one(tmp_path, data, key, parts):
    (told,) = problems(tmp_path, data)
    assert told.key == key
    assert told.line is not None
    assert all(part in told.message for part in parts), told.message


@pytest.mark.parametrize(
    ("changes", "key", "parts"),
    [
        ({"axes__x__limits__following_error__per_velocity_s": 0.4},
         "axes.x.limits.following_error.per_velocity_s", ["0.401 m", "travel of 0.4 m", "never"]),
        ({"axes__x__limits__following_error":
          {"minimum_m": 0.1, "per_velocity_s": 0.1, "filter_time_s": 0.21}},
         "axes.x.limits.following_error",
         ["can never trip", "0.1 m + per_velocity_s 0.1 s x 1 m/s = 0.2 m", "filter_time_s 0.21 s",
          "0.21 m more", "together 0.41 m", "travel is 0.4 m"]),
        ({"drivers__line__late": {"hold_ticks": 4001}},
         "drivers.line.late.hold_ticks", ["found 4001", "2.0005 s", "at most 4000", "hardly ever"]),
        ({"loop__overrun_policy": "leaky_bucket", "loop__bucket_size": 2001},
         "loop.bucket_size", ["found 2001", "at most 2000", "hardly ever"]),
        ({"axes__x__guards": {"late_ticks": {"reaction": "disable"}}},
         "axes.x.guards.late_ticks", ["never trip", "loop.overrun_policy is count"]),
        ({"axes__x__guards": {"partner": {"reaction": "disable"}}, "stop_together": []},
         "axes.x.guards.partner", ["never trip", "no group with axis 'x'"]),
    ],
)  # fmt: skip
def test_a_limit_beside_the_guards_that_can_never_trip_is_refused(tmp_path, changes, key, parts):
    tells_one(tmp_path, machine(**changes), key, parts)


def test_a_speed_that_the_motor_can_never_reach_is_refused(tmp_path):
    # 0.1 V s^2/m at least: 200 m/s^2 for twice 10 V, over 0.4 m to 12.6 m/s.
    stop = {"acceleration_m_s2": 200.0, "jerk_m_s3": 1e6}
    limits = machine()["axes"]["x"]["limits"] | {
        "max_velocity_m_s": 10.6, "max_acceleration_m_s2": 200.0, "max_jerk_m_s3": 1e6, "stop": stop
    }  # fmt: skip
    parts = ["found 10.6", "12.72 m/s", "12.6 m/s", "can never trip"]
    tells_one(tmp_path, machine(axes__x__limits=limits), "axes.x.limits.max_velocity_m_s", parts)


@pytest.mark.parametrize(
    "error",
    [
        {"minimum_m": 0.199},
        {"minimum_m": 0.001, "per_velocity_s": 0.398},
        {"minimum_m": 0.001, "filter_time_s": 0.399},
        {"minimum_m": 0.1, "per_velocity_s": 0.1, "filter_time_s": 0.19},
    ],
)
def test_a_following_error_that_trips_before_an_end_of_the_travel_is_allowed(tmp_path, error):
    assert problems(tmp_path, machine(axes__x__limits__following_error=error)) == ()


def test_braking_that_the_motor_can_never_follow_is_refused(tmp_path):
    # Twice 10 V brake 0.1 V s^2/m, the lower bound, by 200 m/s^2.
    allowed = machine(axes__x__limits__max_acceleration_m_s2=200.0)
    assert problems(tmp_path, allowed) == ()
    beyond = machine(axes__x__limits__max_acceleration_m_s2=201.0)
    parts = ["found 201", "never be followed", "10 V", "0.1 V*s^2/m", "200 m/s^2"]
    tells_one(tmp_path, beyond, "axes.x.limits.max_acceleration_m_s2", parts)


def notes_with(tmp_path, words, **changes):
    notes = summarise(load(write(tmp_path, machine(**changes))))["notes"]
    return [note for note in notes if words in note]


def test_a_ramp_that_is_more_than_the_motor_has_is_noted_with_its_arithmetic(tmp_path):
    # 10 V accelerate 0.2 V s^2/m, theta(0), by 50 m/s^2.
    def told(**limits):
        changes = {f"axes__x__limits__{key}": value for key, value in limits.items()}
        return notes_with(tmp_path, "more than the motor has", **changes)

    assert told(max_acceleration_m_s2=50.0, stop__acceleration_m_s2=50.0) == []
    (hard,) = told(max_acceleration_m_s2=51.0)
    assert hard.startswith("axis x: limits.max_acceleration_m_s2 51 m/s^2 is more than")
    assert "10 V accelerate 0.2 V*s^2/m" in hard
    assert "by 50 m/s^2" in hard
    _, stop = told(max_acceleration_m_s2=60.0, stop__acceleration_m_s2=51.0)
    assert stop.startswith("axis x: limits.stop.acceleration_m_s2 51 m/s^2 is more than")


def test_a_way_without_samples_that_is_half_the_travel_is_noted(tmp_path):
    def told(ticks):
        late = {"hold_ticks": ticks}
        return notes_with(tmp_path, "without a sample", drivers__line__late=late)

    assert told(399) == []
    (note,) = told(400)
    assert "hold_ticks 400" in note
    assert "0.2 s without a sample, 0.2 m at 1 m/s" in note


def test_an_error_that_may_be_half_the_travel_in_fast_motion_is_noted(tmp_path):
    def told(slope_s):
        changes = {"axes__x__limits__following_error__per_velocity_s": slope_s}
        return notes_with(tmp_path, "limits.following_error allows", **changes)

    assert told(0.198) == []
    (note,) = told(0.2)
    assert "at 1 m/s" in note
    assert "0.201 m" in note


def test_a_way_within_the_filter_time_that_is_half_the_travel_is_noted(tmp_path):
    def told(time_s):
        changes = {"axes__x__limits__following_error__filter_time_s": time_s}
        return notes_with(tmp_path, "filter_time_s", **changes)

    assert told(0.199) == []
    (note,) = told(0.2)
    assert "0.2 m at 1 m/s, half of the travel of 0.4 m" in note


def test_a_following_error_that_is_half_the_travel_in_all_is_noted(tmp_path):
    def told(filter_time_s):
        error = {"minimum_m": 0.05, "per_velocity_s": 0.05, "filter_time_s": filter_time_s}
        changes = {"axes__x__limits__following_error": error}
        return notes_with(tmp_path, "ahead of an axis that stands", **changes)

    assert told(0.09) == []
    (note,) = told(0.11)
    assert "at 1 m/s" in note
    assert "0.21 m ahead of an axis that stands, half of the travel of 0.4 m or more" in note
    assert "leaves it 0.1 m, and 0.11 m pass in its filter time" in note


def on_a_bus(name, time_s, **driver):
    """Return a shipped machine as plain data, with a pause of the computer that x would bear."""
    data = yaml.safe_load(shipped_config(name).read_text())
    data["axes"]["x"]["guards"] = {"host_frozen": {"time_s": time_s}}
    data["drivers"]["gantry"] |= driver
    return data


def test_a_pause_that_the_device_does_not_bear_is_refused_as_doing_nothing(tmp_path):
    assert problems(tmp_path, on_a_bus("can_gantry", 0.05)) == ()
    parts = ["found 0.5", "does nothing", "after 0.05 s already", "device's watchdog", "at most"]
    key = "axes.x.guards.host_frozen.time_s"
    tells_one(tmp_path, on_a_bus("can_gantry", 0.5), key, parts)


def test_a_pause_beyond_which_every_sample_is_too_old_is_refused_as_doing_nothing(tmp_path):
    # 3 periods at 500 Hz; one exchange carries command and sample.
    late = {"late": {"hold_ticks": 3}, "rate_hz": 500}
    assert problems(tmp_path, on_a_bus("modbus_gantry", 0.006, **late)) == ()
    parts = ["found 0.007", "does nothing", "after 0.006 s already", "late.hold_ticks 3", "500 Hz"]
    data = on_a_bus("modbus_gantry", 0.007, **late)
    tells_one(tmp_path, data, "axes.x.guards.host_frozen.time_s", parts)


def waiting(**loop):
    """Return the shipped gantry as plain data; its simulated plant can wait for the computer."""
    data = yaml.safe_load(shipped_config("published_gantry").read_text())
    data["loop"] |= loop
    return data


@pytest.mark.parametrize("guard", [{"time_s": 0.05}, {"reaction": "quick_stop"}])
def test_a_frozen_computer_cannot_be_guarded_against_where_the_machine_waits_for_it(
    tmp_path, guard
):
    data = waiting()
    data["axes"]["y"]["guards"] = {"host_frozen": guard}
    parts = ["can never trip", "loop.without_realtime is wait"]
    tells_one(tmp_path, data, "axes.y.guards.host_frozen", parts)
    data["loop"]["without_realtime"] = "degrade"
    assert problems(tmp_path, data) == ()


def test_what_is_written_of_a_frozen_computer_but_asks_for_nothing_is_allowed(tmp_path):
    data = waiting()
    data["axes"]["y"]["guards"] = {"host_frozen": {"time_s": None, "reaction": "disable"}}
    assert problems(tmp_path, data) == ()


@pytest.mark.parametrize(
    ("loop", "frozen_s", "silent_s"),
    [
        ({"without_realtime": "degrade"}, 0.1, 0.5),
        ({"without_realtime": "wait"}, None, 5.0),
        ({"without_realtime": "wait", "supervisor_timeout_s": 8.0}, None, 8.0),
        ({"without_realtime": "degrade", "supervisor_timeout_s": 2.0}, 0.1, 2.0),
    ],
)
def test_the_times_that_a_loop_really_allows_are_told(tmp_path, loop, frozen_s, silent_s):
    machine_ = load(write(tmp_path, waiting(**loop)))
    for axis in summarise(machine_)["axes"].values():
        assert axis["guards"]["host_frozen"]["time_s"] == frozen_s
        assert axis["guards"]["supervisor_lost"]["time_s"] == silent_s
    assert machine_.loop.patience_s == silent_s


def test_a_machine_can_be_built_again_from_what_its_log_holds(tmp_path):
    thermal = {"continuous_voltage_v": 3.0, "time_constant_s": 5.0}  # trips before the default
    first = load(write(tmp_path, machine(axes__x__guards={"thermal": thermal})))
    again = load_resolved(first.resolved, hardware=True)
    assert again.axes["x"].guards == first.axes["x"].guards


def test_a_saturation_guard_that_the_motors_heat_always_precedes_is_refused(tmp_path):
    thermal = {"continuous_voltage_v": 3.0, "time_constant_s": 5.0}
    data = machine(axes__x__guards={"thermal": thermal, "saturation": {"time_s": 0.6}})
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.x.guards.saturation.time_s"
    assert "0.472 s at 10 V" in told.message


def test_what_is_not_written_has_a_default_that_check_tells(tmp_path):
    guards = summarise(load(write(tmp_path, machine())))["axes"]["x"]["guards"]
    assert guards["encoder_stuck"]["distance_m"] == 0.001
    assert guards["saturation"]["time_s"] == 0.5
    assert guards["host_frozen"]["time_s"] == 0.1
    assert guards["encoder_noise"] is None
    assert guards["thermal"] is None


def test_guards_may_be_switched_off_but_not_all(tmp_path):
    off = {"encoder_stuck": None, "saturation": None}
    guards = load(write(tmp_path, machine(axes__x__guards=off))).axes["x"].guards
    assert guards.encoder_stuck is None
    assert guards.saturation is None
    (told,) = problems(tmp_path, machine(axes__x__guards={"host_frozen": None}))
    assert told.key == "axes.x.guards.host_frozen"


NO_RAMP = {
    "encoder_lost": "position",
    "encoder_jump": "position",
    "encoder_stuck": "position",
    "encoder_noise": "position",
    "not_a_number": "no command",
    "amplifier": "nothing brakes",
    "estop": "power",
    "communication": "device",
    "no_new_sample": "device",
}
NEEDED = {"encoder_noise": {"rms_m": 1e-4}}


def test_every_guard_that_can_only_let_go_is_tried_here():
    assert set(NO_RAMP) == set(NO_QUICK_STOP)


@pytest.mark.parametrize(("guard", "why"), NO_RAMP.items())
def test_a_quick_stop_where_nothing_could_follow_it_is_refused_once_with_the_reason(
    tmp_path, guard, why
):
    keys = NEEDED.get(guard, {}) | {"reaction": "quick_stop"}
    (told,) = problems(tmp_path, machine(axes__x__guards={guard: keys}))
    assert told.key == f"axes.x.guards.{guard}.reaction"
    assert told.line is not None
    assert told.message.startswith("found 'quick_stop', should be disable: ")
    assert why in told.message


@pytest.mark.parametrize(
    "guard",
    ["following_error", "soft_limit", "limit_switch", "overspeed", "saturation", "host_frozen",
     "late_ticks", "supervisor_lost"],
)  # fmt: skip
def test_each_guard_of_an_axis_in_order_may_ramp_it_down_or_let_it_go(tmp_path, guard):
    for reaction in ("quick_stop", "disable"):
        guards = {guard: {"reaction": reaction}}
        data = machine(axes__x__guards=guards, loop__overrun_policy="leaky_bucket")
        assert problems(tmp_path, data) == ()


def test_a_reaction_that_there_is_not_is_refused(tmp_path):
    data = machine(axes__x__guards={"overspeed": {"reaction": "quickstop"}})
    (told,) = problems(tmp_path, data)
    assert "did you mean 'quick_stop'?" in told.message


def test_without_a_word_of_it_every_guard_reacts_as_it_always_did(tmp_path):
    guards = load(write(tmp_path, machine())).axes["x"].guards
    ramps = {name for name, guard in guards if guard and guard.reaction == "quick_stop"}
    assert ramps == {"late_ticks", "supervisor_lost", "partner"}
