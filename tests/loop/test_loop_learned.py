"""What was learned is added within its limit, in its program's cycles alone, without a step."""

from __future__ import annotations

import copy
import dataclasses
import inspect

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import Rig, gantry, with_axes, with_sim

from motorctl.config.axis_keys import Learning
from motorctl.config.machine import Machine
from motorctl.log.sample import AxisState
from motorctl.loop import Verb
from motorctl.loop.compose import compose_tick
from motorctl.loop.learned_feedforward import LEARNED_POINTS, LearnedFeedforward
from motorctl.motion import BackAndForth, Trajectory

pytestmark = pytest.mark.slow

LIMIT_V = 0.5
CYCLE_S = 0.4
LEAD_S = 0.05
CYCLES = 2


def learner(**changes: object) -> Machine:
    learning = Learning(file="learned.json", max_share=LIMIT_V / 10.0)
    return with_axes(with_sim(gantry()), learning=learning, **changes)


def motion() -> Trajectory:
    """Return a short wait, and two cycles there and back."""
    program = BackAndForth(
        name="p", axis="x", start_m=0.0, distance_m=0.02, max_velocity_m_s=0.4,
        max_acceleration_m_s2=10.0, jerk_time_s=0.01, period_s=CYCLE_S, cycles=CYCLES,
    )  # fmt: skip
    cycles = program.trajectories()["x"]
    return Trajectory.at_rest(0.0, LEAD_S).then(cycles)


def learned(volts: np.ndarray, models_row: int | None = None) -> LearnedFeedforward:
    return LearnedFeedforward(volts, LEAD_S, CYCLE_S, CYCLES, models_row)


def follow(rig: Rig, volts: np.ndarray, models_row: int | None = None) -> None:
    if rig.state_of("x") is AxisState.OFF:
        rig.order(Verb.START, "x")
    rig.seconds(0.1)
    slot = rig.memory.load_program(0, motion().segments, learned(volts, models_row))
    rig.order(Verb.FOLLOW, "x", slot=slot)


def steps(rows: np.ndarray) -> np.ndarray:
    """Return by how much what is added and the fast adaptation, together, change in each tick.

    While the axis is led: an amplifier that is disabled gives nothing of either.
    """
    led = rows["state"] != AxisState.OFF
    change = np.abs(np.diff(rows["learned_v"] - rows["d0_hat_v"]))
    return change[led[1:] & led[:-1]]


@pytest.mark.slow
@settings(max_examples=12)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=40),
    st.integers(0, 6000),
    st.sampled_from([Verb.STOP, Verb.ESTOP]),
    st.floats(0.0, 0.3),
)
def test_it_stays_within_its_limit_and_outside_of_its_cycles_there_is_none(
    volts: list[float], ends_after: int, verb: Verb, d_hat_max_v: float
) -> None:
    with Rig(learner(gains={"d_hat_max_v": d_hat_max_v})) as rig:
        follow(rig, np.array(volts))
        rig.advance(ends_after)
        rig.ask(verb, "x")
        rig.seconds(0.2)
        rows, time_s = rig.rows("x"), rig.ticks_seen["time_s"]
    added = rows["learned_v"]
    assert np.abs(added).max() <= LIMIT_V
    assert np.abs(rows["command_v"]).max() <= 10.0
    running = np.flatnonzero(rows["state"] == AxisState.RUNNING)
    begin_s = time_s[running[0]]
    outside = (time_s < begin_s + LEAD_S - 1e-9) | (rows["state"] == AxisState.FAULT)
    assert not added[outside].any()
    assert not rig.rows("y")["learned_v"].any()
    # What the fast adaptation could not take up has faded a twentieth of a second later.
    over = np.flatnonzero(np.isin(rows["state"], (AxisState.RUNNING, AxisState.FAULT), invert=True))
    late = over[over > running[-1] + 260]
    assert not added[late].any()


@pytest.mark.parametrize("d_hat_max_v", [1.0, 0.1])
@pytest.mark.parametrize("ends_after", [None, 900])
def test_it_comes_and_goes_without_a_step(d_hat_max_v: float, ends_after: int | None) -> None:
    place = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    with Rig(learner(gains={"d_hat_max_v": d_hat_max_v})) as rig:
        follow(rig, 0.3 + 0.1 * np.sin(place))
        if ends_after is not None:
            rig.advance(ends_after)
            rig.ask(Verb.STOP, "x")
        rig.seconds(1.2)
        rows = rig.rows("x")
    assert np.abs(rows["learned_v"]).max() > 0.3
    assert steps(rows).max() <= 0.01 * 10.0
    assert rows["learned_v"][-1] == 0.0
    assert rows["state"][-1] == (AxisState.IDLE if ends_after is None else AxisState.OFF)


