"""The conformance suite of effects: those of motorctl pass it, and every check can fail."""

import subprocess
import sys
from pathlib import Path

import pytest
from changed_toys import OPTIONS, TOYS, changed
from effect_forms import EVERY, each, form
from hypothesis.errors import HypothesisException
from tiers import few_of

from motorctl.model import known_effects, make_effect
from motorctl.model.conformance import EffectConformance

FORMS = [*EVERY, form("residual_map", fine_velocity_m_s=0.01, top_velocity_m_s=1.0)]


@pytest.mark.parametrize("effect", each(FORMS))
class TestEffectsOfMotorctl(EffectConformance):
    @pytest.fixture
    def effect(self, request):
        return request.param


def test_every_effect_of_motorctl_is_among_those_that_are_checked():
    simple = {name for name, cls in known_effects().items() if not cls.Options.model_fields}
    without = set(known_effects()) - simple - {effect.name for effect in FORMS}
    assert not without, f"add a form and its formula in numpy to effect_forms.py: {without}"


BROKEN = {
    "test_it_is_not_refused_when_it_is_loaded": (
        "brake_zone", 'title = "Brake on a part of the travel"', 'title = ""',
    ),
    "test_its_texts_fit_into_a_line_of_a_report": (
        "brake_zone", "Brake on a part of the travel", "Brake on a part\\nof the travel",
    ),
    "test_its_name_fits_into_configurations_and_logs": (
        "brake_zone", 'name = "brake_zone"', 'name = "BrakeZone"',
    ),
    "test_bounds_are_finite_and_hold_the_start_value": (
        "brake_zone", "-1e3, 1e3, 0.0", "-1e3, float('inf'), 0.0",
    ),
    "test_options_survive_a_configuration": (
        "brake_zone", "class BrakeZoneOptions(EffectOptions):",
        'class BrakeZoneOptions(EffectOptions, extra="ignore"):',
    ),
    "test_the_column_is_finite_for_any_motion": (
        "brake_zone", "return v * min(", "return v / x * min(",
    ),
    "test_column_and_slope_are_finite_for_any_command": (
        "push_pull", "return abs(u)", "return abs(u) if abs(u) < 300.0 else 1e200 * u * 1e200",
    ),
    "test_kernels_raise_nothing_whatever_they_get": (
        "brake_zone", "return v * min(", "return v * (1 // int(x != c[0])) * min(",
    ),
    "test_the_slope_is_the_derivative_of_the_column": (
        "iron_knee", "return -2.0 * over", "return 2.0 * over",
    ),
    "test_no_command_adds_nothing": ("push_pull", "return abs(u)", "return abs(u) + 0.01"),
    "test_an_odd_effect_is_odd": (
        "weak_magnet", "return -u * _weak(x, c)", "return -u * _weak(x, c) + 0.1 * u * u",
    ),
    "test_every_parameter_has_a_column_of_its_own": (
        "iron_knee", "over = max(u - c[0], 0.0) if j == 0 else max(-u - c[0], 0.0)",
        "over = max(u - c[0], 0.0)",
    ),
    "test_the_correction_undoes_the_error": ("scale_joint", "x = y - c[2]", "x = y + c[2]"),
    "test_a_memory_at_rest_stays_as_it_is": (
        "cable_creep", "w[1] = 1.0", "w[1] += 1.0",
    ),
    "test_the_same_motion_leaves_the_same_memory": (
        "cable_creep", "w[1] = 1.0", "w[1] = np.random.random()",
    ),
    "test_the_memory_matters": (
        "cable_creep", "return float(w[0])", "return x",
    ),
    "test_columns_leave_the_memory_alone": (
        "slow_core", "    return float(w[0] - u)",
        "    w[0] += 1.0\n    return w[0] - u",
    ),
    "test_forms_to_try_are_forms_of_it_within_the_bounds_of_its_options": (
        "cable_creep", "np.geomspace(0.03, 1.0, 12)", "[0.1, 0.1]",
    ),
    "test_steps_lead_from_a_form_to_others": (
        "cable_creep", "0.2 * self.options.relaxation_s", "0.0",
    ),
    "test_a_richer_form_has_more_parameters": (
        "cable_creep", "    def steps(self",
        "    def richer(self, spans):\n        return [self]\n\n    def steps(self",
    ),
    "test_a_typical_form_is_one_of_it": (
        "cable_creep", "    def steps(self",
        "    @classmethod\n    def typical(cls, spans):\n        return None\n\n    def steps(self",
    ),
    "test_what_a_configuration_keeps_of_it_is_finite": (
        "push_pull", "    @property\n    def picture",
        "    def carry_over(self, theta, spans):\n        from motorctl.model import CarriedOver\n"
        "        return CarriedOver(scale=float('nan'))\n\n    @property\n    def picture",
    ),
    "test_a_wave_shows_at_the_line_that_it_was_made_for": (
        "push_pull", "    @property\n    def picture",
        '    groups = frozenset({"wave_over_time"})\n\n    @classmethod\n'
        "    def at_line(cls, line):\n        return cls()\n\n    @property\n    def picture",
    ),
    "test_a_smooth_function_says_that_it_is_one": (
        "push_pull", "    @property\n    def picture",
        "    @classmethod\n    def smooth_function(cls, names, spans):\n        return cls()\n\n"
        "    @property\n    def picture",
    ),
}  # fmt: skip
"""For each check a toy effect, and the change after which it does not pass any more."""
CHECKS = [name for name in dir(EffectConformance) if name.startswith("test_")]


