"""Where a recording shows little: what can still be told, and that no more is."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import diagnosed, moving, names, recorded

from motorctl.config import load
from motorctl.identify.columns.measured import measured
from motorctl.identify.columns.pieces import shortened
from motorctl.identify.columns.repetition import period_of
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.fit.declared_models import declared_models
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl_benchmarks.diagnosis.cases import clean_case, draw_case, on_other_motion
from motorctl_benchmarks.diagnosis.unknown_effects import UNKNOWN

FIRST, *OTHERS = UNKNOWN
SMOOTH = [(0.9, 0.15, 0.3, 0.0), (0.1, 0.15, 0.3, 0.0)] * 6
"""Share of the travel, speed [m/s], acceleration [m/s^2], dwell [s]: above 40 Hz it is noise."""
THERE_AND_BACK = [(0.9, 0.04, 0.5, 0.0), (0.5, 0.04, 0.5, 0.0)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [28, *(pytest.param(s, marks=pytest.mark.long) for s in (23, 24))])
def test_on_smooth_motion_the_feedback_of_noise_is_no_effect(tmp_path, seed):
    found = diagnosed(moving(clean_case(seed), 0.1, SMOOTH), tmp_path)
    assert found.verdict == "complete"
    assert names(found) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "seed"),
    [("input_delay", 23), pytest.param("input_lag", 23, marks=pytest.mark.long)],
)
def test_on_smooth_motion_a_late_command_is_timed_without_bias(tmp_path, effect, seed):
    case = draw_case(seed, effects=(effect,))
    found = diagnosed(moving(case, 0.1, SMOOTH), tmp_path)
    assert len(found.effects) == 1
    assert {found.effects[0].name, *found.effects[0].indistinguishable_from} >= {
        "input_lag",
        "input_delay",
    }
    time_s = found.effects[0].effect.options.time_s
    assert time_s == pytest.approx(case.truth[effect]["time_s"], rel=0.05)


@pytest.mark.slow
def test_a_move_there_and_back_is_answered_with_the_motion_that_would_tell(tmp_path):
    case = moving(draw_case(21, effects=("cogging",)), 0.5, THERE_AND_BACK)
    found = diagnosed(case, tmp_path)
    assert found.verdict == "insufficient_data"
    assert names(found) == []
    assert "speeds up or slows down only 3 times" in found.sentence
    assert found.missing[0].program is not None


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect", [FIRST, *(pytest.param(e, marks=pytest.mark.long) for e in OTHERS)]
)
def test_an_effect_outside_the_list_is_called_unknown(tmp_path, effect):
    found = diagnosed(draw_case(1001, effects=(effect,)), tmp_path, duration_s=24.0)
    assert found.verdict == "unknown_structure"
    assert found.unknown is not None
    assert found.unknown.sentence in found.sentence


@pytest.mark.long
@pytest.mark.slow
def test_one_published_move_again_and_again_brings_no_wrong_name(tmp_path):
    log = tmp_path / "run.parquet"
    simulate(load("published_gantry"), log, duration_s=30.0)
    recording = read_recording(log, gaps="keep")
    found = diagnose_recording(recording, declared_models(recording, None))
    for axis in ("x", "y"):
        named = names(found.axes[axis])
        assert "cogging" in named
        assert set(named) & {"input_lag", "input_delay"}
        assert set(named) <= {"cogging", "input_lag", "input_delay", "presliding"}
        cogging = next(e for e in found.axes[axis].effects if e.name == "cogging")
        assert cogging.effect.options.pitch_m == pytest.approx(0.05, rel=0.01)


@pytest.mark.parametrize("rate_hz", [100.0, 150.0, 2048.0, 5000.0])
@pytest.mark.parametrize("period_s", [0.9, 3.0, 4.0])
def test_the_period_of_one_repeated_move_is_found_at_any_rate(rate_hz, period_s):
    time_s = np.arange(0.0, 60.0, 1.0 / rate_hz)
    phase = time_s / period_s % 1.0
    there = np.where(phase < 0.2, np.sin(np.pi * phase / 0.2) ** 2, 0.0)
    back = np.where((phase > 0.5) & (phase < 0.7), np.sin(np.pi * (phase - 0.5) / 0.2) ** 2, 0.0)
    assert period_of(there - back, 1.0 / rate_hz) == pytest.approx(period_s, rel=2e-3)


def test_moves_that_differ_are_not_one_repeated():
    case = clean_case(23)
    time_s = np.arange(0.0, 24.0, 0.001)
    program = case.config["programs"][f"motion_{case.axis}"]
    stops = np.array([program["start_m"], *(move["target_m"] for move in program["moves"])])
    velocity = np.interp(time_s, np.linspace(0.0, 24.0, len(stops) - 1), np.diff(stops))
    assert period_of(velocity, 0.001) == 0.0


@pytest.mark.slow
def test_a_coupled_axis_is_judged_on_another_recording_too(tmp_path):
    case = draw_case(14, effects=("cross_axis",))
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    recording = recorded(case, first)
    models = declared_models(recording, None, case.axis)
    other = recorded(on_other_motion(case, 15), second)
    found = diagnose_recording(recording, models, None, other).axes[case.axis]
    assert names(found) == ["cross_axis"]
    assert found.error.held_out_after_rms < 0.2 * found.error.held_out_before_rms


@pytest.mark.slow
def test_a_long_recording_full_of_gaps_is_diagnosed(tmp_path):
    recording = recorded(draw_case(17, effects=("force_ripple",)), tmp_path, duration_s=24.0)
    data = measured(recording, next(iter(recording.axes)))
    usable = data.usable & (np.arange(len(data.usable)) % 12_500 > 100)
    signals = make_signals(replace(data, usable=usable))
    pieces = shortened(signals, 6.0)
    assert 0.15 * signals.rows < pieces.rows < 0.5 * signals.rows
