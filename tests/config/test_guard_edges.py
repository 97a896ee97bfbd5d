"""Guards at the edge of what can trip, or always would: just taken, and just refused or noted."""

import copy

import config_bench
import pytest
import yaml
from config_bench import MACHINE, drop, machine, problems, write

from motorctl.config import load, shipped_config
from motorctl.config.summary import summarise
from motorctl_sim import SimOptions
from motorctl_sim.options.presets import PRESETS

# The machine: 1 m/s, 2 kHz, counts of 1 um, 10 V, following error 1 mm for 2 ms, k1 100, ks 40.


def takes(folder, **changes):
    assert problems(folder, machine(**changes)) == ()


def refuses(folder, key, *parts, **changes):
    (told,) = problems(folder, machine(**changes))
    assert told.key == key
    assert told.line is not None
    for part in parts:
        assert part in told.message


def noted(folder, words, **changes):
    notes = summarise(load(write(folder, machine(**changes))))["notes"]
    return [note for note in notes if words in note]


# Counters


def test_a_counter_whose_jump_comes_before_overspeed_is_refused(tmp_path):
    # The top speed is 500 counts a tick, overspeed 602; a quarter of 11 bits is 512, of 12 1024.
    told = ("found 11", "500 a tick", "512, is a jump", "guards.overspeed, beyond 602, can never",
            "needs 12 bits")  # fmt: skip
    refuses(tmp_path, "axes.x.encoder.counter_bits", *told, axes__x__encoder__counter_bits=11)
    takes(tmp_path, axes__x__encoder__counter_bits=12)


def test_a_counter_that_a_late_read_takes_a_quarter_round_is_refused(tmp_path):
    def fast(speed):
        return {
            "axes__x__encoder__counter_bits": 12,
            "axes__x__limits__max_velocity_m_s": speed,
        }

    takes(tmp_path, **fast(1.023))
    told = ("found 12", "512 a tick", "1024, is a jump", "read late, of up to 1024", "13 bits")
    refuses(tmp_path, "axes.x.encoder.counter_bits", *told, **fast(1.024))


# Heat

HOT = "axes.x.guards.thermal.continuous_voltage_v"


def heat(volts, seconds):
    thermal = {"continuous_voltage_v": volts, "time_constant_s": seconds}
    return {"axes__x__guards": {"thermal": thermal}}


def test_a_motor_that_the_peak_of_its_program_always_trips_is_refused(tmp_path):
    # 10 m/s^2 of 0.2 V s^2/m, and friction: 2.2 V for 50 ms; the rms of all of it is 0.9 V.
    told = ("found 2.2", "would always trip", "at its hottest program 'there' needs 2.",
            "time_constant_s 0.001 s", "make the program slower")  # fmt: skip
    refuses(tmp_path, HOT, *told, **heat(2.2, 1e-3))
    takes(tmp_path, **heat(2.35, 1e-3))  # 5 % more for a warm motor


def test_a_motor_that_is_slow_to_warm_is_judged_by_the_mean(tmp_path):
    # Warm, and with what the count's steps of 1 um add: 40 V s/m by 1 um by 2 kHz by sqrt(6).
    takes(tmp_path, **heat(0.58, 1.0))
    told = ("needs 0.544 V rms over time_constant_s 1 s", "5% more", "0.033 V rms that the steps")
    refuses(tmp_path, HOT, *told, **heat(0.57, 1.0))


def test_a_motor_that_warms_from_cycle_to_cycle_is_judged_by_the_last(tmp_path):
    def cycles(number, volts):
        there = {
            "kind": "back_and_forth", "axis": "x", "start_m": 0.0, "distance_m": 0.2,
            "max_velocity_m_s": 0.5, "max_acceleration_m_s2": 10.0, "jerk_time_s": 0.02,
            "period_s": 1.2, "cycles": number,
        }  # fmt: skip
        return {"programs__there": there} | heat(volts, 10.0)

    takes(tmp_path, **cycles(1, 0.5))
    refuses(tmp_path, HOT, "would always trip", **cycles(40, 0.5))


# Noise

RMS = "axes.x.guards.encoder_noise.rms_m"


def noise(rms_m, **limits):
    changes = {f"axes__x__limits__{key}": value for key, value in limits.items()}
    return {"axes__x__guards": {"encoder_noise": {"rms_m": rms_m}}, **changes}


