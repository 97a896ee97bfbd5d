"""Models on trial: what proves them, what leads back, and to what."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from motorctl.config import Machine, load, load_resolved, shipped_config
from motorctl.daemon.model_trials import TRIAL_MOTIONS, TRIAL_WINDOW, TRIPS, ModelTrials
from motorctl.log.sample import AxisState, FaultCause

AXES = ("x", "y")


@pytest.fixture(scope="module")
def gantry() -> Machine:
    return load(shipped_config("published_gantry"))


def with_ks(machine: Machine, **ks: float) -> Machine:
    """Return the machine with other gains of these axes: other models, as far as a trial goes."""
    config: Any = copy.deepcopy(dict(machine.resolved))
    for axis, value in ks.items():
        config["axes"][axis]["gains"]["ks_v_s_m"] = value
    return load_resolved(config, str(machine.source))


@pytest.fixture
def trials(gantry: Machine) -> ModelTrials:
    """Return trials of x, whose model was changed once."""
    return ModelTrials(AXES).changed(gantry, with_ks(gantry, x=40.0), ["x"])


def look(
    trials: ModelTrials, fault: FaultCause = FaultCause.NONE, **states: AxisState
) -> list[str]:
    """Look at axes that hold, but for what is said; a fault is x's."""
    seen = dict.fromkeys(AXES, AxisState.IDLE) | states
    return trials.look(seen, dict.fromkeys(AXES, FaultCause.NONE) | {"x": fault})


def move(trials: ModelTrials, axis: str = "x", then: AxisState = AxisState.IDLE) -> None:
    assert look(trials, **{axis: AxisState.RUNNING}) == []
    assert look(trials, **{axis: then}) == []


def test_motions_that_end_by_themselves_prove_a_model(trials: ModelTrials) -> None:
    for left in range(TRIAL_MOTIONS, 0, -1):
        assert trials.motions_left("x") == left
        assert trials.proved == []
        move(trials)
    assert trials.proved == ["x"]
    ended = trials.ended(["x"])
    assert ended.motions_left("x") is None
    assert ended.windows == (1.0, 1.0)


@pytest.mark.parametrize("then", [AxisState.STOPPING, AxisState.OFF, AxisState.FAULT])
def test_a_motion_that_anything_else_ends_proves_nothing(
    trials: ModelTrials, then: AxisState
) -> None:
    for _ in range(TRIAL_MOTIONS):
        move(trials, then=then)
        look(trials)
    assert trials.motions_left("x") == TRIAL_MOTIONS


def test_a_trip_is_seen_behind_a_quick_stop(trials: ModelTrials) -> None:
    for _ in range(TRIAL_MOTIONS - 1):
        move(trials)
    move(trials, then=AxisState.STOPPING)  # as the reaction to a fault is told
    assert trials.proved == []
    assert look(trials, FaultCause.FOLLOWING_ERROR, x=AxisState.FAULT) == ["x"]


@pytest.mark.parametrize("cause", FaultCause)
def test_what_a_model_may_cause_leads_back_and_nothing_else(
    trials: ModelTrials, cause: FaultCause
) -> None:
    assert look(trials, cause, x=AxisState.FAULT) == (["x"] if cause in TRIPS else [])


def test_no_axis_proves_another(gantry: Machine) -> None:
    trials = ModelTrials(AXES).changed(gantry, with_ks(gantry, x=40.0, y=40.0), AXES)
    for _ in range(TRIAL_MOTIONS):
        move(trials, "x")
    assert trials.proved == ["x"]
    assert trials.motions_left("y") == TRIAL_MOTIONS


def test_a_partner_on_trial_goes_back_with_the_axis_that_tripped(gantry: Machine) -> None:
    trials = ModelTrials(AXES).changed(gantry, with_ks(gantry, x=40.0, y=40.0), AXES)
    faults = {"x": FaultCause.FOLLOWING_ERROR, "y": FaultCause.PARTNER}
    assert trials.look(dict.fromkeys(AXES, AxisState.FAULT), faults) == ["x", "y"]


def test_another_model_on_top_of_one_on_trial_leads_back_to_the_one_that_proved_itself(
    gantry: Machine, trials: ModelTrials
) -> None:
    move(trials)
    first, second = with_ks(gantry, x=40.0), with_ks(gantry, x=50.0)
    again = trials.changed(first, second, ["x"])
    assert again.proven("x") is gantry
    assert again.motions_left("x") == TRIAL_MOTIONS
    assert again.windows == (TRIAL_WINDOW, 1.0)
    # back to the first is back to what never proved itself; back to the gantry's own is not
    assert again.changed(second, first, ["x"]).proven("x") is gantry
    assert again.changed(second, gantry, ["x"]).motions_left("x") is None


def test_a_change_of_one_axis_leaves_another_on_trial(gantry: Machine, trials: ModelTrials) -> None:
    move(trials)
    both = trials.changed(with_ks(gantry, x=40.0), with_ks(gantry, x=40.0, y=40.0), ["y"])
    assert both.motions_left("x") == TRIAL_MOTIONS - 1
    assert both.windows == (TRIAL_WINDOW, TRIAL_WINDOW)
    assert look(both, FaultCause.OVERSPEED, x=AxisState.FAULT) == ["x"]


def test_what_is_taken_back_is_on_trial_where_it_was_before(
    gantry: Machine, trials: ModelTrials
) -> None:
    # from one that proved itself back to one that did: nothing is on trial
    none = ModelTrials(AXES)
    assert none.taken_back(none, ["x"]).windows == (1.0, 1.0)
    # from one that proved itself back to one that had not
    back = none.taken_back(trials, ["x"])
    assert back.proven("x") is gantry
    assert back.motions_left("x") == TRIAL_MOTIONS
    # and from one on trial back to one that had proved itself; others go on as they are
    both = trials.changed(with_ks(gantry, x=40.0), with_ks(gantry, x=40.0, y=40.0), ["y"])
    assert both.taken_back(none, ["x"]).windows == (1.0, TRIAL_WINDOW)
