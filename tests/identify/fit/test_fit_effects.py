"""The identification is written over any list of effects."""

import math
from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1, X_THETA, model_of, simulate
from ripple_effect import Ripple, RippleOptions

from motorctl.identify.fit.recording import fit_axis
from motorctl.identify.fit.settings import FitOptions
from motorctl.model import EffectList, effect_class, make_effect
from motorctl.model.sign_function import with_slope


def test_an_effect_of_ones_own_with_two_parameters_is_identified():
    pitch, sine, cosine = 0.05, 0.3, -0.2
    run = simulate(seed=4, theta=X_THETA[:4])
    angle = 2.0 * math.pi * run.position / pitch
    # what the drive adds against the ripple is part of the recorded command
    command = run.command + sine * np.sin(angle) + cosine * np.cos(angle)
    model = EffectList([*C1.effects, Ripple(RippleOptions(pitch_m=pitch))])
    fit = fit_axis(run.measured(command=command), model)
    assert fit.value("ripple_sin") == pytest.approx(sine, abs=2e-3)
    assert fit.value("ripple_cos") == pytest.approx(cosine, abs=2e-3)
    assert fit.value("inertia") == pytest.approx(X_THETA[0], rel=1e-3)


def test_the_pull_of_another_axis_is_identified():
    run = simulate(seed=4, theta=X_THETA[:4])
    w, reach, pull, drag = 9.0, 0.2, 0.04, -0.05
    t = run.time_s
    speed, acceleration = reach * w * np.cos(w * t), -reach * w**2 * np.sin(w * t)
    command = run.command + pull * acceleration + drag * speed
    beside = {"y": replace(run.measured(), axis="y", position=reach * np.sin(w * t))}
    coupled = make_effect(effect_class("cross_axis"), {"axes": ["y"]})
    fit = fit_axis(run.measured(command=command, others=beside), EffectList([*C1.effects, coupled]))
    assert fit.value("cross_axis_acceleration_y") == pytest.approx(pull, rel=0.01)
    assert fit.value("cross_axis_velocity_y") == pytest.approx(drag, rel=0.05)
    assert fit.value("inertia") == pytest.approx(X_THETA[0], rel=1e-3)


@pytest.mark.slow
def test_a_late_command_acts_at_the_place_where_the_axis_is_then():
    pitch, share, late = 0.03, 0.05, 10.0
    run = simulate(seed=4, theta=X_THETA[:4], delay_samples=late)
    k = np.arange(len(run.position))
    there = np.interp(k + late + 0.5, k, run.position)
    # what the amplifier has to give so that so much acts there
    command = run.command / (1.0 - share * np.sin(2.0 * math.pi * there / pitch))
    ripple = make_effect(effect_class("force_ripple"), {"pitch_m": pitch})
    fit = fit_axis(run.measured(command=command), EffectList([*C1.effects, ripple]))
    assert fit.value("force_ripple_sin_1") == pytest.approx(-share, rel=2e-3)
    assert abs(fit.value("force_ripple_cos_1")) < 1e-3 * share
    assert fit.delay_s * run.rate_hz == pytest.approx(late, abs=0.01)


@pytest.mark.slow
def test_the_order_of_the_list_changes_nothing_but_the_order():
    run = simulate(seed=4, duration_s=4.0)
    names = (
        "em_cubic",
        "offset",
        "coulomb_friction",
        "em_quadratic",
        "inertia",
        "viscous_friction",
    )
    mixed = fit_axis(run.measured(), model_of(*names))
    usual = fit_axis(run.measured(), model_of(*sorted(names)))
    for name in names:
        assert mixed.value(name) == pytest.approx(usual.value(name), rel=1e-6)
    assert mixed.delay_s == pytest.approx(usual.delay_s, abs=1e-9)


def test_a_list_without_inertia_is_fitted_with_the_command_on_the_left():
    run = simulate(seed=4, duration_s=4.0)
    fit = fit_axis(run.measured(), model_of("viscous_friction", "coulomb_friction", "offset"))
    assert any("no inertia" in note for note in fit.notes)


def test_an_input_map_that_folds_back_is_told():
    theta = (*X_THETA[:4], -0.09, 0.0)
    run = simulate(seed=1, theta=theta, peak_acceleration=25.0, limit=5.0)
    # beyond 1/(2*0.09) = 5.6 V the map turns back; the range is claimed to reach 8 V
    command = run.command.copy()
    command[:5] = 8.0
    fit = fit_axis(run.measured(command=command), model_of(*C1.names, "em_quadratic"))
    assert any("monotonic" in note for note in fit.notes)


def test_the_slope_is_replaced_only_where_an_effect_has_one():
    changed = [with_slope(effect, math.inf) for effect in C1.effects]
    slopes = {effect.name: effect.options.model_dump() for effect in changed}
    assert slopes["coulomb_friction"] == {"slope_s_m": math.inf, "sign_shape": "arctan"}
    assert slopes["inertia"] == {}
    assert all(with_slope(effect, None) is effect for effect in C1.effects)


def test_rows_at_rest_are_left_out_unless_asked_for():
    run = simulate(seed=4, duration_s=4.0)
    moving = fit_axis(run.measured(), C1)
    every = fit_axis(run.measured(), C1, FitOptions(rest_velocity=0.0))
    assert moving.options.rest_velocity == pytest.approx(5.0 / 900.0)
    assert len(every.residual) > 1.1 * len(moving.residual)
    velocity = np.interp(moving.columns.time_s, run.time_s, run.reference_velocity)
    assert np.abs(velocity).min() > 4e-3
