import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.report import motion_advice
from motorctl.model import Spans, known_effects
from motorctl.motion import AxisLimits, check_program, load_program_file


def advise(names, data, spans):
    return motion_advice.advise([known_effects()[name] for name in names], data, spans)


DECLARED = ("inertia", "viscous_friction", "coulomb_friction", "offset")


def recorded(low=0.0, high=0.4, speed=1.0, acceleration=10.0, duration_s=24.0):
    """Return a recording's spans, and signals as far as advice looks at them."""
    count = 2000
    t = np.arange(count) * 1e-3
    data = Measured("run", "x", 1e3, t, 0 * t, 0 * t, np.ones(count, bool))
    spans = Spans(
        (low, high), speed, acceleration, 9.0, (0.0, duration_s), 1e-3, 100.0, 1e-6, ("y",)
    )
    return data, spans


def as_program(keys, folder):
    path = folder / "motion.yaml"
    path.write_text(yaml.safe_dump(dict(keys), sort_keys=False))
    return load_program_file(path, ["x"])


@pytest.mark.slow
@settings(max_examples=40)
@given(
    effects=st.lists(st.sampled_from(sorted(known_effects())), max_size=4),
    low=st.floats(-5.0, 5.0),
    travel=st.floats(1e-3, 50.0),
    speed=st.floats(1e-2, 20.0),
    acceleration=st.floats(0.1, 500.0),
)
def test_the_motion_stays_within_what_the_recording_used(
    tmp_path_factory, effects, low, travel, speed, acceleration
):
    data, spans = recorded(low, low + travel, speed, acceleration)
    program = as_program(advise(effects, data, spans), tmp_path_factory.mktemp("motion"))
    limits = AxisLimits((low, low + travel), speed, acceleration, acceleration / 0.02, 10.0)
    assert check_program(program, {"x": limits}) == []


@pytest.mark.parametrize("name", sorted(known_effects()))
def test_there_is_a_motion_for_every_effect(name, tmp_path):
    program = as_program(advise([name], *recorded()), tmp_path)
    assert program.trajectories()["x"].duration_s > 10.0


def moves(effects):
    return advise(effects, *recorded())["moves"]


def test_time_and_place_are_parted_by_two_speeds_over_the_same_way():
    full = [m for m in moves(["cogging", "periodic_disturbance"]) if m["dwell_s"] == 0.1]
    assert len({m["max_velocity_m_s"] for m in full}) >= 2
    assert len({m["target_m"] for m in full}) == 1


def test_ripple_and_cogging_are_parted_by_two_accelerations_at_one_speed():
    plain, parted = moves([]), moves(["force_ripple", "cogging"])
    added = [m for m in parted if m not in plain and m["max_velocity_m_s"] == 0.7992]
    accelerations = {m["max_acceleration_m_s2"] for m in added}
    assert max(accelerations) >= 3.0 * min(accelerations)


def test_presliding_and_stribeck_are_parted_by_slow_reversals():
    slow = [m for m in moves(["presliding", "stribeck"]) if m["max_velocity_m_s"] <= 0.01]
    targets = [m["target_m"] for m in slow]
    assert len(slow) >= 10
    assert min(abs(np.diff(targets))) < 0.01 * 0.4


def test_a_slow_change_asks_for_a_longer_run(tmp_path):
    program = as_program(advise(["gain_drift"], *recorded(duration_s=60.0)), tmp_path)
    assert program.cycles > 1
    assert program.trajectories()["x"].duration_s >= 2.5 * 60.0


def test_the_jerk_is_that_of_the_recording_where_it_tells(tmp_path):
    data, spans = recorded()
    ramp = np.clip(np.arange(2000) - 500, 0, 50) * 4e-3  # 4 m/s^3 * 1e-3 s a sample
    velocity = np.cumsum(ramp) * 1e-3
    data = Measured(**{**vars(data), "reference_velocity": velocity})
    (jerk,) = {m["max_jerk_m_s3"] for m in advise([], data, spans)["moves"]}
    assert jerk == pytest.approx(4.0, rel=0.01)


def test_an_axis_that_did_not_move_gets_no_motion():
    assert advise(["cogging"], *recorded(high=0.0)) == {}
