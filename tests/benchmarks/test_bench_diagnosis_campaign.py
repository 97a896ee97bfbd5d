"""The blind campaign: its rules, its figures, what it runs, and the peers' part in it."""

from __future__ import annotations

import json
import math
from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from motorctl.config import load_resolved
from motorctl.errors import RunError, UsageError
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl_benchmarks.command import bench
from motorctl_benchmarks.diagnosis import run_case
from motorctl_benchmarks.diagnosis.answer import Answer, Named
from motorctl_benchmarks.diagnosis.campaign import CampaignOptions, run_campaign, tasks_of
from motorctl_benchmarks.diagnosis.cases import draw_case
from motorctl_benchmarks.diagnosis.closed_loop import ClosedLoop
from motorctl_benchmarks.diagnosis.figures import campaign_figures
from motorctl_benchmarks.diagnosis.findings import diagnosis_findings
from motorctl_benchmarks.diagnosis.groups import GROUPS, CaseKey, draw, keys, parse_key
from motorctl_benchmarks.diagnosis.known_effects import KNOWN
from motorctl_benchmarks.diagnosis.outcome_report import calibration_lines, mistakes
from motorctl_benchmarks.diagnosis.peer_columns import PeerProblem
from motorctl_benchmarks.diagnosis.peers import SELECTIONS, PeerAnswer, named_by
from motorctl_benchmarks.diagnosis.run_case import Outcome, Task, run_task
from motorctl_benchmarks.diagnosis.score import (
    calibration,
    called_unknown,
    exact_set,
    named_first,
    no_cause,
    no_wrong_name,
    right_or_honest,
)
from motorctl_benchmarks.diagnosis.speed import Cost, figures_of, long_case, peak_memory_gb
from motorctl_benchmarks.diagnosis.true_motion import true_error_rms_m
from motorctl_benchmarks.diagnosis.unknown_effects import UNKNOWN
from motorctl_benchmarks.measure import measure

COGGING = {"cogging": {"pitch_m": 0.03}}
APERIODIC = {"cogging": {"pitch_m": 0.03, "aperiodic": {}}}
CABLE = {"position_force": {"spring_v_m": 0.5, "cable": {}}}
LAG = {"input_lag": {"time_s": 0.6e-3}}
PAIR = COGGING | LAG
CLEAN: dict[str, dict[str, float]] = {}


def answer(verdict, *names, **changes):
    """Name effects, most important first; a|b is a, indistinguishable from b."""
    named = []
    for k, name in enumerate(names):
        first, *twins = name.split("|")
        named.append(Named(first, 0.9 - 0.1 * k, tuple(twins)))
    return Answer(verdict, tuple(named), **changes)


@pytest.mark.parametrize(
    ("rule", "truth", "given", "right"),
    [
        (named_first, COGGING, answer("effect", "cogging"), True),
        (named_first, COGGING, answer("effect", "cogging", "stribeck"), True),
        (named_first, COGGING, answer("effect", "stribeck", "cogging"), False),
        (named_first, COGGING, answer("effect", "position_force|cogging"), False),
        (named_first, COGGING, answer("unknown_structure", "cogging"), False),
        (named_first, CABLE, answer("unknown_structure", "position_force"), True),
        (named_first, COGGING, answer("insufficient_data", "cogging"), False),
        (named_first, COGGING, answer("complete"), False),
        (named_first, PAIR, answer("effect", "input_lag"), True),
        (exact_set, PAIR, answer("effect", "input_lag", "cogging"), True),
        (exact_set, PAIR, answer("effect", "input_lag"), False),
        (exact_set, PAIR, answer("effect", "input_lag", "cogging", "stribeck"), False),
        (exact_set, COGGING, answer("effect", "cogging", "position_force"), False),
        (exact_set, APERIODIC, answer("effect", "cogging", "position_force"), True),
        (exact_set, APERIODIC, answer("effect", "position_force"), False),
        (exact_set, CABLE, answer("unknown_structure", "position_force"), True),
        (exact_set, CABLE, answer("unknown_structure"), False),
        (no_cause, CLEAN, answer("complete"), True),
        (no_cause, CLEAN, answer("insufficient_data"), True),
        (no_cause, CLEAN, answer("insufficient_data", "cogging"), False),
        (no_cause, CLEAN, answer("unknown_structure"), False),
        (no_cause, CLEAN, answer("effect", "cogging"), False),
        (no_cause, CLEAN, answer("failed"), False),
        (called_unknown, {"backlash": {}}, answer("unknown_structure"), True),
        (called_unknown, {"backlash": {}}, answer("unknown_structure", "presliding"), True),
        (called_unknown, {"backlash": {}}, answer("effect", "presliding"), False),
        (right_or_honest, COGGING, answer("effect", "cogging"), True),
        (right_or_honest, COGGING, answer("insufficient_data"), True),
        (right_or_honest, COGGING, answer("insufficient_data", "cogging"), True),
        (right_or_honest, COGGING, answer("insufficient_data", "stribeck"), False),
        (right_or_honest, COGGING, answer("effect", "position_force|cogging"), True),
        (right_or_honest, COGGING, answer("effect", "cogging", "stribeck"), False),
        (right_or_honest, COGGING, answer("effect", "stribeck"), False),
        (right_or_honest, COGGING, answer("complete"), False),
        (right_or_honest, COGGING, answer("unknown_structure"), False),
        (right_or_honest, PAIR, answer("effect", "input_delay|input_lag"), False),
        (no_wrong_name, COGGING, answer("effect", "position_force|cogging"), True),
        (no_wrong_name, COGGING, answer("complete"), True),
        (no_wrong_name, COGGING, answer("effect", "cogging", "stribeck"), False),
        (no_wrong_name, COGGING, answer("failed"), False),
    ],
)
def test_an_answer_is_scored_by_what_it_says(rule, truth, given, right):
    assert rule(truth, given) is right


