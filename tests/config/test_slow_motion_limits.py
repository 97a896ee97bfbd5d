"""Limits that slow motion, or the axis' own program, brings a machine beyond: refused, or noted."""

import pytest
import yaml
from config_bench import drop, machine, problems, write

from motorctl.config import load, shipped_config, summarise


def beam(**skew):
    """Return the shipped beam as plain data, with these keys of its skew guard."""
    data = yaml.safe_load(shipped_config("dual_gantry").read_text())
    data["axes"]["x"]["guards"]["skew"].update(skew)
    return data


def notes(tmp_path, data, words):
    return [note for note in summarise(load(write(tmp_path, data)))["notes"] if words in note]


# The bench: 0.1 V of friction, ks 40 V s/m, k1 100 1/s, gamma_d 100 V/m: at worst 17.5 um,
# at 0.22 mm/s.


@pytest.mark.parametrize("limit_m", [2.1e-6, 17e-6])
def test_a_stuck_encoder_that_every_slow_motion_would_trip_is_refused(tmp_path, limit_m):
    data = machine(axes__x__guards={"encoder_stuck": {"distance_m": limit_m}})
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.x.guards.encoder_stuck.distance_m"
    assert told.line is not None
    for part in (f"found {limit_m:g}", "always trip in slow motion", "of 0.1 V", "by 1.75e-05 m"):
        assert part in told.message
    data["axes"]["x"]["guards"]["encoder_stuck"]["distance_m"] = 18e-6
    assert problems(tmp_path, data) == ()


def test_a_following_error_below_what_friction_holds_back_is_refused_with_the_guards_that_trip(
    tmp_path,
):
    data = machine(axes__x__limits__following_error={"minimum_m": 2.1e-6, "filter_time_s": 0.002})
    (told,) = problems(tmp_path, data)
    assert told.key == "axes.x.limits.following_error.minimum_m"
    assert "guards.following_error and guards.encoder_stuck (whose distance_m" in told.message
    assert "should be above that" in told.message


def test_a_following_error_that_does_not_last_trips_nothing_but_a_stuck_encoder(tmp_path):
    error = {"minimum_m": 2.1e-6, "filter_time_s": 0.3}
    data = machine(axes__x__limits__following_error=error, axes__x__limits__max_velocity_m_s=0.6)
    (told,) = problems(tmp_path, data)
    assert "guards.following_error" not in told.message
    assert "guards.encoder_stuck" in told.message
    data["axes"]["x"]["guards"] = {"encoder_stuck": None}
    assert problems(tmp_path, data) == ()


def test_friction_that_the_model_takes_away_at_once_holds_nothing_back(tmp_path):
    data = machine(axes__x__guards={"encoder_stuck": {"distance_m": 17e-6}})
    data["axes"]["x"]["model"]["coulomb_friction"]["slope_s_m"] = float("inf")
    assert problems(tmp_path, data) == ()


def test_what_a_log_holds_can_be_read_whatever_its_limits_are(tmp_path):
    data = machine(axes__x__guards={"encoder_stuck": {"distance_m": 17e-6}})
    assert load(write(tmp_path, data), hardware=False).axes["x"].guards.encoder_stuck


# The shipped beam: led to square at 2 mm/s it stays 4 um behind, 16 um with its friction.


def test_a_skew_limit_that_every_squaring_would_trip_is_refused(tmp_path):
    (told,) = problems(tmp_path, beam(limit_m=2e-6))
    assert told.key == "axes.x.guards.skew.limit_m"
    assert told.line is not None
    for part in ("found 2e-06", "always trip", "squaring_velocity_m_s 0.002 m/s", "4.03e-06 m"):
        assert part in told.message


def test_a_beam_that_is_squared_more_slowly_stays_less_behind(tmp_path):
    data = beam(limit_m=2e-6)
    data["axes"]["x"]["model"]["coulomb_friction"]["initial"] = 0.0
    data["axes"]["x"]["model"]["coulomb_friction"]["bounds"] = [0.0, 0.4]
    data["axes"]["x"]["dual_drive"]["skew"]["squaring_velocity_m_s"] = 0.8e-3
    assert problems(tmp_path, data) == ()


def test_a_skew_limit_that_half_of_the_friction_trips_in_every_squaring_is_refused(tmp_path):
    # 10 counts: a simulation trips 3 ms after the start.
    (told,) = problems(tmp_path, beam(limit_m=5e-6))
    assert told.key == "axes.x.guards.skew.limit_m"
    for part in ("found 5e-06", "always trip", "9.17e-06 m behind", "0.04 V", "0.5 of that at"):
        assert part in told.message
    assert problems(tmp_path, beam(limit_m=9.2e-6)) == ()


