"""Which motion would settle what a diagnosis leaves open, and what none can."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from diagnosis_bench import axis_diagnosis

from motorctl.experiment.candidates import Candidate, candidates
from motorctl.experiment.open_questions import is_sure, open_questions
from motorctl.experiment.outlook import look_out, what_it_settles
from motorctl.experiment.predicted import predicted
from motorctl.experiment.session import MOST_S, Standing, next_experiment
from motorctl.identify.diagnose.report.motion_advice import Reach, Stroke
from motorctl.identify.diagnose.search.held_out_blocks import residual

REACHES = {"x": Reach(0.02, 0.38, 0.8, 8.0, 400.0)}
GENTLE = Candidate("gentle", "gentle", {"x": (Stroke(0.7, 0.4, 0.05), Stroke(0.3, 0.4, 0.05))})
HARD = Candidate("hard", "hard", {"x": (Stroke(0.7, 1.0, 1.0), Stroke(0.3, 1.0, 1.0))})


@cache
def ambiguous():
    """Return a machine with a wave of the thrust that is taken for one of the force."""
    axis = axis_diagnosis("cogging", duration_s=6.0)
    name = dataclasses.replace(
        axis.effects[0], confidence=0.5, indistinguishable_from=("force_ripple",)
    )
    return open_questions(dataclasses.replace(axis, effects=(name,), verdict="effect"))


def test_a_look_alike_and_what_was_not_seen_are_open_questions():
    kinds = {question.effects: question.kind for question in ambiguous().questions}
    assert kinds["cogging", "force_ripple"] == "which"
    assert kinds["stribeck",] == "whether"


def test_a_sure_diagnosis_leaves_no_name_open():
    axis = axis_diagnosis("cogging", duration_s=6.0)
    sure = dataclasses.replace(axis.effects[0], confidence=0.97, indistinguishable_from=())
    assert is_sure(dataclasses.replace(axis, effects=(sure,), missing=()))
    doubted = dataclasses.replace(sure, confidence=0.6)
    assert not is_sure(dataclasses.replace(axis, effects=(doubted,), missing=()))


@pytest.mark.parametrize(
    "name", ["cogging", "force_ripple", "input_delay", "input_lag", "position_dependent_friction"]
)
def test_a_hypothesis_explains_what_it_predicts_itself(name):
    axis = axis_diagnosis(name, duration_s=6.0)
    best = open_questions(dataclasses.replace(axis, verdict="effect")).best
    path = HARD.trajectories(REACHES)
    moved = best.on(predicted(best, path, "x", 10.0))
    rows = moved.regressors.signals.rows
    left = residual(moved.problem, best.solution.b)[:rows]
    whole = moved.problem.columns[:, -1].ravel()[:rows]
    assert rows > 100
    assert np.sqrt(np.mean(left**2)) < 0.005 * np.sqrt(np.mean(whole**2))


def test_hard_motion_shows_a_lag_that_gentle_motion_hides():
    axis = axis_diagnosis("input_lag", duration_s=6.0)
    name = dataclasses.replace(
        axis.effects[0], confidence=0.5, indistinguishable_from=("input_delay",)
    )
    known = open_questions(dataclasses.replace(axis, effects=(name,), verdict="effect"))
    look = look_out(known, REACHES, [GENTLE, HARD])
    place = [question.kind for question in known.questions].index("whether")
    assert "stands out" in known.questions[place].words
    told = {each.candidate.words: each.per_row[place] for each in look.prospects}
    assert told["hard"] > 2.0 * told["gentle"]


def test_the_best_motion_settles_most_in_a_second_and_says_what():
    look = look_out(ambiguous(), REACHES, [GENTLE, HARD])
    best = look.best
    assert best is not None
    assert best.rate == max(each.rate for each in look.prospects) > 0.0
    assert best.rate == pytest.approx(sum(best.shares) / best.duration_s)
    assert "or not" in what_it_settles(best, look.open.questions)


def test_what_was_run_in_vain_gives_way_to_the_next_best():
    look = look_out(ambiguous(), REACHES, [HARD, *candidates("x", REACHES)[:4]])
    now = Standing({"x": look}, ("x",))
    best = look.prospects[0].candidate
    first = next_experiment(now, REACHES, GENTLE)
    again = next_experiment(now, REACHES, GENTLE, [best] * 9)
    assert first is not None
    assert again is not None
    assert first.candidate.words.startswith(best.words)
    assert not again.candidate.words.startswith(best.words)


def test_motions_that_are_put_together_count_no_question_twice_and_stay_short():
    look = look_out(ambiguous(), REACHES)
    chosen = next_experiment(Standing({"x": look}, ()), REACHES, GENTLE)
    assert chosen is not None
    pieces = chosen.candidate.words.split("; ")
    assert len(pieces) == len(set(pieces))
    assert chosen.duration_s < MOST_S + 1.0
    assert chosen.settles[0].startswith("x: ")


def test_nothing_is_run_where_every_name_is_settled_and_no_motion_helps():
    look = look_out(ambiguous(), REACHES, [GENTLE])
    idle = [dataclasses.replace(p, shares=tuple(0.0 for _ in p.shares)) for p in look.prospects]
    settled = dataclasses.replace(look, prospects=tuple(idle))
    assert next_experiment(Standing({"x": settled}, ()), REACHES, GENTLE) is None
    doubtful = next_experiment(Standing({"x": settled}, ("x",)), REACHES, GENTLE)
    assert doubtful is not None
    assert doubtful.candidate is GENTLE


def test_what_no_motion_can_tell_apart_is_said_to_be_inseparable_with_the_numbers():
    known = ambiguous()
    hopeless = [
        dataclasses.replace(question, needed_per_row=1e9) if question.kind == "which" else question
        for question in known.questions
    ]
    look = look_out(dataclasses.replace(known, questions=tuple(hopeless)), REACHES, [HARD])
    (lost,) = look.inseparable
    assert "cogging and force_ripple: inseparable within this envelope" in lost.words
    assert "1e+09 is needed" in lost.words
    assert "hard" in lost.words
    place = [question.effects for question in known.questions].index(("cogging", "force_ripple"))
    assert look.prospects[0].shares[place] == 0.0


def test_nothing_is_called_inseparable_while_a_kind_of_motion_could_not_be_weighed():
    known = ambiguous()
    hard = [
        dataclasses.replace(question, needed_per_row=1e9) if question.kind == "which" else question
        for question in known.questions
    ]
    both = {**REACHES, "y": REACHES["x"]}
    stands = Candidate("stands", "y alone moves", {"y": (Stroke(0.7),)})
    look = look_out(dataclasses.replace(known, questions=tuple(hard)), both, [HARD, stands])
    assert {each.candidate.kind: each.weighed for each in look.prospects} == {
        "hard": True,
        "stands": False,
    }
    assert look.inseparable == ()


def test_a_delay_too_short_for_the_band_is_inseparable_from_a_lag_whatever_the_motion():
    axis = axis_diagnosis("input_delay", duration_s=6.0)
    delay = axis.effects[0]
    short = dataclasses.replace(
        delay,
        effect=delay.effect.with_options(time_s=1e-4),
        confidence=0.5,
        indistinguishable_from=("input_lag",),
    )
    known = open_questions(dataclasses.replace(axis, effects=(short,), verdict="effect"))
    look = look_out(known, REACHES, [HARD])
    assert any("0.1 ms" in each.why and "are needed" in each.why for each in look.inseparable)
    with pytest.raises(StopIteration):
        next(words for words in look.lost if "or not" in words)