def test_confidence_is_compared_with_how_often_names_are_right():
    sure = [
        (COGGING, Answer("effect", (Named("cogging" if k < 9 else "stribeck", 0.92),)))
        for k in range(10)
    ]
    unsure = [
        (COGGING, Answer("effect", (Named("cogging" if k < 1 else "stribeck", 0.45),)))
        for k in range(10)
    ]
    nothing = [(CLEAN, Answer("complete"))] * 5
    bins, error = calibration([*sure, *unsure, *nothing])
    assert [(b.low, b.high, b.count, round(b.share_right, 9)) for b in bins] == [
        (0.0, 0.5, 10, 0.1),
        (0.9, 0.95, 10, 0.9),
    ]
    assert error == pytest.approx(0.5 * (0.92 - 0.9) + 0.5 * (0.45 - 0.1))
    assert calibration(nothing)[0] == ()


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), min_size=1, max_size=40))
def test_every_name_counts_once_and_the_error_is_no_more_than_one(given_names):
    cases = [
        (COGGING, Answer("effect", (Named("cogging" if right else "stribeck", sure),)))
        for sure, right in given_names
    ]
    bins, error = calibration(cases)
    assert sum(b.count for b in bins) == len(given_names)
    assert 0.0 <= error <= 1.0
    assert all(b.low <= b.mean_confidence <= b.high for b in bins)


def test_consecutive_seeds_go_through_every_effect():
    drawn = [draw(CaseKey("one", 50_000 + k)) for k in range(len(KNOWN))]
    assert {name for case in drawn for name in case.effects} == set(KNOWN)
    weak = [draw(CaseKey("weak", 60_000 + k)) for k in range(3)]
    assert all(case.strength == 0.2 for case in weak)
    unknown = [draw(CaseKey("unknown", 80_000 + k)) for k in range(len(UNKNOWN))]
    assert {name for case in unknown for name in case.effects} == set(UNKNOWN)
    several = [draw(CaseKey("several", 90_000 + k)) for k in range(4)]
    assert {len(case.effects) for case in several} == {2, 3}
    poor = [draw(CaseKey("poor", 100_000 + k)) for k in range(2 * len(KNOWN))]
    assert {case.motion for case in poor} == {"repeated", "synchronised"}
    assert {name for case in poor for name in case.effects} == set(KNOWN)
    assert draw(CaseKey("clean", 70_000)).effects == ()


@pytest.mark.parametrize("size", ["small", "full"])
def test_no_seed_is_drawn_in_two_groups(size):
    every = keys(size, None, 50_000)
    assert len({key.seed for key in every}) == len(every)
    assert min(key.seed for key in every) == 50_000
    if size == "full":
        counts = {name: sum(key.group == name for key in every) for name in GROUPS}
        assert counts["clean"] == 100
        assert min(counts["one"], counts["weak"], counts["poor"]) >= 5 * len(KNOWN)
        assert counts["unknown"] >= 5 * len(UNKNOWN)


