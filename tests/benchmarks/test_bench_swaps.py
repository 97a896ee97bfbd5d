"""`motorctl bench swaps`: models change while axes hold, processes are killed; how it is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorctl_benchmarks.swaps.findings import SwapsOptions, found_of, swaps_findings
from motorctl_benchmarks.swaps.gantry import OTHERS, OWN, written_models
from motorctl_benchmarks.swaps.killing import LOOP, SUPERVISOR, Kill
from motorctl_benchmarks.swaps.swapping import Swap, Swapping

SWAPPING = Swapping(
    swaps=(Swap(OWN, "C1", 0.3, 0.28, 0.4, 0.0), Swap("C1", OWN, 0.0, 0.0, -0.3, 0.0)),
    max_voltage_v=10.0,
    faults=0,
    rows=1000,
    lost=0,
    twice=0,
    unlike=(),
    waited_s=np.array([1.0, 2.0]),
)
KILL = Kill(SUPERVISOR, "C1", 0.5, answered=False, logs=(OWN,))


def met(findings):
    return {figure.name: figure.met for figure in findings.figures}


def test_a_run_in_order_meets_every_target():
    found = found_of(SWAPPING, [KILL, replace(KILL, process=LOOP, logs=(OWN, "C1"))])
    assert set(met(found).values()) == {True}
    assert not found.failed


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("bump", {"swaps": (Swap(OWN, "C1", 0.11, 0.0, 0.4, 0.0),)}),
        ("faults", {"faults": 1}),
        ("rows_lost", {"lost": 3}),
        ("rows_lost", {"twice": 1}),
        ("models", {"unlike": ("a.parquet: none, or one in part, asked for: C1",)}),
    ],
)
def test_whatever_a_change_breaks_fails_the_bench(name, change):
    found = found_of(replace(SWAPPING, **change), [KILL])
    assert found.failed
    assert [key for key, good in met(found).items() if not good] == [name]


def test_a_kill_that_leaves_half_a_model_fails_the_bench():
    found = found_of(SWAPPING, [KILL, replace(KILL, wrong=("models of the last logs: [None]",))])
    assert found.failed
    assert found.mistakes[0]["answer"] == "models of the last logs: [None]"


def test_the_models_that_are_changed_differ_in_controller_gains_effects_and_lag(tmp_path):
    models = written_models(tmp_path)
    own = models.machines[OWN].axes["x"]
    others = [models.machines[name].axes["x"] for name in OTHERS]
    assert {axis.controller for axis in others} == {"C1", "C2"}
    assert any(axis.gains != own.gains for axis in others)
    assert any(len(axis.model) > len(own.model) for axis in others)
    assert any(axis.model.lag_s > 0.0 for axis in others)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.wall_clock
@pytest.mark.parametrize("swaps", [4, 200])
def test_models_change_without_bump_and_a_kill_leaves_the_old_or_the_new(swaps):
    found = swaps_findings(lambda _share: None, SwapsOptions(swaps=swaps))
    assert not found.failed, (found.figures, found.mistakes)
