"""An excitation comes and goes without a step, within its limit, and never outlasts the holding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_bench import Hand, Rig, Still, gantry, homed_by, with_axes, with_driver, with_sim

from motorctl.errors import RunError, UsageError
from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.loop import Excitation, Reply, Verb
from motorctl.loop.states import State

TICKS = 200
LIMIT_V = 2.0
"""Of the shipped axes: a fifth of their 10 V."""


def wave(peak_v: float = 1.0, ticks: int = TICKS) -> np.ndarray:
    """Return a period of a few sines."""
    angle = 2.0 * np.pi * np.arange(ticks) / ticks
    values = np.sin(3 * angle) + np.cos(7 * angle)
    return values * (peak_v / np.abs(values).max())


def excitation(peak_v: float = 1.0, periods: int = 5, fade_periods: int = 1) -> Excitation:
    return Excitation(wave(peak_v), periods, fade_periods)


def begin(rig: Rig | Hand, wanted: Excitation, axis: str = "x") -> Reply | None:
    """Load an excitation, whatever it is, and ask the loop to begin it."""
    rig.memory.load_excitation(rig.names.index(axis), wanted)
    return rig.ask(Verb.EXCITE, axis)


def test_an_excitation_is_added_to_the_command_and_ends_by_itself() -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        rig.seconds(0.2)
        rig.chunks.clear()
        rig.excite("x", excitation(periods=5, fade_periods=2))
        rig.advance(9 * TICKS + 50)
        rows = rig.rows("x")
        added = rows["excitation_v"]
        assert np.array_equal(added[2 * TICKS - 1 : 7 * TICKS - 1], np.tile(wave(), 5)[: 5 * TICKS])
        assert not added[9 * TICKS - 1 :].any()
        assert rig.state_of("x") is AxisState.IDLE
        assert rig.state("x")["excitation_left"] == 0
        # It shakes the axis, and only that one.
        assert np.ptp(rows["position_m"]) > 5e-6
        assert not rig.rows("y")["excitation_v"].any()


shapes = st.lists(st.floats(-1.0, 1.0), min_size=20, max_size=150)


@settings(max_examples=20)
@given(shapes, st.floats(0.05, LIMIT_V), st.integers(1, 4), st.booleans(), st.integers(0, 3000))
def test_the_command_stays_within_its_limit_and_an_excitation_comes_and_goes_without_a_step(
    shape: list[float], peak_v: float, more: int, follows: bool, stop_after: int
) -> None:
    volts = np.clip(np.array(shape) * peak_v, -LIMIT_V, LIMIT_V)
    fades = -(-100 // len(volts))
    wanted = Excitation(volts, more, fades)
    with Rig(with_sim(gantry())) as rig:
        limit_v = rig.machine.axes["x"].limits.max_voltage_v
        rig.order(Verb.START, "x")
        if follows:
            rig.move("x", 0.3, 1.2)
        rig.excite("x", wanted)
        rig.advance(stop_after)
        rig.ask(Verb.STOP, "x")
        rig.advance(20)
        rows = rig.rows("x")
        added = rows["excitation_v"]
        assert np.abs(rows["command_v"]).max() <= limit_v
        assert not added[rows["state"] == AxisState.STOPPING].any()
        lasted = min(stop_after + 1, wanted.total_ticks - 1)
        begun = len(rows) - 20 - 1 - stop_after - 1
        assert not added[:begun].any()
        assert not added[begun + lasted :].any()
        # Its size from tick to tick of its coming and going, a hundredth of the voltage at most.
        part = np.minimum(np.arange(1, lasted + 1), wanted.total_ticks - np.arange(1, lasted + 1))
        part = np.minimum(part / wanted.fade_ticks, 1.0)
        size_v = LIMIT_V * part * part * (3.0 - 2.0 * part)
        assert np.all(np.abs(added[begun : begun + lasted]) <= size_v + 1e-12)
        assert size_v[0] <= 0.01 * limit_v
        assert np.abs(np.diff(size_v)).max(initial=0.0) <= 0.01 * limit_v


def test_a_constant_excitation_changes_by_less_than_a_hundredth_of_the_limit_a_tick() -> None:
    machine = with_axes(with_sim(gantry()), ["x"], limits={"max_excitation_share": 0.5})
    with Rig(machine) as rig:
        rig.order(Verb.START, "x")
        rig.excite("x", Excitation(np.full(100, 5.0), 1, 1))
        rig.advance(400)
        added = rig.rows("x")["excitation_v"]
        assert added.max() == 5.0
        assert np.abs(np.diff(added)).max() <= 0.01 * 10.0


@pytest.mark.parametrize("way", ["stop", "estop", "trip", "quick stop", "home"])
def test_whatever_ends_the_holding_takes_the_excitation_with_it_in_the_same_tick(way: str) -> None:
    machine = with_axes(with_driver(gantry(), Still), ["x"], homing=homed_by("index"))
    with Hand(machine) as hand:
        hand.tick.axes["homed"] = 1
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(3)
        assert begin(hand, excitation(periods=50)) is Reply.OK
        hand.steps(TICKS + 10)
        assert hand.row()["excitation_v"] != 0.0
        if way in ("stop", "quick stop"):
            hand.tick.axes["reference_velocity_m_s"][0] = 0.1  # so that there is a ramp
        if way == "stop":
            hand.ask(Verb.STOP)
        elif way == "estop":
            hand.ask(Verb.ESTOP)
        elif way == "home":
            assert hand.ask(Verb.HOME) is Reply.OK
        elif way == "trip":
            hand.driver.status[0] = int(Status.AMPLIFIER_FAULT)
            hand.step()
        else:
            while hand.status()["inner_state"] == State.HOLDING:
                hand.step(beat=False)
        expected = {
            "stop": (State.QUICK_STOP_ACTIVE,),
            "quick stop": (State.FAULT_REACTION_ACTIVE,),
            "home": (State.HOMING,),
        }.get(way, (State.FAULT,))
        assert hand.status()["inner_state"] in expected
        assert hand.row()["excitation_v"] == 0.0
        assert hand.status()["excitation_left"] == 0
        if expected == (State.FAULT,):
            assert hand.driver.volts[0] == 0.0
        hand.steps(5 * TICKS)
        assert hand.row()["excitation_v"] == 0.0


def test_an_excitation_does_not_come_back_with_the_axis() -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        rig.excite("x", excitation(periods=50))
        rig.advance(3 * TICKS)
        rig.order(Verb.ESTOP, "x")
        rig.seconds(0.1)
        for verb in (Verb.RESET, Verb.START):
            rig.order(verb, "x")
        rig.chunks.clear()
        rig.seconds(0.2)
        assert rig.state_of("x") is AxisState.IDLE
        assert not rig.rows("x")["excitation_v"].any()


@pytest.mark.parametrize("state", ["off", "fault", "stopping", "homing", "without power"])
def test_an_axis_that_neither_holds_nor_follows_is_not_excited(state: str) -> None:
    machine = with_axes(with_driver(gantry(), Still), ["x"], homing=homed_by("index"))
    with Hand(machine) as hand:
        hand.tick.axes["homed"] = 1
        hand.steps(2)
        if state == "without power":
            hand.driver.status[:] = int(Status.UNPOWERED)
            hand.step()
        if state != "off":
            assert hand.ask(Verb.START) is Reply.OK
            hand.steps(3)
        if state == "fault":
            hand.ask(Verb.ESTOP)
        elif state == "homing":
            assert hand.ask(Verb.HOME) is Reply.OK
            hand.steps(30)
        elif state == "stopping":
            hand.tick.axes["reference_velocity_m_s"][0] = 0.1
            hand.ask(Verb.STOP)
        before = hand.status()["inner_state"]
        assert begin(hand, excitation()) is Reply.WRONG_STATE
        assert hand.status()["inner_state"] in (before, State.SWITCH_ON_DISABLED)
        hand.steps(TICKS)
        assert hand.row()["excitation_v"] == 0.0


def test_an_axis_that_does_not_know_its_place_is_not_excited() -> None:
    machine = with_axes(with_driver(gantry(), Still), ["x"], homing=homed_by("index"))
    with Hand(machine) as hand:
        hand.steps(2)
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(3)
        assert begin(hand, excitation()) is Reply.NOT_HOMED


def test_a_second_excitation_is_refused_and_the_first_goes_on() -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        rig.excite("x", excitation(1.0))
        rig.advance(TICKS)
        with pytest.raises(RunError, match="excite refused: excited"):
            rig.excite("x", excitation(0.5))
        rig.advance(2 * TICKS)
        assert np.abs(rig.rows("x")["excitation_v"]).max() == pytest.approx(1.0)


def test_no_excitation_begins_once_the_loop_shuts_down() -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        rig.move("x", 0.3)
        rig.seconds(0.1)
        rig.memory.post(Verb.SHUTDOWN)
        assert begin(rig, excitation()) is Reply.WRONG_STATE


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        (Excitation(wave(2.5), 5, 1), r"2\.5 V: limit 2 V \(limits.max_excitation_share 0\.2"),
        (Excitation(wave(np.nan), 5, 1), "limit 2 V"),
        (Excitation(np.zeros(20_000), 5, 1), "20000 ticks: should have 2 to 16384"),
        (Excitation(wave(), 0, 1), "0 periods"),
        (Excitation(wave(), 5, 0), "comes in 0"),
        (Excitation(wave(ticks=50), 5, 1), "comes in 50 ticks: should be at least 100"),
        (Excitation(wave(), 100_000, 1), "excitation of 4000 s: limit 1800 s"),
    ],
)
def test_an_excitation_that_the_axis_does_not_allow_is_refused_with_its_limit(
    wanted: Excitation, words: str
) -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        with pytest.raises(UsageError, match=words):
            rig.excite("x", wanted)


def test_an_axis_whose_share_is_zero_is_never_excited() -> None:
    machine = with_axes(with_sim(gantry()), ["x"], limits={"max_excitation_share": 0.0})
    with Rig(machine) as rig:
        rig.order(Verb.START, "x")
        with pytest.raises(UsageError, match="max_excitation_share is 0"):
            rig.excite("x", excitation())
        assert begin(rig, excitation()) is Reply.OK  # whatever the supervisor has let pass
        rig.advance(3 * TICKS)
        assert not rig.rows("x")["excitation_v"].any()


def test_the_loop_keeps_the_limit_whatever_stands_in_the_slot() -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        assert begin(rig, excitation(9.0)) is Reply.OK
        rig.advance(3 * TICKS)
        assert np.abs(rig.rows("x")["excitation_v"]).max() == LIMIT_V


def test_an_excitation_that_is_no_number_trips_the_axis_before_it_leaves() -> None:
    with Hand(with_driver(gantry(), Still)) as hand:
        hand.steps(2)
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(3)
        assert begin(hand, Excitation(np.full(TICKS, np.nan), 5, 1)) is Reply.OK
        hand.steps(2)
        assert hand.status()["fault"] == FaultCause.NOT_A_NUMBER
        assert (hand.driver.volts[0], hand.driver.enable[0]) == (0.0, 0)


def test_nothing_is_learned_while_an_axis_is_excited_and_learning_goes_on_afterwards() -> None:
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        rig.move("x", 0.4, 0.3)
        rig.seconds(0.2)
        assert rig.last("x")["flags"] & SampleFlag.ADAPTING
        rig.chunks.clear()
        rig.excite("x", excitation(periods=5))
        rig.advance(7 * TICKS + 200)
        rows = rig.rows("x")
        excited = slice(1, 7 * TICKS - 1)
        assert not np.any(rows["flags"][excited] & SampleFlag.ADAPTING)
        assert np.ptp(rows["theta_hat"][excited], axis=0).max() == 0.0
        assert rows["flags"][-1] & SampleFlag.ADAPTING


@pytest.mark.slow
def test_an_axis_of_a_slower_driver_is_excited_at_its_own_rate() -> None:
    machine = with_axes(with_driver(gantry(), Still), divisor=5)
    with Hand(machine) as hand:
        hand.steps(6)
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(15)
        assert begin(hand, excitation()) is Reply.OK
        hand.steps(5 * 7 * TICKS - 10)
        assert hand.status()["excitation_left"] > 0
        hand.steps(20)
        assert hand.status()["excitation_left"] == 0


def test_skipped_periods_count_so_that_the_end_is_where_it_was_to_be() -> None:
    with Hand(with_driver(gantry(), Still)) as hand:
        hand.steps(2)
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(3)
        assert begin(hand, excitation()) is Reply.OK
        before = int(hand.status()["excitation_left"])
        hand.step(elapsed=3)
        assert hand.status()["excitation_left"] == before - 3