def test_it_is_what_was_learned_for_the_place_in_the_cycle() -> None:
    place = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    with Rig(learner()) as rig:
        follow(rig, 0.2 * np.sin(3.0 * place))
        rig.seconds(1.2)
        rows, time_s = rig.rows("x"), rig.ticks_seen["time_s"]
    running = np.flatnonzero(rows["state"] == AxisState.RUNNING)
    passed_s = time_s - time_s[running[0]] - LEAD_S
    inside = (passed_s >= 0.0) & (passed_s < CYCLES * CYCLE_S)
    wanted = 0.2 * np.sin(3.0 * 2.0 * np.pi * passed_s / CYCLE_S)
    # A tick after the order: where exactly the program began lies within one.
    np.testing.assert_allclose(rows["learned_v"][inside], wanted[inside], atol=2e-3)
    assert inside.sum() > 3000


def test_a_fault_ends_it_in_the_same_tick() -> None:
    with Rig(learner(gains={"d_hat_max_v": 0.0})) as rig:
        follow(rig, np.full(100, 0.3))
        rig.seconds(0.3)
        assert rig.last("x")["learned_v"] == pytest.approx(0.3)
        rig.ask(Verb.ESTOP, "x")
        assert rig.last("x")["state"] == AxisState.FAULT
        assert rig.last("x")["learned_v"] == 0.0
        assert rig.last("x")["command_v"] == 0.0


def test_the_estimate_sees_the_whole_command() -> None:
    """Else a constant voltage beside the law would be learned as an offset of the plant."""
    found = []
    for volts in (0.0, 0.4):
        with Rig(learner()) as rig:
            for _ in range(4):
                follow(rig, np.full(100, volts))
                rig.seconds(1.1)
            rows = rig.rows("x")
        names = list(rig.machine.axes["x"].model.parameter_names)
        assert np.abs(rows["learned_v"]).max() == volts
        found.append(rows["theta_hat"][-1, names.index("offset")])
    assert found[1] == pytest.approx(found[0], abs=0.02)


def test_with_other_models_than_it_was_learned_with_nothing_is_added() -> None:
    with Rig(learner()) as rig:
        follow(rig, np.full(100, 0.3), models_row=rig.memory.models_row + 1)
        rig.seconds(1.2)
        assert not rig.rows("x")["learned_v"].any()


def with_other_gains(machine: Machine, name: str) -> Machine:
    resolved = copy.deepcopy(dict(machine.resolved))
    gains = resolved["axes"][name]["gains"]  # type: ignore[index]
    gains["ks_v_s_m"] *= 0.9
    changed = with_axes(machine, [name], gains={"ks_v_s_m": gains["ks_v_s_m"]})
    return dataclasses.replace(changed, resolved=resolved)


@pytest.mark.slow
def test_another_model_of_an_axis_beside_leaves_what_a_running_one_has_learned() -> None:
    machine = learner()
    with Rig(machine) as rig:
        rig.order(Verb.START, "y")
        follow(rig, np.full(100, 0.3))
        rig.seconds(0.3)
        rig.chunks.clear()
        assert rig.change_models(with_other_gains(machine, "y")) is None
        rig.seconds(0.2)
        rows = rig.rows("x")
        assert (rows["state"] == AxisState.RUNNING).all()
        np.testing.assert_allclose(rows["learned_v"], 0.3)


def test_the_longest_cycle_fits_and_another_program_has_nothing_of_it() -> None:
    with Rig(learner()) as rig:
        follow(rig, np.full(LEARNED_POINTS, 0.2))
        rig.seconds(1.2)
        assert rig.rows("x")["learned_v"].max() == pytest.approx(0.2)
        rig.chunks.clear()
        for _ in range(2):  # both slots
            rig.move("x", 0.1)
            rig.seconds(1.0)
            rig.move("x", 0.0)
            rig.seconds(1.0)
        assert not rig.rows("x")["learned_v"].any()


def test_a_machine_without_learning_has_a_tick_that_knows_nothing_of_it() -> None:
    lists = [axis.model for axis in gantry().axes.values()]
    plain = inspect.getsource(compose_tick(lists, [0, 1], [1, 1]))
    assert plain == inspect.getsource(compose_tick(lists, [0, 1], [1, 1], None, [False, False]))
    assert "learned" not in plain
    one = inspect.getsource(compose_tick(lists, [0, 1], [1, 1], None, [False, True]))
    assert one.count("lead_by_learned(") == 2  # in the tick, and in what is analysed of it
