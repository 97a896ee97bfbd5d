"""Every effect says what it is; options that mean nothing are refused in words."""

import math

import numpy as np
import pytest
from effect_forms import EVERY, form
from pydantic import ValidationError
from tiers import few_of

from motorctl.errors import UsageError
from motorctl.model import EffectList, effect_class, known_effects


def test_every_effect_has_its_formula_written_once_more_by_another_hand():
    # the map is a spline for what has no name: it is no cause that could be named
    without = set(known_effects()) - {"residual_map"} - {effect.name for effect in EVERY}
    assert not without, f"add a form and its formula in numpy to effect_forms.py: {without}"


@pytest.mark.parametrize("name", sorted(known_effects()))
def test_an_effect_describes_itself_in_whole_phrases(name):
    effect = effect_class(name)
    for part in ("title", "formula", "compensated", "identified", "visible_in"):
        text = getattr(effect, part)
        assert text == text.strip()
        assert len(text) >= 5
    assert len(effect.visible_in.split()) >= 4
    assert effect.title[0].isupper()


@pytest.mark.parametrize("name", sorted(known_effects()))
def test_every_option_of_an_effect_is_described(name):
    for option, field in effect_class(name).Options.model_fields.items():
        assert field.description, option


@pytest.mark.parametrize("effect", EVERY, ids=lambda effect: effect.name)
def test_parameters_have_names_of_their_own_and_sensible_defaults(effect):
    names = [p.name for p in effect.parameters]
    assert len(set(names)) == len(names)
    assert all(names) or len(names) == 1
    assert len({p.symbol for p in effect.parameters}) == len(names)
    for parameter in effect.parameters:
        assert parameter.lower <= parameter.initial <= parameter.upper
        assert parameter.lower < parameter.upper
        assert 0.0 < parameter.covariance < math.inf
        assert parameter.unit


@pytest.mark.slow
@pytest.mark.parametrize("effect", few_of(EVERY, 12), ids=lambda effect: effect.name)
def test_an_effect_that_is_added_changes_nothing_until_its_parameters_do(effect):
    start = np.array([p.initial for p in effect.parameters])
    if effect.name in ("inertia", "viscous_friction", "coulomb_friction"):
        assert (start > 0.0).all()
        return
    kernels = EffectList([effect]).kernels
    assert kernels.input_map(1.7, 0.1, 0.2, 2.0, np.zeros(effect.memory_size), start) == 1.7
    motion = (0.1, 0.2, 3.0, 0.2, 2.0)
    context, others = np.zeros(effect.memory_size), np.ones((len(effect.other_axes), 3))
    kernels.advance_context(*motion[:3], 2e-4, others, context)
    assert kernels.feedforward(*motion, context, start) == 0.0


@pytest.mark.parametrize("effect", EVERY, ids=lambda effect: effect.name)
def test_a_form_survives_being_written_and_read(effect):
    written = effect.options.model_dump(mode="json")
    again = form(effect.name, **written)
    assert again.options == effect.options
    assert again.constants == effect.constants
    assert again.parameters == effect.parameters


def test_lag_and_delay_tell_their_times():
    effects = EffectList([form("input_lag", time_s=4e-4), form("input_delay", time_s=3e-4)])
    assert (effects.lag_s, effects.delay_s) == (4e-4, 3e-4)
    assert len(effects) == 0


def test_orders_name_their_parameters():
    assert [p.name for p in form("cogging", pitch_m=0.05, orders=(1, 6)).parameters] == [
        "sin_1", "cos_1", "sin_6", "cos_6",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("cogging", {}, "pitch_m"),
        ("cogging", {"pitch_m": 0.0}, "pitch_m"),
        ("cogging", {"pitch_m": math.inf}, "finite"),
        ("cogging", {"pitch_m": 0.05, "orders": ()}, "orders"),
        ("cogging", {"pitch_m": 0.05, "orders": (2, 1)}, "ascending"),
        ("cogging", {"pitch_m": 0.05, "orders": (1, 1)}, "different"),
        ("force_ripple", {"pitch_m": 0.05, "orders": (0,)}, "each 1 to 24"),
        ("force_ripple", {"pitch_m": 0.05, "orders": (25,)}, "each 1 to 24"),
        ("stribeck", {"velocity_m_s": -0.01}, "velocity_m_s"),
        ("stribeck", {"velocity_m_s": 0.01, "exponent": 0.0}, "exponent"),
        ("stribeck", {"velocity_m_s": 0.01, "slope_s_m": 0.0}, "slope_s_m"),
        ("presliding", {"displacement_m": 0.0}, "displacement_m"),
        ("position_force", {"degree": 2}, "degree"),
        ("position_dependent_friction", {"degree": 3}, "degree"),
        ("position_force", {"knots": (0.2, -0.2, 8)}, "must lie below the second"),
        ("position_force", {"knots": (-0.2, 0.2, 3)}, "3 functions; must be 4 to 48"),
        ("input_lag", {"time_s": 0.0}, "time_s"),
        ("input_delay", {}, "time_s"),
        ("dead_zone", {"half_width_v": -1.0}, "half_width_v"),
        ("gain_drift", {"time_constant_s": 0.0}, "time_constant_s"),
        ("cross_axis", {"axes": ()}, "axes"),
        ("cross_axis", {"axes": ("y", "y")}, "different"),
        ("flexible_mode", {"frequency_hz": 50.0, "damping_ratio": 1.0}, "damping_ratio"),
        ("encoder_error", {"period_m": 0.0}, "period_m"),
        ("periodic_disturbance", {"frequency_hz": 0.0}, "frequency_hz"),
        ("quadratic_drag", {"velocity_m_s": 1.0}, "velocity_m_s"),
        ("backlash", {"gap_m": 0.0, "glide_m_s2": 1.0}, "gap_m"),
        ("backlash", {"gap_m": 1e-4}, "glide_m_s2"),
        ("backlash", {"gap_m": 1e-4, "glide_m_s2": -1.0}, "glide_m_s2"),
        ("drive_hysteresis", {"play_v": 0.0}, "play_v"),
        ("drive_hysteresis", {"play_v": 0.5, "plays": 4}, "plays"),
    ],
)
def test_options_that_mean_nothing_are_refused(name, options, said):
    with pytest.raises(ValidationError, match=said):
        form(name, **options)


@pytest.mark.parametrize("name", ["forgetful", "sometimes_forgetful"])
def test_an_effect_with_a_memory_needs_a_way_to_advance_it(name):
    class_name = "".join(word.title() for word in name.split("_"))
    with pytest.raises(UsageError, match="advance is missing: expected advance"):
        effect_class(name, f"forgetful_effects:{class_name}")