def test_a_key_that_is_printed_can_be_read_again():
    for key in keys("small", 1, 50_000):
        assert parse_key(str(key)) == key


@pytest.mark.parametrize("text", ["one", "one:", "one:x", "two:5", ":5", "one:-5"])
def test_a_key_that_draws_nothing_is_refused(text):
    with pytest.raises(UsageError, match=r"GROUP:SEED.*one, weak, clean"):
        parse_key(text)


def test_the_first_cases_of_every_effect_close_the_loop_and_peers_get_a_part():
    tasks = tasks_of(CampaignOptions())
    driven = [task.key for task in tasks if task.close_loop]
    assert {name for key in driven for name in draw(key).effects} == set(KNOWN)
    assert all(key.group == "one" for key in driven)
    asked = {task.key.group for task in tasks if task.ask_peers}
    assert asked == {"one", "clean", "unknown", "several"}
    only = tasks_of(CampaignOptions(only=(CaseKey("clean", 5),)))
    assert [task.key for task in only] == [CaseKey("clean", 5)]


def outcome(group, seed, truth, given, **changes):
    told = " + ".join(truth) or "clean"
    return Outcome(CaseKey(group, seed), told, "x", truth, {}, given, 1.0, **changes)


def loop(refined_m, declared_m=4e-6):
    return ClosedLoop(5e-6, declared_m, refined_m, 1e-6, ("cogging",))


def figures(outcomes):
    return {figure.name: figure for figure in campaign_figures(outcomes)}


def test_every_group_has_its_share_and_its_target():
    good = answer("effect", "cogging", explained_fraction=0.99, seconds=2.0)
    bad = answer("effect", "stribeck", explained_fraction=0.5, seconds=4.0)
    found = figures(
        [outcome("one", k, COGGING, good) for k in range(39)]
        + [outcome("one", 39, COGGING, bad)]
        + [outcome("clean", k, CLEAN, answer("complete")) for k in range(3)]
        + [outcome("clean", 4, CLEAN, bad)]
    )
    assert found["one"].value == pytest.approx(97.5)
    assert found["one"].met is True
    assert found["one_no_wrong"].value == pytest.approx(97.5)
    assert found["one_explained_median"].value == pytest.approx(99.0)
    assert found["one_explained_median"].met is True
    assert found["one_explained_tenth"].met is True
    assert found["clean"].value == pytest.approx(75.0)
    assert found["clean"].met is False
    assert found["seconds_longest"].value == 4.0
    assert not any(name.startswith(("weak", "poor")) for name in found)


def test_peers_are_compared_on_the_cases_that_they_were_given():
    named = PeerAnswer((("cogging",),), 0.1)
    vague = PeerAnswer((("input_lag", "input_delay"), ("cogging",)), 0.1)
    silent = PeerAnswer((), 0.1)
    ours = answer("effect", "cogging")
    found = figures(
        [
            outcome("one", 1, COGGING, ours, peers={"PySINDy, physical library": named}),
            outcome("one", 2, COGGING, ours, peers={"PySINDy, physical library": vague}),
            outcome("one", 3, COGGING, answer("complete")),
            outcome("clean", 4, CLEAN, ours, peers={"SysIdentPy, generic library": silent}),
            outcome("several", 5, PAIR, ours, peers={"PySINDy, generic library": vague}),
        ]
    )
    first = found["one_pysindy_physical"]
    assert (first.value, first.peer_value) == (100.0, 50.0)
    clean = found["clean_sysidentpy_generic"]
    assert (clean.value, clean.peer_value) == (0.0, 100.0)
    assert found["several_pysindy_generic"].peer_value == 100.0
    assert "unknown_pysindy_physical" not in found


def test_a_refined_controller_is_held_against_the_oracle():
    flexible = {"flexible_mode": {}}
    found = figures(
        [
            outcome("one", 1, COGGING, answer("effect"), closed_loop=loop(1.2e-6)),
            outcome("one", 2, LAG, answer("effect"), closed_loop_failure="no configuration"),
            outcome("one", 3, flexible, answer("effect"), closed_loop=loop(2.2e-6)),
        ]
    )
    assert found["closed_loop_cogging"].value == pytest.approx(1.2)
    assert found["closed_loop_cogging"].met is True
    assert found["closed_loop_input_lag"].value == math.inf
    assert found["closed_loop_input_lag"].met is False
    assert found["closed_loop_flexible_mode"].target is None
    assert found["excess_flexible_mode"].value == pytest.approx(40.0)
    assert found["excess_flexible_mode"].met is True