def toy(name, folder, before="", after=""):
    """Make a toy effect, with one change to its source."""
    module, cls = changed(name, folder, before, after).split(":")
    return make_effect(getattr(sys.modules[module], cls), OPTIONS[name])


def fails(check, effect):
    """Run one check as pytest would, with every parameter that it has."""
    test = getattr(EffectConformance(), check)
    marks = [mark for mark in getattr(test, "pytestmark", []) if mark.name == "parametrize"]
    for values in marks[0].args[1] if marks else [None]:
        given = {} if values is None else {marks[0].args[0]: values}
        try:
            test(effect=effect, **given)
        except pytest.skip.Exception:
            pass
        except (Exception, HypothesisException):
            return True
    return False


@pytest.mark.slow
@pytest.mark.parametrize("name", OPTIONS)
def test_a_toy_effect_passes_every_check(name, tmp_path):
    effect = toy(name, tmp_path)
    assert [check for check in CHECKS if fails(check, effect)] == []


@pytest.mark.slow
@pytest.mark.parametrize("check", few_of(BROKEN, 10))
def test_a_broken_effect_fails_where_it_is_broken(check, tmp_path):
    effect = toy(BROKEN[check][0], tmp_path, *BROKEN[check][1:])
    assert fails(check, effect)


def test_there_is_a_broken_effect_for_every_check():
    assert set(BROKEN) == set(CHECKS)


SUITE = ("-p", "motorctl.model.conformance", "--pyargs", "motorctl.model.conformance")


def run_suite(*words, folder):
    """Run the suite as a third party does."""
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *SUITE, *words],
        cwd=folder, capture_output=True, text=True, timeout=250, check=False,
    )  # fmt: skip


@pytest.mark.slow
def test_an_effect_named_on_the_command_line_is_checked(tmp_path):
    path = f"pythonpath={TOYS / 'slow_core'}"
    target = "toy_slow_core:SlowCore"
    run = run_suite("--effect", target, "--effect-options", '{"rise_s": 0.1}', "-o", path,
                    folder=tmp_path)  # fmt: skip
    assert run.returncode == 0, run.stdout
    assert "passed" in run.stdout


@pytest.mark.slow
def test_the_example_of_an_own_effect_passes_as_the_guide_says(tmp_path):
    path = f"pythonpath={Path(__file__).parents[2] / 'docs'}"
    options = '{"peak_velocity_m_s": 0.5}'
    run = run_suite("--effect", "eddy_brake:EddyBrake", "--effect-options", options, "-o", path,
                    folder=tmp_path)  # fmt: skip
    assert run.returncode == 0, run.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "--effect NAME or package.module:Class"),
        (("--effect", "no_such_effect"), "unknown effect 'no_such_effect'"),
        (("--effect", "no.such:Effect"), "No module named 'no'"),
        (("--effect", "inertia", "--effect-options", "{"), "no JSON"),
        (("--effect", "inertia", "--effect-options", '{"mass": 1}'), "mass"),
    ],
)
def test_a_wrong_command_line_is_refused_once(words, told, tmp_path):
    run = run_suite(*words, folder=tmp_path)
    assert run.returncode == 4
    assert (run.stdout + run.stderr).count(told) == 1
