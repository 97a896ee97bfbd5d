"""Figures, their targets, and the command that prints them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from motorctl.config.machine import MOST_PARAMETERS
from motorctl.latency.figure import Figure, Target, missed
from motorctl.loop import VirtualMachine
from motorctl_benchmarks import (
    full_model_figures,
    law_figures,
    speed,
    start_figures,
    tick_figures,
    virtual_figures,
)
from motorctl_benchmarks.command import bench
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.gantries import gantry_with, gantry_with_full_models
from motorctl_benchmarks.interleave import interleaved, median_ratio
from motorctl_benchmarks.tick_figures import growth_figures
from motorctl_benchmarks.tick_probe import PARTS, TickProbe

KEYS = {"name", "title", "value", "unit", "peer", "peer_value", "ratio", "target", "met"}


def _ignore(_share: float) -> None:
    pass


def _growth(law) -> Figure:
    times = {n: np.full(5, law(n)) for n in (1, 2, 4, 8)}
    return next(f for f in growth_figures(times) if f.name == "tick_growth")


def test_subjects_are_measured_in_turn_after_a_round_that_does_not_count():
    calls: list[str] = []

    def subject(name: str):
        def run() -> float:
            calls.append(name)
            return float(len(calls))

        return run

    results = interleaved({"a": subject("a"), "b": subject("b")}, 3, _ignore)
    assert "".join(calls) == "ab" * 4
    assert results["a"].tolist() == [3.0, 5.0, 7.0]
    assert results["b"].tolist() == [4.0, 6.0, 8.0]


def test_a_round_that_was_disturbed_as_a_whole_leaves_the_ratio_alone():
    fast = np.array([1.0, 50.0, 1.0])
    assert median_ratio(20.0 * fast, fast) == 20.0


@pytest.mark.parametrize(
    ("target", "value", "ratio", "met"),
    [
        (Target("value", "<", 15.0), 15.0, None, False),
        (Target("value", "<", 15.0), 14.9, None, True),
        (Target("value", "<=", 15.0), 15.0, None, True),
        (Target("ratio", ">=", 15.0), 1.0, 15.0, True),
        (Target("ratio", ">=", 15.0), 99.0, 14.9, False),
        (Target("ratio", ">=", 15.0), 1.0, None, None),
        (None, 1.0, 1.0, None),
    ],
)
def test_a_target_is_judged_by_the_number_that_it_is_set_for(target, value, ratio, met):
    figure = Figure("f", "a figure", value, "us", ratio=ratio, target=target)
    assert figure.met is met
    assert figure.document()["met"] is met
    assert len(missed((figure,))) == (met is False)


def test_a_missed_target_is_told_with_value_and_limit():
    figure = Figure("f", "a figure", 7.25, "us", target=Target("value", "<", 5.0))
    assert missed((figure,)) == ["a figure: 7.25 us, should be < 5 us"]


@given(st.floats(0.01, 100.0), st.floats(0.0, 100.0))
def test_linear_growth_with_any_fixed_part_is_no_worse_than_linear(per_axis, fixed):
    assert _growth(lambda n: fixed + per_axis * n).value <= 2.0 + 1e-12


@given(st.floats(0.01, 100.0))
def test_quadratic_growth_is_worse_than_linear(scale):
    assert _growth(lambda n: scale * n * n).met is False


def test_the_fit_finds_fixed_part_and_cost_of_an_axis():
    times = {n: np.full(5, 3.0 + 0.5 * n) for n in (1, 2, 4, 8)}
    found = {f.name: f.value for f in growth_figures(times)}
    assert found["tick_fixed"] == pytest.approx(3.0)
    assert found["tick_per_axis"] == pytest.approx(0.5)
    assert found["tick_fit_error"] == pytest.approx(0.0, abs=1e-9)
    assert found["tick_4_axes_per_axis"] == pytest.approx(1.25)


@pytest.mark.slow
def test_bench_prints_one_json_document_of_figures(monkeypatch):
    monkeypatch.setattr(law_figures, "ROUNDS", 2)
    monkeypatch.setattr(law_figures, "STEPS", 200)
    monkeypatch.setattr(tick_figures, "AXES", (1, 2))
    monkeypatch.setattr(tick_figures, "ROUNDS", 2)
    monkeypatch.setattr(virtual_figures, "SPANS", 2)
    monkeypatch.setattr(virtual_figures, "SPAN_S", 0.2)
    monkeypatch.setattr(speed, "SPEED", speed.SPEED[:3])  # starts and full models take minutes
    answer = CliRunner().invoke(bench, ["--json"])
    assert answer.exit_code == 0
    document = json.loads(answer.stdout)
    assert document["subject"] == "speed"
    assert document["host"]["cpus"] >= 1
    figures = {figure["name"]: figure for figure in document["figures"]}
    assert all(figure.keys() == KEYS for figure in figures.values())
    fitted = {"tick_fixed", "tick_per_axis", "tick_fit_error"}
    assert all(figures[name]["value"] > 0.0 for name in figures.keys() - fitted)
    for name in ("c2_step", "c1_step"):
        assert figures[name]["peer"] == "the same law in numpy"
        assert figures[name]["target"] == {"of": "ratio", "relation": ">=", "limit": 15.0}
    for name, published_us in (("c2_step_published", 14.0), ("c1_step_published", 10.0)):
        assert figures[name]["peer_value"] == pytest.approx(published_us)
        assert figures[name]["target"] == {"of": "value", "relation": "<", "limit": 1.0}
    assert figures.keys() >= {f"tick_2_axes_{part}" for part in PARTS[1:]}
    assert figures["virtual_time"]["ratio"] == figures["virtual_time"]["value"]
    unmet = [figure["title"] for figure in figures.values() if figure["met"] is False]
    assert len(document["missed"]) == len(unmet)


@pytest.mark.slow
@pytest.mark.long
def test_the_shipped_gantry_runs_with_as_many_parameters_as_there_is_room_for(monkeypatch):
    machine = gantry_with_full_models()
    assert {len(axis.estimates) for axis in machine.axes.values()} == {MOST_PARAMETERS}
    with VirtualMachine(machine, lambda _ticks, _samples: None) as virtual:
        virtual.start()
        virtual.follow_programs(machine.followed_programs)
        virtual.advance(round(1.0 * machine.rate_hz))
        virtual.raise_faults()
        laws = virtual.tick.laws["theta"]
        initial = [[e.initial for e in axis.estimates] for axis in machine.axes.values()]
        assert np.isfinite(laws).all()
        assert ((laws - initial)[:, 6:] != 0.0).any(axis=1).all()  # what was added is learned
    monkeypatch.setattr(full_model_figures, "ROUNDS", 2)
    (figure,), _ = full_model_figures.full_model_figures(_ignore)
    assert 0.0 < figure.peer_value < figure.value


@pytest.mark.slow
def test_the_parts_of_every_tick_lie_within_it():
    with TickProbe(gantry_with(1)) as probe:
        times = probe.run(50)
    assert times.shape == (50, len(PARTS))
    assert (times >= 0.0).all()
    assert (times[:, 1:4].sum(axis=1) <= times[:, 0] + 1e-12).all()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["diagnosi"], "No such command 'diagnosi'. Did you mean 'diagnosis'?"),
        (["speed", "--cases", "2"], "No such option: --cases"),
    ],
)
def test_a_subject_or_option_that_is_not_there_is_refused(words, told):
    answer = CliRunner().invoke(bench, words)
    assert answer.exit_code != 0
    assert told in f"{answer.output} {answer.exception}"


def test_names_of_others_are_written_out_wherever_the_command_prints_them(monkeypatch):
    name = "axis\x1b[1A\x1b[2K[bold]\u202e"
    shown = r"axis\x1b[1A\x1b[2K[bold]\u202e"
    found = Findings(
        figures=(Figure("far", name, 2.0, "mm", peer=name, target=Target("value", "<", 1.0)),),
        notes=(name,),
        mistakes=({"case": name, "truth": name, "answer": name},),
        tables=(TextTable(name, (name,), ((name,),)),),
    )
    monkeypatch.setattr(
        "motorctl_benchmarks.real_machines.findings.recordings_findings", lambda *_, **__: found
    )
    for words in (["--json", "recordings"], ["recordings", "--json"]):
        document = json.loads(CliRunner().invoke(bench, words).stdout)
        assert document["subject"] == "recordings"
    answer = CliRunner().invoke(bench, ["recordings"])
    assert answer.exit_code == 0
    assert all(c.isprintable() or c == "\n" for c in answer.stdout)
    assert answer.stdout.count(shown) == 10


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.wall_clock
def test_the_first_start_compiles_what_the_next_one_finds(monkeypatch):
    monkeypatch.setattr(start_figures, "NEXT_STARTS", 1)
    figures, _notes = start_figures.start_figures(_ignore)
    (first,) = figures
    assert first.value > 2.0 * first.peer_value > 0.0
    assert first.ratio == pytest.approx(first.peer_value / first.value)