def test_noise_that_overspeed_precedes_is_refused(tmp_path):
    # Steps have rms_m / sqrt(3); of five in a row three hang together with no other: 2.64 sigma.
    told = ("found 0.000396", "hardly ever trip", "overspeed, 5 steps in a row beyond 0.000602 m",
            "at most 0.000395")  # fmt: skip
    takes(tmp_path, **noise(0.000395))
    refuses(tmp_path, RMS, *told, **noise(0.000396))


def test_noise_that_a_following_error_precedes_is_refused(tmp_path):
    # Positions have rms_m / sqrt(6), and without a filter one of 5 sigma trips.
    error = {"following_error": {"minimum_m": 0.0005}}
    takes(tmp_path, **noise(0.000244, **error))
    told = (
        "found 0.000246",
        "a following error, 1 more beyond 0.0005 m than within",
        "at most 0.000244",
    )
    refuses(tmp_path, RMS, *told, **noise(0.000246, **error))


def test_noise_that_lies_beyond_a_following_error_half_of_the_time_is_refused(tmp_path):
    # However long the filter is: 401 more beyond than within come where half of them are beyond.
    error = {"following_error": {"minimum_m": 0.0001, "filter_time_s": 0.2}}
    takes(tmp_path, **noise(0.000355, **error))
    told = ("a following error, 401 more beyond 0.0001 m than within", "at most 0.000355")
    refuses(tmp_path, RMS, *told, **noise(0.000357, **error))


def test_noise_that_a_jump_of_the_counter_precedes_is_refused(tmp_path):
    # A quarter of 12 bits is 1.024 mm: 5 sigma of the steps.
    def narrow(rms_m):
        return noise(rms_m) | {"axes__x__encoder__counter_bits": 12}

    takes(tmp_path, **narrow(0.000354))
    told = ("found 0.000356", "a jump of the encoder, a step of 0.00102 m", "at most 0.000354")
    refuses(tmp_path, RMS, *told, **narrow(0.000356))


def test_where_no_limit_of_the_noise_would_do_its_removal_is_advised(tmp_path):
    # 0.01 m/s is 5 counts a tick: the full voltage moves the axis by as much as is an overspeed.
    slow = {
        "axes__x__limits__max_velocity_m_s": 0.01,
        "axes__x__homing__search_velocity_m_s": -0.01,
        "axes__x__homing__timeout_s": 60.0,
        "axes__x__program": None,
        "programs": {},
    }
    refuses(tmp_path, RMS, "no limit would do", "removed", **slow, **noise(1.5e-5))


# What does nothing


@pytest.mark.parametrize("policy", ["count", "stop"])
def test_a_bucket_that_nothing_is_put_into_is_refused(tmp_path, policy):
    told = ("found 5", f"loop.overrun_policy is {policy}", "does nothing", "leaky_bucket")
    changes = {"loop__overrun_policy": policy, "loop__bucket_size": 5}
    refuses(tmp_path, "loop.bucket_size", *told, **changes)
    takes(tmp_path, loop__overrun_policy=policy, loop__bucket_size=10)  # as a log says it
    takes(tmp_path, loop__overrun_policy="leaky_bucket", loop__bucket_size=5)


def test_a_reaction_to_partners_of_an_axis_that_is_alone_is_refused(tmp_path):
    guards = {"partner": {"reaction": "disable"}}
    told = ("can never trip", "'x' is the machine's one axis", "remove the guard")
    refuses(tmp_path, "axes.x.guards.partner", *told, axes__x__guards=guards)
    takes(tmp_path, axes__x__guards={"partner": {"reaction": "quick_stop"}})  # as a log says it
    two = machine(axes__x__guards=guards)
    two["axes"]["y"] = {**copy.deepcopy(MACHINE["axes"]["x"]), "channel": 1, "program": None}
    assert problems(tmp_path, two) == ()


