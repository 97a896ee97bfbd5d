"""What comes to an end of what was sought has not been found: refuted, or told as "at least"."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.option_ranges import (
    at_bound,
    ends_reached,
    option_bounds,
)
from motorctl.identify.diagnose.search.refutation import without_refuted
from motorctl.identify.diagnose.search.search import Found, rival_gains, whitened
from motorctl.identify.diagnose.verdict.errors import split_rows
from motorctl.identify.diagnose.verdict.standing import standing
from motorctl.model import effect_class, known_effects, make_effect

pytestmark = pytest.mark.slow

PLANT = OtherPlant(shape="arctan", width_m_s=1.0 / 900.0)


@pytest.fixture(scope="module")
def signals():
    return make_signals(PLANT.run(seed=4, duration_s=8.0), slope_s_m=900.0)


def outcome(signals, *added):
    regressors, noise = whitened(signals, C1, added)
    final = Hypothesis(regressors, added).refreshed()
    base = Hypothesis(regressors).refreshed()
    return Found(base, final, (), spans_of(signals), noise, rival_gains(final))


def refined(spans):
    """Yield each option that is refined, of a typical form, with its range."""
    for cls in known_effects().values():
        form = cls.typical(spans)
        if form is None:
            continue
        names = list(form.steps(spans))
        for name, ends in zip(names, option_bounds(form, names, spans), strict=True):
            yield form, name, ends


def test_every_size_at_the_upper_end_is_refuted_unless_its_effect_comes_there_by_nature(signals):
    spans = spans_of(signals)
    legal, refuted = set(), set()
    for form, name, (_, high) in refined(spans):
        if not np.isfinite(high):
            continue
        ended = form.with_options(**{name: 0.999 * high})
        ends = ends_reached(ended, spans)
        (refuted if any(end.refutes for end in ends) else legal).add((form.name, name))
    assert legal == {
        ("backlash", "contact_damping"),
        ("backlash", "contact_hz"),
        ("backlash", "glide_m_s2"),
        ("backlash", "slows_1_s"),
        ("gain_drift", "time_constant_s"),
        ("stribeck", "exponent"),
        ("voltage_clipping", "no_load_m_s"),
        ("warming_friction", "time_constant_s"),
    }
    assert {("input_lag", "time_s"), ("input_delay", "time_s")} < refuted
    assert {("dead_zone", "half_width_v"), ("cogging", "pitch_m")} < refuted
    assert ("flexible_mode", "friction_m_s2") in refuted  # a part that only sticks is none


def test_friction_that_is_not_there_comes_to_no_end(signals):
    free = make_effect(effect_class("flexible_mode"), {"frequency_hz": 20.0})
    assert ends_reached(free, spans_of(signals)) == []


def test_a_wave_too_long_for_the_travel_is_refuted_once_all_stands(signals):
    spans = spans_of(signals)
    wave = make_effect(effect_class("cogging"), {"pitch_m": 0.4 * spans.travel_m})
    assert not at_bound(wave, spans)
    kept, why = without_refuted(outcome(signals, wave))
    assert not kept.final.added
    assert why[0].startswith("cogging is refuted: its pitch_m comes to")


def test_a_model_is_not_complete_where_what_was_refuted_took_much_of_what_is_left():
    data = PLANT.run(seed=4, duration_s=8.0)
    noise_m = np.random.default_rng(4).normal(0.0, 6e-6, len(data.position))
    noisy = make_signals(replace(data, position=data.position + noise_m), slope_s_m=900.0)
    whole = outcome(noisy)
    split = split_rows(whole.final, {})
    assert standing(whole, split).judged.verdict == "complete"
    wave = make_effect(effect_class("cogging"), {"pitch_m": 0.4 * spans_of(noisy).travel_m})
    kept, _ = without_refuted(outcome(noisy, wave))
    assert kept.refuted_left == pytest.approx(1.0, abs=0.1)
    assert standing(kept, split).judged.verdict == "complete"
    much = replace(whole, refuted_left=0.5)
    assert standing(much, split).judged.verdict == "unknown_structure"


def test_a_stop_that_begins_far_from_the_end_is_refuted_wherever_zero_is(signals):
    spans = spans_of(signals)
    for away in (0.0, -10.0, 10.0):
        low, high = (place + away for place in spans.position_m)
        moved = replace(spans, position_m=(low, high))
        stop = make_effect(effect_class("hard_stop"), {"begin_m": high - 0.15 * moved.travel_m})
        assert not at_bound(stop, moved)
        assert at_bound(stop.with_options(begin_m=high - 0.299 * moved.travel_m), moved)
        below = stop.with_options(side="lower", begin_m=low + 0.15 * moved.travel_m)
        assert not at_bound(below, moved)
        assert at_bound(below.with_options(begin_m=low + 0.299 * moved.travel_m), moved)


def test_a_time_constant_beyond_the_recording_is_told_as_at_least(signals):
    spans = spans_of(signals)
    drift = effect_class("gain_drift").trials(spans)[0]
    high = option_bounds(drift, ["time_constant_s"], spans)[0][1]
    (reached,) = ends_reached(drift.with_options(time_constant_s=high), spans)
    assert not reached.refutes
    assert reached.told(signals.data) == f"its time_constant_s is at least {high:.3g} s"


LATE_S = 0.02
"""More than is tried at 5 kHz at first: 5 ms, refined to 7.5 ms at most."""


def late(data):
    """Return the recording of a machine with a slow link."""
    return replace(data, command=np.roll(data.command, -round(LATE_S * data.sample_rate_hz)))


def lagging(data):
    """Return that of one with a slow filter: what was asked for is ahead of what acts."""
    asked = data.command + LATE_S * np.gradient(data.command, 1.0 / data.sample_rate_hz)
    return replace(data, command=asked)


@pytest.mark.parametrize(("name", "other", "machine"), [
    ("input_delay", "input_lag", late),
    ("input_lag", "input_delay", lagging),
])  # fmt: skip
def test_a_slow_link_is_told_from_a_slow_filter_though_the_first_trials_end_before(
    name, other, machine
):
    axis = diagnose_axis(machine(PLANT.run(seed=4, duration_s=10.0)), C1)
    named = {effect.name: effect for effect in axis.effects}
    assert named[name].effect.options.time_s == pytest.approx(LATE_S, rel=0.02)
    assert other not in named
