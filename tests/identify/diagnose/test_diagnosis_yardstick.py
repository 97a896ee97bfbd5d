"""Errors are errors of the same quantity, and what physics or a simulation refutes is no answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search import search
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.refutation import at_its_end, without_refuted
from motorctl.identify.diagnose.search.search import Found, rival_gains, whitened
from motorctl.identify.diagnose.search.simulated_position import (
    judge_by_simulation,
    simulated_position,
)
from motorctl.model import effect_class, make_effect

SIDES = ("acceleration", "command")


@pytest.fixture(scope="module")
def signals():
    run = simulate(duration_s=8.0, theta=(0.2, 0.25, 0.14, 0.01, 0.0, 0.0), delay_samples=4.0)
    return make_signals(run.measured(), slope_s_m=900.0)


def hypothesis(signals, side, *added):
    blocks = make_blocks(signals.rows, signals.row_period_s)
    return Hypothesis(Regressors(signals, C1, blocks, side), added).refreshed()


def late(name, time_s):
    return make_effect(effect_class(name), {"time_s": time_s})


@pytest.mark.parametrize("side", SIDES)
@given(name=st.sampled_from(["input_lag", "input_delay"]), time_s=st.floats(1e-4, 0.05))
@settings(max_examples=10)
def test_no_lag_or_delay_changes_what_has_to_be_explained(signals, side, name, time_s):
    plain, delayed = hypothesis(signals, side), hypothesis(signals, side, late(name, time_s))
    assert np.array_equal(plain.problem.columns[:, -1], delayed.problem.columns[:, -1])


@pytest.mark.parametrize("side", SIDES)
def test_a_true_delay_is_found_from_either_side(signals, side):
    true_s = 4.0 / 5000.0

    def left(time_s):
        return hypothesis(signals, side, late("input_delay", time_s)).solution.sse

    tried = true_s * np.array([0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 3.0])
    assert tried[int(np.argmin([left(t) for t in tried]))] == pytest.approx(true_s)
    assert left(true_s) < 0.7 * hypothesis(signals, side).solution.sse


@pytest.mark.parametrize("side", SIDES)
def test_a_very_long_lag_explains_nothing_by_shrinking_the_command(signals, side):
    long = hypothesis(signals, side, late("input_lag", 0.5))
    assert long.solution.sse > 0.5 * hypothesis(signals, side).solution.sse


def outcome(signals, *added):
    regressors, noise = whitened(signals, C1, added)
    final = Hypothesis(regressors, added).refreshed()
    base = Hypothesis(regressors).refreshed()
    return Found(base, final, (), spans_of(signals), noise, rival_gains(final))


def test_an_effect_whose_motion_runs_away_from_the_recorded_one_is_refuted(signals):
    found = outcome(signals, late("input_lag", 6e-3))
    missed = map(simulated_position, (found.base, found.final))
    simulated = judge_by_simulation(found.final.regressors.signals, *missed)
    assert simulated.after_rms > simulated.before_rms
    kept, why = without_refuted(found)
    assert not kept.final.added
    assert why[0].startswith("input_lag is refuted: with it the position simulated over")


def every_third_second(time_s):
    return np.floor(time_s) % 3.0 == 2.0


def test_a_name_has_to_bring_the_simulated_motion_nearer_on_rows_held_out():
    plain = OtherPlant(shape="arctan", width_m_s=1.0 / 900.0, cogging=0.05)
    data = plain.run(seed=4, duration_s=9.0)
    hum = np.where(every_third_second(data.time_s), 0.0, np.sin(2.0 * np.pi * 9.0 * data.time_s))
    data = replace(data, command=data.command + 0.05 * hum)
    wave = make_effect(effect_class("periodic_disturbance"), {"frequency_hz": 9.0})
    cogging = make_effect(effect_class("cogging"), {"pitch_m": 0.06})
    found = outcome(make_signals(data, slope_s_m=900.0), cogging, wave)
    held_out = every_third_second(found.final.regressors.signals.time_s)
    assert without_refuted(found) == (found, ())
    kept, why = without_refuted(found, held_out)
    assert kept.final.added == (cogging,)
    assert "times as much as without it, over windows of all lengths; a name must not" in why[0]


def test_an_effect_that_is_there_is_not_refuted(signals):
    found = outcome(signals, late("input_delay", 4.0 / 5000.0))
    assert without_refuted(found) == (found, ())


@pytest.mark.slow
def test_the_simulated_position_is_that_of_the_second_recording():
    first = OtherPlant(cogging=0.05).run(seed=4, duration_s=6.0)
    stronger = OtherPlant(cogging=0.15).run(seed=4, duration_s=6.0)
    own = diagnose_axis(first, C1).error
    told = diagnose_axis(first, C1, test=stronger).error
    # a third of the cogging is compensated there, and two thirds are left
    assert told.simulated_position_before_rms > 2.0 * own.simulated_position_before_rms
    assert told.simulated_position_after_rms == pytest.approx(
        2.0 / 3.0 * told.simulated_position_before_rms, rel=0.2
    )


def twice_the_excess_is_lost():
    """Return a recording whose supply loses more than all there is above a limit, and its form."""
    plain = OtherPlant(shape="arctan", width_m_s=1.0 / 900.0).run(seed=4, duration_s=10.0)
    limit = 1.05 * float(np.abs(plain.command).max())
    # every other second, what pushes forward is recorded as what twice the excess would leave of it
    mirrored = (plain.command > 0.0) & (np.floor(plain.time_s) % 2.0 == 0.0)
    command = np.where(mirrored, 2.0 * limit - plain.command, plain.command)
    signals = make_signals(replace(plain, command=command), slope_s_m=900.0)
    form = make_effect(effect_class("voltage_clipping"), {"limit_v": limit, "no_load_m_s": 1e6})
    return signals, form


def test_a_supply_that_would_take_more_than_all_is_refuted():
    signals, form = twice_the_excess_is_lost()
    kept, why = without_refuted(outcome(signals, form))
    assert not kept.final.added
    assert "and no more than all of it, 1, can be lost" in why[0]
    assert float(why[0].partition("would be ")[2].split(",")[0]) == pytest.approx(2.0, abs=0.1)


@given(limit_v=st.floats(0.1, 10.0), part=st.floats(0.3, 3.0))
@settings(max_examples=20)
def test_a_supply_with_which_the_axis_could_not_run_as_fast_as_it_did_is_refuted(
    signals, limit_v, part
):
    spans = spans_of(signals)
    options = {"limit_v": limit_v, "no_load_m_s": part * spans.speed_m_s}
    supply = make_effect(effect_class("voltage_clipping"), options)
    refuted = at_its_end(hypothesis(signals, "command", supply), spans)
    assert (refuted is not None) == (options["no_load_m_s"] < spans.speed_m_s)
    if refuted is not None:
        assert "is the speed at which no command acts any more, and the axis runs" in refuted[1]


def test_a_number_that_its_effect_allows_above_one_is_no_part_of_a_whole(monkeypatch):
    module = effect_class("voltage_clipping").__module__
    monkeypatch.setattr(f"{module}.LARGEST_SHARE", 10.0)
    signals, form = twice_the_excess_is_lost()
    assert form.parameters[0].upper == 10.0
    assert not any("no more than all" in why for why in without_refuted(outcome(signals, form))[1])


def test_friction_that_is_lower_at_low_speed_is_refuted_as_stribeck():
    soft = make_signals(OtherPlant(width_m_s=2e-2).run(seed=4, duration_s=8.0), slope_s_m=900.0)
    less_at_low_speed = make_effect(effect_class("stribeck"), {"velocity_m_s": 1e-2})
    kept, why = without_refuted(outcome(soft, less_at_low_speed))
    assert not kept.final.added
    assert "is refuted: stribeck would be -" in why[0]
    assert "less than 0 makes no physical sense" in why[0]


def test_pieces_of_a_long_recording_tell_its_noise_and_what_smooth_functions_gain(monkeypatch):
    plant = OtherPlant(shape="arctan", width_m_s=1.0 / 900.0, cogging=0.05)
    signals = make_signals(plant.run(seed=6, duration_s=24.0), slope_s_m=900.0)

    def told():
        regressors, noise = whitened(signals, C1, ())
        base = Hypothesis(regressors).refreshed()
        return noise, rival_gains(base)["position"] / base.held_out

    whole_noise, whole_share = told()
    monkeypatch.setattr(search, "LONGEST_SEARCH_S", 8.0)
    noise, share = told()
    assert noise != whole_noise
    assert noise == pytest.approx(whole_noise, rel=0.3)
    assert whole_share > 0.5
    assert share == pytest.approx(whole_share, rel=0.1)
