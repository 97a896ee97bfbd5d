"""The campaign's cases: what is drawn, that it is there in the plant, and that no log tells it."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from motorctl.config import load_resolved
from motorctl.errors import UsageError
from motorctl.log import AxisRecording, read_recording
from motorctl_benchmarks.diagnosis.cases import (
    Case,
    clean_case,
    draw_case,
    on_other_motion,
    plain,
    unknown_case,
    without_effects,
)
from motorctl_benchmarks.diagnosis.known_effects import KNOWN
from motorctl_benchmarks.diagnosis.record import record_case
from motorctl_benchmarks.diagnosis.unknown_effects import UNKNOWN

MOTIONS = ("rich", "repeated", "synchronised")
NAMED = [
    "cogging",
    "force_ripple",
    "stribeck",
    "asymmetric_friction",
    "presliding",
    "position_dependent_friction",
    "position_force",
    "quadratic_drag",
    "input_lag",
    "input_delay",
    "dead_zone",
    "gain_drift",
    "payload_change",
    "cross_axis",
    "flexible_mode",
    "encoder_error",
    "periodic_disturbance",
]
LATE = ("gain_drift", "payload_change", "force_steps")
"""Effects that may begin late in a recording; all others show from its first seconds on."""
OTHER_NOISE = 10**6

seeds = st.integers(0, 10**6)
motions = st.sampled_from(MOTIONS)


def plants(case: Case):
    return case.config["drivers"]["gantry"]["plants"]


def trajectories(case: Case):
    machine = load_resolved(case.config, hardware=True)
    return {
        axis: motion
        for name in machine.followed_programs
        for axis, motion in machine.programs[name].trajectories().items()
    }


def sizes(options) -> list[float]:
    """All numbers of an effect, in order."""
    if isinstance(options, dict):
        return [number for key in sorted(options) for number in sizes(options[key])]
    if isinstance(options, list):
        return [number for part in options for number in sizes(part)]
    return [options] if isinstance(options, float) else []


@pytest.mark.slow
def test_every_effect_that_a_diagnosis_can_name_is_drawn():
    assert sorted(KNOWN) == sorted(NAMED)
    drawn = {name for seed in range(80) for name in draw_case(seed, effects=2).effects}
    assert drawn == set(NAMED)


@pytest.mark.slow
@given(seeds, motions, st.integers(0, 3))
@settings(max_examples=8)
def test_every_case_is_a_sound_configuration_whose_motion_lasts(seed, motion, count):
    case = draw_case(seed, effects=count, motion=motion)
    assert len(set(case.effects)) == count
    assert case.known
    # Loading checks travel, speed, acceleration, jerk and the voltage of both programs.
    both = trajectories(case)
    assert set(both) == {"x", "y"}
    assert all(trajectory.duration_s >= 24.0 for trajectory in both.values())
    assert case.axis in both


@pytest.mark.slow
@pytest.mark.parametrize("name", [*KNOWN, *UNKNOWN])
def test_what_is_told_of_an_effect_stands_in_the_plant_of_its_axis_alone(name):
    case = draw_case(3, effects=(name,))
    clean = without_effects(case)
    assert case.effects == (name,)
    assert case.known == (name in KNOWN)
    channel = {"x": "0", "y": "1"}[case.axis]
    other = "1" if channel == "0" else "0"
    assert plants(case)[other] == plants(clean)[other]
    driver, cleaned = (c.config["drivers"]["gantry"] for c in (case, clean))
    put_in = [p for key, p in plants(case)[channel].items() if key not in plants(clean)[channel]]
    put_in += [fault for fault in driver.get("faults", []) if fault["channel"] == int(channel)]
    assert "faults" not in cleaned
    assert put_in
    assert set(sizes(case.truth[name])) <= set(sizes(put_in))
    load_resolved(case.config, hardware=True)
    load_resolved(clean.config, hardware=True)


def test_the_same_seed_gives_the_same_case_and_another_one_another():
    first = draw_case(5, effects=2, motion="synchronised")
    assert plain(first) == plain(draw_case(5, effects=2, motion="synchronised"))
    assert first.config != draw_case(6, effects=2, motion="synchronised").config


@pytest.mark.parametrize("name", [*KNOWN, *UNKNOWN])
def test_a_fifth_of_the_strength_is_the_same_shape_on_the_same_machine(name):
    full = draw_case(8, effects=(name,))
    weak = draw_case(8, effects=(name,), strength=0.2)
    assert weak.config["axes"] == full.config["axes"]
    assert weak.config["programs"] == full.config["programs"]
    ratios = [
        small / large
        for small, large in zip(sizes(weak.truth[name]), sizes(full.truth[name]), strict=True)
        if large
    ]
    # Lags and delays stay above 0.1 ms; what is no size (pitch, phase, speed, time) is the same.
    smallest = max(0.2, 1e-4 / full.truth[name].get("time_s", 1.0)) if len(ratios) == 1 else 0.2
    assert all(ratio == pytest.approx(1) or ratio == pytest.approx(smallest) for ratio in ratios)
    assert any(ratio == pytest.approx(smallest) for ratio in ratios)


def test_clean_and_unknown_cases_are_what_they_are_called():
    assert clean_case(4).effects == ()
    assert clean_case(4).config == without_effects(clean_case(4)).config
    unknown = [unknown_case(seed, "repeated") for seed in range(40)]
    assert {name for case in unknown for name in case.effects} == set(UNKNOWN)
    assert not any(case.known for case in unknown)


def test_an_effect_that_nothing_can_put_in_is_refused():
    with pytest.raises(UsageError, match="no effect 'gremlins' can be put in; known: cogging"):
        draw_case(1, effects=("gremlins",))


def test_another_motion_keeps_the_machine():
    case = draw_case(9, effects=("cogging",))
    other = on_other_motion(case, 77, "repeated")
    assert other.config["axes"] == case.config["axes"]
    assert other.truth == case.truth
    for key, plant in plants(case).items():
        changed = {k for k, part in plants(other)[key].items() if part != plant[k]}
        assert changed <= {"initial_position_m"}
    assert other.config["programs"] != case.config["programs"]
    assert on_other_motion(case, 9).config == case.config


@pytest.mark.slow
@given(seeds)
@settings(max_examples=4)
def test_synchronised_axes_do_the_same_in_the_same_tick_and_rich_ones_do_not(seed):
    t = np.linspace(0.0, 24.0, 12_001)
    both = trajectories(draw_case(seed, effects=0, motion="synchronised"))
    (x, vx, ax), (y, vy, ay) = (motion.sample(t) for motion in both.values())
    scale = np.ptp(y) / np.ptp(x)
    np.testing.assert_allclose(vy, scale * vx, atol=1e-6 * np.abs(vy).max())
    np.testing.assert_allclose(ay, scale * ax, atol=1e-3 * np.abs(ay).max())

    rich = [motion.sample(t) for motion in trajectories(draw_case(seed, effects=0)).values()]
    assert abs(np.corrcoef(rich[0][2], rich[1][2])[0, 1]) < 0.5
    for _, v, _ in rich:
        moving = np.abs(v)[np.abs(v) > 1e-6]
        assert moving.max() > 0.3
        assert np.mean((moving > 0.001) & (moving < 0.021)) > 0.01


@pytest.mark.slow
@given(seeds)
@settings(max_examples=4)
def test_repeated_axes_have_periods_apart(seed):
    machine = load_resolved(draw_case(seed, motion="repeated").config, hardware=True)
    periods = [program.period_s for program in machine.programs.values()]
    assert all(abs(a / b - 1) > 0.015 for a, b in combinations(periods, 2))


def record(case: Case, folder: Path, seconds: float) -> AxisRecording:
    log = record_case(case, folder, duration_s=seconds)
    return read_recording(log).axes[case.axis]


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def command_changes(name: str, seed: int, folder: Path, seconds: float) -> tuple[float, float]:
    """Rms change of the command below 100 Hz through an effect, and through other noise alone."""
    case = draw_case(seed, effects=(name,))
    clean = without_effects(case)
    noisy = json.loads(json.dumps(clean.config))
    noisy["drivers"]["gantry"]["seed"] += OTHER_NOISE
    other = Case(seed, case.axis, (), {}, 1.0, "rich", noisy)
    low = butter(4, 100.0, fs=case.config["rate_hz"], output="sos")
    with_it, without, again = (
        sosfiltfilt(low, record(c, folder, seconds).command) for c in (case, clean, other)
    )
    return rms(with_it - without), rms(again - without)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["input_delay", "cross_axis"])
def test_an_effect_changes_what_the_loop_does(name, tmp_path):
    change, noise = command_changes(name, 1, tmp_path, 6.0)
    assert change > 2.5 * noise


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", [*KNOWN, *UNKNOWN])
def test_every_effect_changes_what_the_loop_does(name, tmp_path):
    change, noise = command_changes(name, 5, tmp_path, 24.0 if name in LATE else 8.0)
    assert change > 3.0 * noise


@pytest.mark.slow
def test_a_log_tells_the_declared_machine_and_no_cause(tmp_path):
    case = draw_case(2, effects=("cogging", "stribeck"))
    log = record_case(case, tmp_path, duration_s=1.0)
    assert log == tmp_path / f"{case.name}.parquet"
    schema = pq.read_schema(log)
    metadata = schema.metadata[b"motorctl"].decode()
    for secret in ("plants", "cogging", "stribeck", "pitch"):
        assert secret not in metadata
    assert not any("cogging" in name for name in [*schema.names, log.name])
    machine = load_resolved(json.loads(metadata)["config"])
    assert machine.axes["x"].model.parameter_names[0] == "inertia"
    assert pq.read_metadata(log).num_rows == case.config["rate_hz"]


@pytest.mark.slow
def test_recording_again_gives_the_same_motion_to_the_bit(tmp_path):
    (tmp_path / "again").mkdir()
    case = draw_case(12, effects=2)
    first = record(case, tmp_path, 1.0)
    again = record(case, tmp_path / "again", 1.0)
    np.testing.assert_array_equal(first.position, again.position)
    np.testing.assert_array_equal(first.command, again.command)