@pytest.mark.parametrize("preset", PRESETS)
def test_a_simulated_axis_without_limit_switches_is_noted(tmp_path, preset):
    def advice(**plant):
        room = {"travel_m": [-0.2, 0.4], "limit_switches_m": [-0.15, 0.35]}
        seen = {"home_switch": {"to_m": -0.05}, "encoder": {"index_marks_m": [-0.04]}}
        plants = {0: room | seen | plant}
        changes = {"drivers__line": {"type": "sim", "preset": preset, "plants": plants}}
        return noted(tmp_path, "guards.limit_switch never trips", **changes)

    assert SimOptions(preset=preset).plant(0).limit_switches_m is not None
    assert advice() == []
    (note,) = advice(limit_switches_m=None)
    assert "no limit_negative and limit_positive for x" in note


def gantry_without_switches(name):
    """Return a shipped machine as plain data whose driver is told of no limit switch of x."""
    data = yaml.safe_load(shipped_config(name).read_text())
    driver = data["drivers"]["gantry"]
    if driver["type"] == "sim":
        driver["plants"] = {0: {"limit_switches_m": None}}
    return data


@pytest.mark.parametrize("name", ["published_gantry", "can_gantry", "canopen_gantry"])
def test_a_reaction_to_limit_switches_that_nothing_tells_of_is_refused(tmp_path, name):
    data = gantry_without_switches(name)
    data["axes"]["x"]["guards"] = {"limit_switch": {"reaction": "quick_stop"}}
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.x.guards.limit_switch"
    assert told.line is not None
    for part in ("can never trip", "told of no limit switch of 'x'", "or remove the guard here"):
        assert part in told.message
    data["axes"]["x"]["guards"] = {"limit_switch": {"reaction": "disable"}}  # as a log says it
    assert problems(tmp_path, data) == ()


def test_a_reaction_to_limit_switches_that_are_told_is_taken(tmp_path):
    data = yaml.safe_load(shipped_config("published_gantry").read_text())
    data["axes"]["x"]["guards"] = {"limit_switch": {"reaction": "quick_stop"}}
    assert problems(tmp_path, data) == ()


@pytest.mark.parametrize(
    ("plant", "word"),
    [({"home_switch": None}, "home switch"), ({"encoder": {"index_marks_m": []}}, "index mark")],
)
def test_homing_by_what_a_simulated_plant_lacks_is_refused(tmp_path, plant, word):
    data = yaml.safe_load(shipped_config("small_stage").read_text())
    data["drivers"]["stage"]["plants"] = {0: plant}
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.x.homing.method"
    for part in ("found 'switch_index'", f"told of no {word}", "never find it", "simulated plant"):
        assert part in told.message


# What nearly always trips


def test_a_device_with_a_clock_of_its_own_has_to_be_waited_for_a_tick(tmp_path, monkeypatch):
    takes(tmp_path, drivers__line__late={"hold_ticks": 0})
    monkeypatch.setattr(config_bench.BenchDriver, "exchange_delay_periods", 0.5)
    told = ("found 0", "always trip", "a clock of its own", "at least 1")
    changes = {"drivers__line__late": {"hold_ticks": 0}}
    refuses(tmp_path, "drivers.line.late.hold_ticks", *told, **changes)
    takes(tmp_path, drivers__line__late={"hold_ticks": 1})


@pytest.mark.parametrize(
    ("config", "asked", "free"),
    [
        ("serial_gantry", {"mode": "poll"}, {"mode": "stream"}),
        ("can_gantry", {"sync": {"id": 0x80, "wait_s": 700e-6}}, {"sync": None}),
    ],
)
def test_of_one_bus_only_the_mode_without_asking_needs_a_tick_of_patience(
    tmp_path, config, asked, free
):
    data = yaml.safe_load(shipped_config(config).read_text())
    data["drivers"]["gantry"] |= {"late": {"hold_ticks": 0}, **asked}
    assert problems(tmp_path, data) == ()
    data["drivers"]["gantry"] |= free
    (told,) = problems(tmp_path, data)
    assert told.key == "drivers.gantry.late.hold_ticks"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("limits.following_error.minimum_m", {"axes__x__limits__following_error": "minimum_m"}),
        ("guards.encoder_stuck.distance_m", {"axes__x__guards__encoder_stuck": "distance_m"}),
    ],
)
def test_a_limit_that_friction_takes_an_axis_beyond_is_noted(tmp_path, key, value):
    # 0.1 V of friction by 40 V s/m x 100 1/s: 25 um.
    ((place, name),) = value.items()

    def told(limit_m):
        changes = {"axes__x__guards": {}, place: {name: limit_m}}
        return noted(tmp_path, "less than friction holds", **changes)

    assert told(25.1e-6) == []
    (note,) = told(24.9e-6)
    assert key in note
    assert "2.5e-05 m: 0.1 V at theta(0) by ks k1 4000 V/m" in note


