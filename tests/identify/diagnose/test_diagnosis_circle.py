"""A search in which findings give way to each other ends."""

from dataclasses import replace

from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.search import search as searching
from motorctl.identify.diagnose.search.mending import Mended
from motorctl.model import effect_class, make_effect
from motorctl.model.sign_function import sign_of

EITHER = make_effect(effect_class("quadratic_drag"))
OR = make_effect(effect_class("cogging"), {"pitch_m": 0.03, "orders": [1]})


def names(hypothesis):
    return [effect.name for effect in hypothesis.added]


def test_findings_that_give_way_to_each_other_in_a_circle_end_the_search_with_the_better(
    monkeypatch,
):
    signals = make_signals(OtherPlant(cogging=0.02, pitch_m=0.03).run(1, 6.0), slope_s_m=900.0)
    turns = []

    def mended(hypothesis, *_):
        turns.append(1)
        other = OR if names(hypothesis) == [EITHER.name] else EITHER
        whole = replace(hypothesis, added=(other,)).refreshed()
        return Mended(whole, whole)

    monkeypatch.setattr(searching, "mended", mended)
    monkeypatch.setattr(searching, "without_unneeded", lambda hypothesis, _: hypothesis)
    found = searching.search(signals, C1, sign_of(C1.effects), side="command")
    assert len(turns) < 5
    assert names(found.final) == [OR.name]
