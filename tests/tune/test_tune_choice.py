"""Which gains are chosen: margins kept, error least, stable in every corner."""

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from linear_loop import GENTLE, MASS, TS, disturbance, followed, loop_of

from motorctl.axis_units import LINEAR, ROTARY
from motorctl.config.analysis import DelayedPlant, LoopGains, is_stable, loop_margins
from motorctl.control import command_filter
from motorctl.errors import RunError
from motorctl.tune.candidates import LoopShapes, MarginsWanted
from motorctl.tune.choice import choose_gains
from motorctl.tune.rows import footnotes
from motorctl.tune.trade_off import trade_off
from motorctl.tune.tuning import Tuning

pytestmark = pytest.mark.slow

WANTED = MarginsWanted(30.0, 2.0, 0.5)


def quiet(what, share):
    assert 0.0 <= share <= 1.0


@pytest.fixture(scope="module")
def shaken():
    return disturbance(np.random.default_rng(7))


@pytest.fixture(scope="module")
def chosen(shaken):
    return choose_gains(loop_of(GENTLE, shaken), WANTED, quiet)


@settings(max_examples=60, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(
    mass=st.floats(0.05, 1.0),
    viscous=st.floats(0.0, 1.0),
    delay=st.floats(0.0, 1e-3),
    lag=st.sampled_from([0.0, 0.4e-3]),
    k1=st.floats(10.0, 500.0),
    k2=st.floats(0.0, 200.0),
    crossover=st.floats(60.0, 1500.0),
)
def test_margins_of_a_shape_are_those_of_the_loop(mass, viscous, delay, lag, k1, k2, crossover):
    ks = mass * crossover
    shapes = LoopShapes(DelayedPlant((mass, viscous, 0.0), TS, delay, lag), [])
    shape = shapes.shape(k1, k2, np.array([ks]))
    told = loop_margins(
        mass,
        viscous,
        k1_1_s=k1,
        ks_v_s_m=ks,
        gamma_d=ks * k2,
        period_s=TS,
        delay_s=delay,
        lag_s=lag,
    )
    assert float(shape.phase_deg[0]) == pytest.approx(told.phase_margin_deg, abs=0.2)
    if told.gain_margin is not None:
        assert float(shape.gain[0]) == pytest.approx(told.gain_margin, rel=0.01)
    if told.gain_reduction is not None and told.gain_reduction > 0.01:
        assert float(shape.reduction[0]) == pytest.approx(1.0 / told.gain_reduction, rel=0.01)


def test_the_chosen_gains_keep_the_margins_that_were_asked_for(chosen):
    margins = chosen.margins
    assert margins.stable
    assert margins.phase_margin_deg >= 30.0
    assert margins.gain_margin >= 2.0
    assert margins.gain_reduction is None or margins.gain_reduction <= 0.5
    assert chosen.chosen.prediction.command_noise_v <= 0.5


@pytest.mark.slow
@pytest.mark.long
def test_no_gains_of_a_grid_that_keep_them_do_better_by_a_tenth(chosen, shaken):
    best = math.inf
    for k1 in np.geomspace(20.0, 600.0, 9):
        for k2 in np.geomspace(2.0, 600.0, 9):
            for ks in MASS * np.geomspace(50.0, 1500.0, 12):
                told = loop_margins(
                    MASS,
                    0.0,
                    k1_1_s=k1,
                    ks_v_s_m=ks,
                    gamma_d=ks * k2,
                    period_s=TS,
                    delay_s=2 * TS,
                )
                gains = LoopGains(k1, ks, ks * k2)
                corners = [DelayedPlant((m, 0.0, 0.0), TS, 2 * TS) for m in (0.2, 0.5)]
                if (
                    told.stable
                    and told.phase_margin_deg >= 30.0
                    and (told.gain_margin or 9.0) >= 2.0
                    and (told.gain_reduction or 0.0) <= 0.5
                    and all(is_stable(plant, gains) for plant in corners)
                ):
                    error, _ = followed(gains, shaken, periods=6)
                    best = min(best, float(np.abs(error[-2 * len(shaken) :]).max()))
    gains = chosen.chosen.gains
    error, _ = followed(gains, shaken, periods=20)
    assert np.abs(error[-2 * len(shaken) :]).max() <= 1.1 * best


@pytest.mark.slow
def test_the_loop_is_stable_at_every_corner_of_the_bounds(shaken):
    loop = loop_of(GENTLE, shaken, bounds=(0.05, 2.0))
    gains = choose_gains(loop, WANTED, quiet).chosen.gains
    assert all(is_stable(plant, gains) for plant in loop.plant.corners(TS))


def test_wide_bounds_are_told_as_what_holds_the_gains_down(shaken):
    choice = choose_gains(loop_of(GENTLE, shaken, bounds=(0.05, 2.0)), WANTED, quiet)
    assert "parameters at their bounds, inertia 0.05" in choice.bound_by


@pytest.mark.slow
def test_less_noise_for_the_amplifier_means_lower_gains(chosen, shaken):
    noise = 0.4 * chosen.chosen.prediction.command_noise_v
    calm = choose_gains(
        loop_of(GENTLE, shaken), dataclasses.replace(WANTED, command_noise_v=noise), quiet
    )
    assert calm.chosen.prediction.command_noise_v <= noise
    assert calm.chosen.prediction.eF_m > chosen.chosen.prediction.eF_m
    assert "the noise of the command" in calm.bound_by


def test_the_fast_adaptation_is_never_asked_for_more_than_its_bound(shaken):
    loop = loop_of(GENTLE, shaken, limit_v=0.1)
    assert choose_gains(loop, WANTED, quiet).chosen.prediction.d0_hat_v <= 0.1


@pytest.mark.parametrize(("units", "unit"), [(LINEAR, "V*s^2/m"), (ROTARY, "V*s^2/rad")])
def test_bounds_that_no_gains_bear_are_told_in_the_axis_own_units(shaken, units, unit):
    loop = loop_of(GENTLE, shaken, bounds=(1e-4, 1e4), delay_ticks=20)
    with pytest.raises(RunError, match=f"inertia 0.0001 to 10000 {re.escape(unit)};"):
        choose_gains(dataclasses.replace(loop, units=units), WANTED, quiet)


def test_what_a_filter_is_worth_is_told_in_the_axis_own_units(chosen, shaken):
    loop = dataclasses.replace(loop_of(GENTLE, shaken), units=ROTARY)
    plain = chosen.chosen
    notch = command_filter("notch", 300.0, 0.5, 0.1, TS)
    gains = dataclasses.replace(plain.gains, command_filter=notch)
    tuning = Tuning(
        loop, WANTED, chosen.margins, plain.prediction, dataclasses.replace(plain, gains=gains),
        chosen.margins, chosen.bound_by, trade_off(chosen.tried, WANTED, 1.0),
        without_filter=plain, filters_tried=3,
    )  # fmt: skip
    (told,) = [words for words in footnotes(tuning) if "without one" in words]
    assert told.endswith(" µrad")


def test_margins_that_no_gains_keep_are_refused_with_what_is_possible(shaken):
    loop = loop_of(GENTLE, shaken, delay_ticks=2)
    with pytest.raises(RunError, match=r"phase margin of 84 degrees.* the best phase margin is"):
        choose_gains(loop, MarginsWanted(84.0, 20.0, 1e-4), quiet)