def test_a_skew_limit_that_friction_may_trip_while_squaring_is_noted(tmp_path):
    assert notes(tmp_path, beam(limit_m=17e-6), "friction holds a beam back") == []
    (note,) = notes(tmp_path, beam(limit_m=16e-6), "friction holds a beam back")
    assert "1.63e-05 m: 0.08 V at theta(0)" in note


def test_a_skew_limit_that_the_program_may_trip_is_noted_with_how_far_the_ends_may_differ(tmp_path):
    # In its program the beam, whose second motor is 8 % weaker, skews by 66 um.
    assert notes(tmp_path, beam(limit_m=130e-6), "in program 'shuttle'") == []
    (note,) = notes(tmp_path, beam(limit_m=60e-6), "in program 'shuttle'")
    assert "guards.skew.limit_m 6e-05" in note
    assert "where the ends differ by 0.12 of its command" in note


# The shipped gantry: 35.6 m/s^2 by half of 0.2 ms and k1 250 1/s are 14.2 um, and 14.6 um at most.


def published(minimum_m, **error):
    data = yaml.safe_load(shipped_config("published_gantry").read_text())
    data["axes"]["x"]["limits"]["following_error"] = {"minimum_m": minimum_m, **error}
    return data


def test_a_following_error_that_the_law_itself_trips_in_every_program_is_refused(tmp_path):
    (told,) = problems(tmp_path, published(10e-6))
    assert told.key == "axes.x.limits.following_error.minimum_m"
    assert told.line is not None
    for part in ("found 1e-05", "always trip in program 'published_x'", "k1 250", "1.46e-05 m"):
        assert part in told.message
    assert problems(tmp_path, published(15e-6)) == ()
    assert problems(tmp_path, published(10e-6, per_velocity_s=0.001)) == ()  # it is fast by then
    data = published(10e-6)
    data["axes"]["x"]["gains"]["velocity"] = "matched"
    assert problems(tmp_path, data) == ()


def test_a_following_error_that_the_law_comes_near_to_is_noted(tmp_path):
    words = "what the law itself stays behind"
    assert notes(tmp_path, published(44e-6), words) == []
    (note,) = notes(tmp_path, published(20e-6), words)
    assert "minimum_m 2e-05 is less than 3 times" in note
    assert "in program 'published_x', 1.46e-05 m" in note


# The motor's heat


def beam_with(volts, seconds=10.0):
    data = beam()
    thermal = {"continuous_voltage_v": volts, "time_constant_s": seconds}
    data["axes"]["x"]["guards"]["thermal"] = thermal
    return data


def test_a_limit_of_heat_that_a_warm_motor_passes_in_its_program_is_refused(tmp_path):
    # The model needs 0.862 V rms; the motor of the simulated beam comes to 0.936 V.
    (told,) = problems(tmp_path, beam_with(0.867))
    assert told.key == "axes.x.guards.thermal.continuous_voltage_v"
    for part in ("found 0.867", "always trip", "0.862 V rms", "0.907 V with 5% more", "0.065 V"):
        assert part in told.message


def test_a_filter_of_the_command_keeps_the_noise_of_the_count_from_the_motor(tmp_path):
    data = machine(
        axes__x__encoder__resolution_m=5e-6,
        axes__x__guards={"thermal": {"continuous_voltage_v": 0.18, "time_constant_s": 10.0}},
    )
    drop(data, "axes.x.program")
    (told,) = problems(tmp_path, data)
    assert "0.16 V rms that the steps of the count add" in told.message
    low_pass = {"kind": "low_pass", "frequency_hz": 200.0, "damping": 0.7}
    data["axes"]["x"]["gains"]["command_filter"] = low_pass
    assert problems(tmp_path, data) == ()
    low_pass["frequency_hz"] = 1100.0  # half of the rate is 1000 Hz
    assert "axes.x.gains.command_filter.frequency_hz" in {p.key for p in problems(tmp_path, data)}


def test_a_limit_of_heat_that_more_friction_would_trip_is_noted(tmp_path):
    words = "guards.thermal.continuous_voltage_v"
    assert notes(tmp_path, beam_with(1.13), words) == []
    (note,) = notes(tmp_path, beam_with(0.95), words)
    assert "10% above what program 'shuttle' needs at theta(0), 0.862 V rms" in note


def test_a_time_constant_that_no_motor_has_is_refused_with_the_hours_that_it_means(tmp_path):
    assert problems(tmp_path, beam_with(3.5, 7200.0)) == ()
    (told,) = problems(tmp_path, beam_with(9.0, 1e5))
    assert told.key == "axes.x.guards.thermal.time_constant_s"
    for part in ("found 100000", "10 V would have to stand for 46.1 h", "at most", "7200 s"):
        assert part in told.message
