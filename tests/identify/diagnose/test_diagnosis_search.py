"""Four verdicts on simulated machines: complete, effect, unknown structure, poor motion."""

import pytest
import yaml
from diagnosis_cases import diagnosed, moving, names, recorded

from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.diagnose.report.parameter_text import whole_model_values
from motorctl.identify.fit.declared_models import declared_models
from motorctl.motion import load_program_file
from motorctl_benchmarks.diagnosis.cases import clean_case, draw_case
from motorctl_benchmarks.diagnosis.draw import Draw
from motorctl_benchmarks.diagnosis.plants import draw_axis


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    case = clean_case(3)
    return case, diagnosed(case, tmp_path_factory.mktemp("clean"))


@pytest.mark.slow
def test_a_clean_log_is_complete(clean):
    found = clean[1]
    assert found.verdict == "complete"
    assert names(found) == []
    assert found.unknown is None
    assert found.error.held_out_after_rms < 1.3 * found.error.noise_floor_rms
    assert "complete" in found.sentence


@pytest.mark.slow
def test_the_declared_parameters_are_those_of_the_machine(clean):
    case, found = clean
    plant = draw_axis(Draw(case.seed, "plant", case.axis))
    values = whole_model_values(found)
    truth = {"inertia": plant.inertia, "viscous_friction": plant.viscous}
    for name, value in truth.items():
        told = values[name]
        assert abs(told.value - value) < 5.0 * told.std_error + 2e-3 * value
        assert told.std_error < 0.05 * value


@pytest.fixture(scope="module")
def cogging(tmp_path_factory):
    case = draw_case(4, effects=("cogging",))
    return case, diagnosed(case, tmp_path_factory.mktemp("cogging"))


def test_an_effect_is_named_with_its_parameters(cogging):
    case, found = cogging
    assert found.verdict == "effect"
    assert names(found) == ["cogging"]
    effect = found.effects[0]
    pitch = effect.effect.options.pitch_m
    ratio = case.truth["cogging"]["pitch_m"] / pitch
    assert ratio == pytest.approx(round(ratio), abs=0.01 * round(ratio))
    assert effect.option_errors["pitch_m"] < 0.01 * pitch
    assert effect.confidence > 0.9
    assert effect.explained_fraction > 0.95
    assert effect.evidence


@pytest.mark.slow
def test_on_another_recording_only_the_errors_are_those_of_that_one(cogging, tmp_path):
    case, alone = cogging
    recording = recorded(case, tmp_path)
    (tmp_path / "other").mkdir()
    other = recorded(case, tmp_path / "other", duration_s=4.0)
    models = declared_models(recording, None, case.axis)
    found = diagnose_recording(recording, models, evaluate_on=other).axes[case.axis]
    assert found.error.held_out_before_rms != alone.error.held_out_before_rms
    effect, same = found.effects[0], alone.effects[0]
    assert effect.explained_fraction == same.explained_fraction
    assert effect.evidence == same.evidence
    assert any("up to 100 Hz" in note for note in found.notes)


def test_an_effect_takes_the_held_out_error_down_to_the_noise(cogging):
    error = cogging[1].error
    assert error.held_out_after_rms < 1.5 * error.noise_floor_rms
    assert error.held_out_before_rms > 10.0 * error.held_out_after_rms
    assert error.simulated_position_after_rms < 0.3 * error.simulated_position_before_rms


def test_the_traces_fit_together(cogging):
    traces = cogging[1].traces
    m = len(traces.time_s)
    for values in (traces.command, traces.residual_before, traces.residual_after):
        assert values.shape == (m,)
    contribution = traces.contributions["cogging"]
    assert contribution.std() == pytest.approx(traces.residual_before.std(), rel=0.5)
    assert traces.residual_after.std() < 0.3 * traces.residual_before.std()


@pytest.mark.slow
def test_a_bend_that_what_was_missing_hid_is_the_declared_one_and_no_other_effect(tmp_path):
    case = draw_case(1_350_000, effects=("cross_axis",), motion="repeated")
    found = diagnosed(case, tmp_path)
    assert names(found) == ["cross_axis"]
    assert found.dropped == {}
    plant = draw_axis(Draw(case.seed, "plant", case.axis))
    inertia = whole_model_values(found)["inertia"]
    assert inertia.value == pytest.approx(plant.inertia, rel=5e-3)


@pytest.mark.slow
def test_too_poor_a_motion_is_told_with_a_program_that_loads(tmp_path):
    one_way = [(0.1 + 0.05 * k, 0.03, 0.2, 0.0) for k in range(1, 17)]
    found = diagnosed(moving(clean_case(27), 0.1, one_way), tmp_path)
    assert found.verdict == "insufficient_data"
    assert names(found) == []
    missing = next(m for m in found.missing if m.program)
    assert "asymmetric_friction" in missing.effects
    path = tmp_path / "motion.yaml"
    path.write_text(yaml.safe_dump(dict(missing.program)))
    program = load_program_file(path, ("x", "y"))
    assert len(program.moves) >= 2
    assert missing.effects[0] in found.sentence


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "effects"),
    [
        (51, ("cogging", "input_delay")),
        pytest.param(52, ("payload_change", "periodic_disturbance"), marks=pytest.mark.long),
    ],
)
def test_two_effects_at_once_are_both_named(tmp_path, seed, effects):
    found = diagnosed(draw_case(seed, effects=effects), tmp_path, 12.0)
    assert found.verdict == "effect"
    assert set(effects) == set(names(found))