def test_mistakes_tell_the_case_that_can_be_run_again():
    wrong = [
        outcome("one", 50_007, COGGING, answer("effect", "input_delay|input_lag")),
        outcome("one", 50_008, COGGING, answer("effect", "cogging"), closed_loop=loop(1.5e-6)),
        outcome("clean", 70_001, CLEAN, answer("failed", failure="RunError: tripped")),
    ]
    right = outcome("one", 50_009, COGGING, answer("effect", "cogging"), closed_loop=loop(1e-6))
    rows = mistakes([*wrong, right])
    assert [parse_key(row["case"]).seed for row in rows] == [50_007, 50_008, 70_001]
    assert rows[0]["answer"] == "input_delay|input_lag (0.90)"
    assert "refined 1.50, oracle 1.00" in rows[1]["answer"]
    assert rows[2]["answer"] == "failed: RunError: tripped"
    assert calibration_lines(wrong)


def test_a_case_that_trips_is_an_answer_that_is_wrong(monkeypatch):
    def trips(*_args, **_kwargs):
        raise RunError("axis x tripped at 3 s")

    monkeypatch.setattr(run_case, "record_case", trips)
    result = run_task(Task(CaseKey("one", 50_000), close_loop=True))
    assert result.answer.verdict == "failed"
    assert not result.right
    assert result.closed_loop_failure
    document = result.document()
    assert document["answer"]["failure"] == "RunError: axis x tripped at 3 s"
    json.dumps(document, allow_nan=False)


def sparse_problem(rng, rows=4000):
    """Return a regression whose truth is one effect of two columns, among others and noise."""
    columns = rng.standard_normal((8, rows))
    columns /= np.linalg.norm(columns, axis=1)[:, None]
    y = 40.0 * columns[2] - 30.0 * columns[3] + 0.2 * rng.standard_normal(rows)
    meanings = (("a",), ("b",), ("c",), ("c",), ("d", "e"), (), ("f",), ("g",))
    return PeerProblem(y, columns, meanings)


def test_what_takes_too_little_away_is_not_named():
    problem = sparse_problem(np.random.default_rng(1))
    assert named_by(problem, {2: 0.6, 3: 0.3, 0: 0.05, 5: 0.01}) == (("c",),)
    assert named_by(problem, {0: 0.5, 5: 0.4, 3: 0.01, 2: 0.01}) == (("c",),)
    assert named_by(problem, {}) == ()


def test_columns_of_one_effect_count_together():
    problem = sparse_problem(np.random.default_rng(3))
    y = problem.y + 35.0 * problem.columns[6]
    both = PeerProblem(y, problem.columns, problem.meanings)
    assert named_by(both, {6: 0.4, 2: 0.35, 3: 0.25}) == (("c",), ("f",))


@pytest.mark.parametrize("peer", ["PySINDy", "SysIdentPy"])
def test_a_peer_finds_the_effect_that_is_there(peer):
    module = {"PySINDy": "pysindy", "SysIdentPy": "sysidentpy"}[peer]
    if find_spec(module) is None:
        pytest.skip(f"{peer} is not installed")
    problem = sparse_problem(np.random.default_rng(2))
    selected = SELECTIONS[peer](problem)
    assert {2, 3} <= set(selected)
    assert named_by(problem, selected) == (("c",),)


