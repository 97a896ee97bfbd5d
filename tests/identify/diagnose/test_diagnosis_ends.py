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
        ("backlash", "glide_m_s2"),
        ("gain_drift", "time_constant_s"),
        ("stribeck", "exponent"),
        ("voltage_clipping", "no_load_m_s"),
        ("warming_friction", "time_constant_s"),
    }
    assert {("input_lag", "time_s"), ("input_delay", "time_s")} < refuted
    assert {("dead_zone", "half_width_v"), ("cogging", "pitch_m")} < refuted


def test_a_wave_too_long_for_the_travel_is_refuted_once_all_stands(signals):
    spans = spans_of(signals)
    wave = make_effect(effect_class("cogging"), {"pitch_m": 0.4 * spans.travel_m})
    assert not at_bound(wave, spans)
    kept, why = without_refuted(outcome(signals, wave))
    assert not kept.final.added
    assert why[0].startswith("cogging is refuted: its pitch_m comes to")


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
"""More than a search tries at 5 kHz, 7.5 ms at most."""


@pytest.fixture(scope="module")
def late():
    """Return a recording whose command acts much later than any search tries."""
    data = PLANT.run(seed=4, duration_s=10.0)
    shift = round(LATE_S * data.sample_rate_hz)
    return replace(data, command=np.roll(data.command, -shift))


@pytest.mark.parametrize("name", ["input_lag", "input_delay"])
def test_a_command_later_than_what_is_sought_is_no_lag_of_the_longest_time(late, name):
    signals = make_signals(late, slope_s_m=900.0)
    spans = spans_of(signals)
    longest = option_bounds(effect_class(name).trials(spans)[0], ["time_s"], spans)[0][1]
    added = make_effect(effect_class(name), {"time_s": 0.995 * longest})
    kept, why = without_refuted(outcome(signals, added))
    assert not kept.final.added
    assert f"{name} is refuted: its time_s comes to 0.00746 s, the upper end" in why[0]


def test_a_diagnosis_does_not_name_what_comes_to_its_end_and_says_so(late):
    axis = diagnose_axis(late, C1)
    assert not {"input_lag", "input_delay"} & {effect.name for effect in axis.effects}
    assert any("upper end of what is sought (0.0075)" in note for note in axis.notes)
