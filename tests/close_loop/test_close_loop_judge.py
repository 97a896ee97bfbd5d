import dataclasses
from pathlib import Path

import numpy as np
import pytest
from refine_bench import THETA, gantry_log

from motorctl.close_loop.judge import judge
from motorctl.close_loop.trial import Trial, model_error_v
from motorctl.config import load
from motorctl.identify.compare.measures import Measures
from motorctl.log import read_recording

pytestmark = pytest.mark.slow

BEFORE = Measures(eM_m=40e-6, eF_m=30e-6, L2_m=5e-6, uM_V=9.0)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return read_recording(gantry_log(tmp_path_factory.mktemp("log"), 3.0))


def with_theta(machine, share):
    """Put the start values a share of the way from the shipped ones to the truth."""
    axes = {}
    for name, axis in machine.axes.items():
        estimates = tuple(
            dataclasses.replace(e, initial=e.initial + share * (truth - e.initial))
            for e, truth in zip(axis.estimates, THETA[name], strict=True)
        )
        axes[name] = axis.model_copy(update={"estimates": estimates})
    return dataclasses.replace(machine, axes=axes)


def trial(recording, measures, share=0.0, tripped=""):
    machine = with_theta(load("published_gantry"), share)
    both = {name: {"x": measures, "y": BEFORE} for name in ("own", "unused")}
    return Trial(Path("c.yaml"), machine, {"unused": recording}, both, tripped)


def judged(recording, after, share=0.5, **changes):
    before = trial(recording, BEFORE)
    return judge(before, trial(recording, after, share, **changes), before)


def test_a_change_that_makes_nothing_worse_is_accepted(recording):
    better = dataclasses.replace(BEFORE, eM_m=20e-6, eF_m=10e-6, L2_m=1e-6)
    judgements = judged(recording, better)
    assert all(judgement.accepted for judgement in judgements.values())
    old, new = judgements["x"].model_error_v
    assert new < old


@pytest.mark.parametrize("measure", ["eF_m", "L2_m", "eM_m"])
def test_no_tracking_error_may_become_larger(recording, measure):
    worse = dataclasses.replace(BEFORE, **{measure: 1.1 * getattr(BEFORE, measure)})
    judgements = judged(recording, worse)
    assert not judgements["x"].accepted
    assert measure.partition("_")[0].removesuffix("_m") in judgements["x"].against[0]
    assert judgements["y"].accepted


def test_the_largest_error_may_differ_by_a_count(recording):
    assert judged(recording, dataclasses.replace(BEFORE, eM_m=40.4e-6))["x"].accepted


def test_the_model_error_may_not_become_larger(recording):
    judgements = judged(recording, BEFORE, share=-0.5)
    for judgement in judgements.values():
        assert not judgement.accepted
        assert "model error" in judgement.against[0]


def test_more_command_is_no_error(recording):
    assert judged(recording, dataclasses.replace(BEFORE, uM_V=9.9))["x"].accepted


def test_a_change_that_trips_is_not_accepted(recording):
    judgements = judged(recording, BEFORE, tripped="own motion: axis x tripped")
    assert "tripped" in judgements["x"].against[0]


def test_the_model_error_is_that_of_the_start_values(recording):
    machine = load("published_gantry")
    errors = [model_error_v(with_theta(machine, s), recording, machine) for s in (0.0, 0.5, 1.0)]
    for axis in "xy":
        assert np.all(np.diff([error[axis] for error in errors]) < 0.0)


@pytest.mark.parametrize("measure", ["eF_m", "L2_m", "eM_m"])
def test_on_a_machine_an_error_counts_as_larger_beyond_what_runs_differ_by(recording, measure):
    before = dataclasses.replace(trial(recording, BEFORE), repeats_within=0.2)

    def grown(factor):
        after = dataclasses.replace(BEFORE, **{measure: factor * getattr(BEFORE, measure)})
        return judge(before, trial(recording, after, 0.5), before)["x"]

    assert grown(1.15).accepted
    assert not grown(1.3).accepted