def test_an_axis_without_friction_of_the_direction_is_held_back_by_none(tmp_path):
    data = machine(axes__x__limits__following_error__minimum_m=3e-6)
    assert drop(data, "axes.x.model.coulomb_friction")
    notes = summarise(load(write(tmp_path, data)))["notes"]
    assert not any("friction holds" in note for note in notes)


def test_a_pause_that_is_usual_without_real_time_is_noted_where_it_trips(tmp_path):
    def told(time_s, **loop):
        changes = {f"loop__{key}": value for key, value in loop.items()}
        guards = {"host_frozen": {"time_s": time_s}}
        return noted(tmp_path, "pauses for up to", axes__x__guards=guards, **changes)

    assert told(0.01) == []
    assert told(0.001, without_realtime="refuse") == []
    (note,) = told(0.001)
    assert "guards.host_frozen.time_s 0.001" in note
    assert "0.01 s" in note


@pytest.mark.parametrize(
    ("loop", "key"),
    [
        ({"overrun_policy": "stop"}, "loop.overrun_policy: stop"),
        ({"overrun_policy": "leaky_bucket", "bucket_size": 1}, "loop.bucket_size 1"),
    ],
)
def test_late_ticks_that_stop_the_machine_at_the_first_are_noted_without_real_time(
    tmp_path, loop, key
):
    def told(**more):
        changes = {f"loop__{key}": value for key, value in {**loop, **more}.items()}
        return noted(tmp_path, "first late tick", **changes)

    (note,) = told()
    assert key in note
    assert told(without_realtime="refuse") == []
    assert noted(tmp_path, "first late tick", loop__overrun_policy="leaky_bucket") == []


def test_soft_limits_far_outside_the_travel_are_noted(tmp_path):
    def told(minimum_m):
        return noted(
            tmp_path, "guards.soft_limit", axes__x__limits__following_error__minimum_m=minimum_m
        )

    low, high = MACHINE["axes"]["x"]["limits"]["travel_m"]
    assert told(0.099 * (high - low)) == []
    (note,) = told(0.1 * (high - low))
    assert "10% of it or more" in note


def test_an_overspeed_that_a_coarse_encoder_makes_far_too_late_is_noted(tmp_path):
    # Two counts a period at 2 kHz: 0.8 m/s are 0.2 mm.
    def told(resolution_m):
        return noted(
            tmp_path, "guards.overspeed trips only", axes__x__encoder__resolution_m=resolution_m
        )

    assert told(0.199e-3) == []
    (note,) = told(0.2e-3)
    assert "only at 2 m/s, for a top speed of 1 m/s" in note


@pytest.mark.parametrize(("watchdog_s", "notes"), [(0.3, 2), (0.05, 0)])
def test_a_watchdog_within_which_an_axis_crosses_half_of_its_travel_is_noted(
    tmp_path, watchdog_s, notes
):
    data = yaml.safe_load(shipped_config("canopen_gantry").read_text())
    data["drivers"]["gantry"]["watchdog_s"] = 1.5 * watchdog_s  # a heartbeat may be under way
    data["drivers"]["gantry"]["sync"]["wait_s"] = 1.4e-3
    told = summarise(load(write(tmp_path, data)))["notes"]
    assert sum("goes on with the last command" in note for note in told) == notes


@pytest.mark.parametrize(("hold_ticks", "without"), [(0, "degrade"), (0, "refuse"), (2, "degrade")])
def test_a_bus_that_may_not_be_late_by_a_tick_is_noted_where_real_time_may_lack(
    tmp_path, hold_ticks, without
):
    data = yaml.safe_load(shipped_config("can_gantry").read_text())
    data["drivers"]["gantry"]["late"] = {"hold_ticks": hold_ticks, "predict": True}
    data["loop"]["without_realtime"] = without
    notes = summarise(load(write(tmp_path, data)))["notes"]
    told = [note for note in notes if "at the first sample that comes a tick late" in note]
    assert len(told) == (2 if (hold_ticks, without) == (0, "degrade") else 0)
