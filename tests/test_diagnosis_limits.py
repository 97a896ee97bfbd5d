"""Where a recording shows little: what can still be told, and that no more is."""

import pytest
from diagnosis_cases import diagnosed, moving, names

from motorctl.bench.diagnosis.cases import clean_case, draw_case
from motorctl.bench.diagnosis.unknown_effects import UNKNOWN
from motorctl.config import load
from motorctl.insight.diagnosis.pipeline import diagnose_recording
from motorctl.insight.fit_models import declared_models
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate

SMOOTH = [(0.9, 0.15, 0.3, 0.0), (0.1, 0.15, 0.3, 0.0)] * 6
"""Share of the travel, speed [m/s], acceleration [m/s^2], dwell [s]: above 40 Hz it is noise."""
THERE_AND_BACK = [(0.9, 0.04, 0.5, 0.0), (0.5, 0.04, 0.5, 0.0)]


@pytest.mark.parametrize("seed", [23, *(pytest.param(s, marks=pytest.mark.slow) for s in (24, 28))])
def test_on_smooth_motion_the_feedback_of_noise_is_no_effect(tmp_path, seed):
    found = diagnosed(moving(clean_case(seed), 0.1, SMOOTH), tmp_path)
    assert found.verdict == "complete"
    assert names(found) == []


@pytest.mark.parametrize(
    ("effect", "seed"),
    [("input_delay", 23), pytest.param("input_lag", 23, marks=pytest.mark.slow)],
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


def test_a_move_there_and_back_is_answered_with_the_motion_that_would_tell(tmp_path):
    case = moving(draw_case(21, effects=("cogging",)), 0.5, THERE_AND_BACK)
    found = diagnosed(case, tmp_path)
    assert found.verdict == "insufficient_data"
    assert names(found) == []
    assert "speeds up or slows down 3 times alone" in found.sentence
    assert found.missing[0].program is not None


@pytest.mark.slow
@pytest.mark.parametrize("effect", UNKNOWN)
def test_an_effect_outside_the_list_is_called_unknown(tmp_path, effect):
    found = diagnosed(draw_case(1001, effects=(effect,)), tmp_path, duration_s=24.0)
    assert found.verdict == "unknown_structure"


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
