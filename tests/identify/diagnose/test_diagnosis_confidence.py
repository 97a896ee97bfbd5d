"""A name is given with the share of such names that are right, or not at all."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from hypothesis import given
from hypothesis import strategies as st
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.report.json_document import axis_document
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import Found, rival_gains, whitened
from motorctl.identify.diagnose.verdict import confidence as judging
from motorctl.identify.diagnose.verdict.confidence import confidence, weights, without_doubtful
from motorctl.identify.diagnose.verdict.errors import alternatives
from motorctl.identify.diagnose.verdict.evidence import Evidence, evidence_of, features
from motorctl.model import effect_class, make_effect

shares = st.floats(0.0, 1.0)
evidences = st.builds(
    Evidence,
    gain=st.floats(0.0, 1e4),
    rival_share=shares,
    stranger_share=shares,
    unexplained=shares,
    over_noise=st.floats(1.0, 1e3),
    reduction=st.floats(0.1, 1e3),
    unsteady=st.floats(0.0, 1e3),
)


def test_the_table_has_a_weight_for_every_figure_that_is_asked():
    figures = features(Evidence(1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0).document())
    for table in weights().values():
        assert set(table) == {"intercept", *figures}
        assert np.all(np.isfinite(list(table.values())))


@given(evidences, st.integers(0, 6), st.booleans())
def test_confidence_is_a_probability_and_shared_with_what_is_alike(evidence, alike, of_family):
    sure = confidence(evidence, alike, of_family)
    assert judging.LOWEST <= sure <= judging.HIGHEST
    assert confidence(evidence, alike + 1, of_family) <= sure


@given(evidences)
def test_a_rival_as_good_makes_a_name_no_surer(evidence):
    alone, beside = (replace(evidence, rival_share=share) for share in (1e-3, 0.95))
    assert confidence(beside) <= confidence(alone)


@pytest.fixture(scope="module")
def smooth():
    """A machine of another author's physics that lacks nothing."""
    return OtherPlant(shape="tanh", width_m_s=5e-3).run(seed=4, duration_s=10.0)


@pytest.fixture(scope="module")
def with_chance(smooth):
    """A search's outcome with an effect that is not there."""
    signals = make_signals(smooth, slope_s_m=900.0)
    added = (make_effect(effect_class("cogging"), {"pitch_m": 0.0123}),)
    regressors, noise = whitened(signals, C1, added)
    final, base = Hypothesis(regressors, added).refreshed(), Hypothesis(regressors).refreshed()
    return Found(base, final, (), spans_of(signals), noise, rival_gains(final))


def test_a_name_that_is_hardly_ever_right_is_not_given(with_chance, monkeypatch):
    monkeypatch.setattr(judging, "confidence", lambda *_: 0.32)
    kept, doubted = without_doubtful(with_chance)
    assert kept.final.added == ()
    assert list(doubted) == ["cogging"]
    monkeypatch.setattr(judging, "confidence", lambda *_: 0.34)
    assert without_doubtful(with_chance) == (with_chance, {})


@pytest.mark.slow
def test_cogging_beside_a_soft_friction_is_cogging_alone_and_told_where_it_is_doubted(monkeypatch):
    pulled = OtherPlant(shape="tanh", width_m_s=5e-3, cogging=0.05).run(seed=4, duration_s=8.0)
    sure = diagnose_axis(pulled, C1)
    assert [found.name for found in sure.effects] == ["cogging"]
    assert sure.effects[0].effect.options.pitch_m == pytest.approx(0.06, rel=1e-3)
    assert [term.name for term in sure.mended] == ["coulomb_friction"]
    assert sure.effects[0].grounds["unexplained"] < 0.05
    table = {what: dict.fromkeys(row, 0.0) | {"intercept": -2.0} for what, row in weights().items()}
    monkeypatch.setattr(judging, "weights", lambda: table)
    monkeypatch.setattr(judging, "PLAINLY", 0.0)
    unsure = diagnose_axis(pulled, C1)
    assert unsure.effects == ()
    assert unsure.verdict != "complete"
    document = json.loads(json.dumps(axis_document(unsure), allow_nan=False))
    assert set(document["doubted"]["cogging"]) == set(sure.effects[0].grounds)
    assert any(
        note.startswith("cogging lowers the error, but is not named") for note in unsure.notes
    )


def test_the_family_of_a_doubted_name_is_told_where_it_takes_most(with_chance):
    (effect,) = with_chance.final.added
    strong = Evidence(
        gain=9.0,
        rival_share=1.0,
        stranger_share=0.1,
        unexplained=0.02,
        over_noise=3.0,
        reduction=7.0,
        unsteady=1.0,
    )
    kin = judging.most_doubted((effect,), {effect.name: strong})
    assert (kin.family, kin.member) == ("force_of_position", "cogging")
    assert kin.share == pytest.approx(1.0 - 1.0 / 49.0)
    unsure = replace(strong, stranger_share=5.0, gain=1.0, unexplained=0.9)
    assert judging.most_doubted((effect,), {effect.name: unsure}).family is None
    assert judging.most_doubted((effect,), {effect.name: replace(strong, reduction=1.2)}) is None
    assert judging.most_doubted((effect,), {}) is None


CLEAR = Evidence(
    gain=100.0,
    rival_share=0.3,
    stranger_share=0.3,
    unexplained=0.0,
    over_noise=1.0,
    reduction=1.8,
    unsteady=0.01,
)


def test_what_is_left_over_and_a_faint_gain_make_a_name_less_sure():
    for doubt in (
        {"gain": 3.0},
        {"over_noise": 10.0},
        {"gain": 3.0, "unexplained": 0.5},
        {"unsteady": 1.0},
    ):
        assert confidence(replace(CLEAR, **doubt)) < confidence(CLEAR)


@pytest.mark.parametrize("of_family", [False, True])
def test_a_small_effect_on_which_parts_disagree_by_more_than_it_does_is_no_name(of_family):
    small = replace(CLEAR, reduction=1.49, unsteady=1.0)
    assert confidence(small, of_family=of_family) > judging.TOLD
    torn = replace(small, unsteady=1.01)
    assert confidence(torn, of_family=of_family) == judging.LOWEST
    assert confidence(replace(torn, reduction=2.7), of_family=of_family) > judging.TOLD


def test_a_plain_effect_is_named_however_far_above_the_noise_the_rest_is():
    far_above = Evidence(
        gain=24.0,
        rival_share=0.7,
        stranger_share=0.7,
        unexplained=0.05,
        over_noise=15.0,
        reduction=4.6,
        unsteady=0.1,
    )
    assert confidence(far_above) == judging.PLAINLY
    assert confidence(far_above, of_family=True) == judging.PLAINLY
    assert confidence(far_above, alike=1) == judging.PLAINLY / 2.0
    # What is wrong with a declared friction looks like another kind of it.
    assert confidence(replace(far_above, of_friction=True)) < judging.PLAINLY
    for doubt in (
        {"reduction": 2.2},
        {"rival_share": 0.8},
        {"unsteady": 0.3},
        {"unexplained": 0.3},
    ):
        assert confidence(replace(far_above, **doubt)) < judging.TOLD


def test_chance_gains_nothing(with_chance):
    chance = with_chance.final.added[0]
    evidence = evidence_of(with_chance, chance, alternatives(with_chance, chance.name))
    assert evidence.gain < 1.0
    assert confidence(evidence) < judging.TOLD