@pytest.mark.long
@pytest.mark.slow
def test_the_true_error_is_without_what_the_encoder_adds(tmp_path):
    case = draw_case(21, effects=("encoder_error",))
    config = json.loads(json.dumps(case.config))
    channel = {"x": "0", "y": "1"}[case.axis]
    plant = config["drivers"]["gantry"]["plants"][channel]
    amplitude, long_m = 5e-6, 0.05  # so long that the loop follows it at any speed
    plant["encoder_error"] |= {"amplitude_m": amplitude, "period_m": long_m}

    def seen_error_m(machine):
        log = tmp_path / "run.parquet"
        simulate(machine, log, duration_s=2.0)
        axis = read_recording(log).axes[case.axis]
        late = slice(round(0.6 * machine.rate_hz), None)
        return float(np.sqrt(np.mean(axis.following_error[late] ** 2)))

    machine = load_resolved(config, hardware=True)
    del plant["encoder_error"]
    ideal = load_resolved(config, hardware=True)
    wrong, right = (true_error_rms_m(m, case.axis, 2.0) for m in (machine, ideal))
    seen_ideal, seen_wrong = seen_error_m(ideal), seen_error_m(machine)
    # Without an encoder's error, what is seen is the truth but for a count and its noise.
    assert seen_ideal == pytest.approx(right, abs=0.6 * 0.2e-6)
    # The loop follows the error: nothing of it is seen, and the carriage is wrong by all of it.
    assert seen_wrong == pytest.approx(seen_ideal, rel=0.3)
    unseen_m = np.sqrt(wrong**2 - right**2)
    assert unseen_m == pytest.approx(amplitude / np.sqrt(2.0), rel=0.3)


def test_a_long_motion_is_sound_and_lasts():
    case = long_case(50_000, 120.0)
    machine = load_resolved(case.config, hardware=True)
    assert machine.rate_hz == 5000.0
    for name in machine.followed_programs:
        for trajectory in machine.programs[name].trajectories().values():
            assert 120.0 <= trajectory.duration_s < 240.0


def test_figures_of_speed_have_their_targets():
    costs = {
        "short": Cost(6.0, 5.0, 0.4),
        "double": Cost(13.0, 12.0, 0.6),
        "long": Cost(70.0, 66.0, 1.5),
    }
    found = {figure.name: figure for figure in figures_of(costs)}
    assert found["seconds_one_axis"].met is True
    assert found["seconds_two_axes"].met is False
    assert found["memory_two_axes"].met is True
    assert found["growth"].value == pytest.approx(2.4)
    assert found["growth"].met is False


def test_memory_is_the_most_that_was_resident(tmp_path):
    status = tmp_path / "status"
    status.write_text("Name:\tpython\nVmPeak:\t 9000000 kB\nVmHWM:\t 1000000 kB\nVmRSS:\t 5 kB\n")
    assert peak_memory_gb(status) == pytest.approx(1.024)
    assert 0.01 < peak_memory_gb(tmp_path / "absent") < 100.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["diagnosis", "--cases", "2", "--size", "full"], "only one of the two"),
        (["diagnosis", "--only", "one:1", "--seed", "2"], "--only names the cases"),
        (["diagnosis", "--only", "ones:1"], "GROUP:SEED"),
    ],
)
def test_options_that_contradict_each_other_are_refused(arguments, words):
    result = CliRunner().invoke(bench, arguments)
    assert isinstance(result.exception, UsageError)
    assert words in str(result.exception)


def test_a_file_that_cannot_be_written_is_told_before_anything_is_run(tmp_path):
    options = CampaignOptions(cases=1, out=tmp_path / "no" / "cases.jsonl")
    with pytest.raises(UsageError, match=r"cases\.jsonl: cannot be written"):
        run_campaign(options, lambda _: None)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_tiny_campaign_answers_its_cases(tmp_path):
    chosen = (CaseKey("one", 50_014), CaseKey("clean", 70_000), CaseKey("unknown", 80_002))
    out, logs = tmp_path / "cases.jsonl", tmp_path / "logs"
    shares = []
    options = CampaignOptions(only=chosen, workers=2, out=out, logs=logs)
    result = measure("diagnosis", partial(diagnosis_findings, options=options), shares.append)
    assert shares[-1] == 1.0
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    assert {(row["group"], row["case"]["seed"]) for row in rows} == {
        (key.group, key.seed) for key in chosen
    }
    assert all(row["answer"]["verdict"] != "failed" for row in rows)
    driven = next(row for row in rows if row["group"] == "one")["closed_loop"]
    assert driven["oracle_m"] > 0.0
    assert driven["refined_m"] <= driven["own_m"]
    assert len(list(logs.glob("*.parquet"))) == 3
    names = {figure["name"] for figure in result.document()["figures"]}
    assert {"one", "clean", "unknown", "calibration_error"} <= names
    wrong = {row["case"] for row in result.found.mistakes}
    assert wrong <= {str(key) for key in chosen}
