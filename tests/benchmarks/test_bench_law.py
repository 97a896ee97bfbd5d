"""The numpy law that the compiled one is timed beside is the same law."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from motorctl.config import load
from motorctl.config.machine import Machine
from motorctl.errors import RunError
from motorctl_benchmarks.law_data import LawData, record_law
from motorctl_benchmarks.law_figures import friction_slope_s_m
from motorctl_benchmarks.law_loop import CompiledLaw
from motorctl_benchmarks.numpy_law import NumpyLaw

STEPS = 600


def _with_adaptation(machine: Machine, **changes: float) -> Machine:
    axes = {
        name: axis.model_copy(update={"adaptation": axis.adaptation.model_copy(update=changes)})
        for name, axis in machine.axes.items()
    }
    return dataclasses.replace(machine, axes=axes)


def _assert_numpy_agrees(data: LawData) -> None:
    law = NumpyLaw(data.settings[0], data.start[0], friction_slope_s_m(data.model))
    rows = zip(*(column.tolist() for column in data.motion), strict=True)
    for k, (y, xd, vd, ad) in enumerate(rows):
        assert law.step(y, xd, vd, ad) == pytest.approx(data.command_v[k], abs=1e-9)
        assert law.adapted
        np.testing.assert_allclose(law.theta, data.theta_hat[k], rtol=0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["C1", "C2"])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_numpy_law_gives_the_commands_and_estimates_of_the_compiled_one(controller, axis):
    _assert_numpy_agrees(record_law(load("published_gantry", controller), axis, STEPS))


@pytest.mark.slow
def test_the_numpy_law_agrees_where_the_estimate_is_projected():
    data = record_law(load("published_gantry", "C2"), "y", 2000)
    assert data.projected > 100
    _assert_numpy_agrees(data)


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"input_delay_s": 0.34e-3},
        {"rate_limit_1_s": 0.5},
        {"forgetting_1_s": 20.0, "covariance_limit": 1.01},
    ],
)
def test_the_numpy_law_agrees_with_delay_rate_limit_and_forgetting(changes):
    machine = _with_adaptation(load("published_gantry", "C2"), **changes)
    _assert_numpy_agrees(record_law(machine, "x", STEPS))


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["C1", "C2"])
def test_the_timed_loop_repeats_the_recorded_commands_bit_for_bit(controller):
    data = record_law(load("published_gantry", controller), "x", STEPS)
    law = CompiledLaw(data)
    for _ in range(2):
        law.restart()
        law.command_v.fill(np.nan)
        law.run()
        np.testing.assert_array_equal(law.command_v, data.command_v)
        n = data.theta_hat.shape[1]
        np.testing.assert_array_equal(law.state["theta"][0, :n], data.theta_hat[-1])


def test_a_stretch_in_which_the_estimator_rests_is_refused():
    machine = load("published_gantry", "C2")
    with pytest.raises(RunError, match="does not learn for 5000 ticks"):
        record_law(machine, "x", 5000)
