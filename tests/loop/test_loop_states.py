"""The axis' states: which command each allows, what it answers, what it leads to."""

import numpy as np
import pytest
from loop_bench import TS, Hand, Rig, Still, gantry, homed_by, with_axes, with_driver, with_sim

from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.loop import Reply, Verb
from motorctl.motion import Trajectory, point_to_point


def still(machine=None) -> Rig:
    rig = Rig(with_driver(machine or gantry(), Still))
    rig.tick.open(virtual=True)
    rig.advance(1)
    return rig


def in_state(state: AxisState) -> Rig:
    """Return a machine whose x is in this state; x needs homing, and has it where it can."""
    method = "absolute" if state in (AxisState.RUNNING, AxisState.STOPPING) else "switch"
    rig = still(with_axes(gantry(), ["x"], homing=homed_by(method)))
    match state:
        case AxisState.IDLE:
            rig.order(Verb.START, "x")
        case AxisState.HOMING:
            rig.order(Verb.HOME, "x")
        case AxisState.RUNNING:
            rig.order(Verb.START, "x")
            rig.move("x", 0.3)
        case AxisState.STOPPING:
            rig.order(Verb.START, "x")
            rig.move("x", 0.0005, velocity_m_s=0.01)
            rig.seconds(0.03)
            rig.order(Verb.STOP, "x")
        case AxisState.FAULT:
            rig.order(Verb.ESTOP, "x")
    assert rig.state_of("x") is state
    return rig


NO = Reply.WRONG_STATE
ANSWERS = {
    # state: answers to START, STOP, HOME, FOLLOW, RESET
    AxisState.OFF: (Reply.OK, Reply.OK, Reply.OK, NO, NO),
    AxisState.HOMING: (NO, Reply.OK, NO, NO, NO),
    AxisState.IDLE: (NO, Reply.OK, Reply.OK, Reply.NOT_HOMED, NO),
    AxisState.RUNNING: (NO, Reply.OK, Reply.NO_HOMING, NO, NO),
    AxisState.STOPPING: (NO, Reply.OK, Reply.NO_HOMING, NO, NO),
    AxisState.FAULT: (NO, NO, NO, NO, Reply.OK),
}


@pytest.mark.parametrize("state", list(AxisState))
def test_each_state_answers_every_command(state):
    verbs = (Verb.START, Verb.STOP, Verb.HOME, Verb.FOLLOW, Verb.RESET)
    for verb, answer in zip(verbs, ANSWERS[state], strict=True):
        assert in_state(state).ask(verb) is answer, verb


def test_what_a_refused_command_asks_for_does_not_happen():
    for state in AxisState:
        for verb in (Verb.START, Verb.FOLLOW, Verb.RESET):
            rig = in_state(state)
            if rig.ask(verb) is not Reply.OK:
                assert rig.state_of("x") in (state, AxisState.OFF)  # a stop may have ended


def test_start_leads_to_idle_stop_to_off_reset_to_off():
    rig = still()
    rig.order(Verb.START, "x")
    assert rig.state_of("x") is AxisState.IDLE
    assert rig.driver.enable.tolist() == [1, 0]
    rig.order(Verb.STOP, "x")
    assert rig.state_of("x") is AxisState.OFF
    assert rig.driver.enable.tolist() == [0, 0]
    rig.order(Verb.ESTOP, "x")
    rig.order(Verb.RESET, "x")
    assert rig.state_of("x") is AxisState.OFF
    assert rig.fault_of("x") is FaultCause.NONE


@pytest.mark.parametrize("bit", [Status.ENCODER_LOST, Status.AMPLIFIER_FAULT, Status.ESTOP])
def test_an_axis_whose_device_is_faulty_neither_starts_nor_resets(bit):
    rig = still(with_axes(gantry(), ["x"], homing=homed_by("switch")))
    rig.driver.status[0] = bit
    assert rig.ask(Verb.START) is Reply.STILL_FAULTY
    assert rig.ask(Verb.HOME) is Reply.STILL_FAULTY
    assert rig.state_of("x") is AxisState.OFF
    rig.driver.status[0] = 0
    rig.order(Verb.START, "x")
    rig.driver.status[0] = bit
    rig.advance(1)
    assert rig.ask(Verb.RESET) is Reply.STILL_FAULTY
    assert rig.state_of("x") is AxisState.FAULT
    rig.driver.status[0] = 0
    assert rig.ask(Verb.RESET) is Reply.OK
    assert rig.ask(Verb.START) is Reply.OK


def test_a_program_that_does_not_begin_where_the_axis_stands_is_refused():
    rig = still()
    rig.order(Verb.START, "x")
    segments = point_to_point(0.1, 0.2, 0.5, 5.0, 500.0).segments
    slot = rig.memory.load_program(0, segments)
    assert rig.ask(Verb.FOLLOW, slot=slot) is Reply.NOT_AT_START
    assert rig.state_of("x") is AxisState.IDLE


def test_a_start_tick_that_has_passed_is_refused():
    rig = still()
    rig.order(Verb.START, "x")
    slot = rig.memory.load_program(0, point_to_point(0.0, 0.1, 0.5, 5.0, 500.0).segments)
    assert rig.ask(Verb.FOLLOW, slot=slot, tick=rig.ticks - 1) is Reply.LATE
    assert rig.ask(Verb.FOLLOW, slot=slot, tick=rig.ticks) is Reply.OK


def test_numbers_of_axes_and_slots_that_there_are_not_are_refused():
    rig = still()
    rig.order(Verb.START, "x")
    for axis in (-1, 2, 1 << 40):
        number = rig.memory.post(Verb.START, axis)
        rig.advance(1)
        assert rig.memory.reply(number) is Reply.WRONG_STATE
    for slot in (-1, 2, 1 << 40):
        assert rig.ask(Verb.FOLLOW, slot=slot) is Reply.WRONG_STATE


def test_commands_are_taken_in_their_order_all_in_one_tick():
    rig = still()
    numbers = [rig.memory.post(verb, axis) for axis in (0, 1) for verb in (Verb.START, Verb.STOP)]
    numbers.append(rig.memory.post(Verb.START, 0))
    rig.advance(1)
    answers = [rig.memory.reply(number) for number in numbers]
    # Each stop found an axis without a law and disabled it at once, so the last start is one, too.
    assert answers == [Reply.OK] * 5
    assert rig.driver.enable.tolist() == [1, 0]


def test_a_mailbox_that_is_full_says_so_and_still_takes_an_emergency_stop():
    rig = still()
    for _ in range(60):
        rig.memory.post(Verb.STOP, 0)
    with pytest.raises(BufferError, match="60 commands"):
        rig.memory.post(Verb.STOP, 0)
    stops = [rig.memory.post(Verb.ESTOP) for _ in range(4)]
    with pytest.raises(BufferError, match="64 commands"):
        rig.memory.post(Verb.ESTOP)
    rig.advance(1)
    assert rig.state_of("x") is AxisState.FAULT
    assert {rig.memory.reply(number) for number in stops} == {Reply.OK}
    rig.memory.post(Verb.STOP, 0)


def test_two_axes_live_apart():
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        assert rig.state_of("y") is AxisState.OFF
        rig.order(Verb.START, "y")
        rig.move("x", 0.1)
        rig.seconds(0.05)
        assert rig.state_of("y") is AxisState.IDLE
        rig.order(Verb.STOP, "y")
        rig.seconds(0.5)
        assert rig.state_of("y") is AxisState.OFF
        assert rig.state_of("x") is AxisState.IDLE
        assert rig.last("x")["position_m"] == pytest.approx(0.1, abs=5e-6)
        assert rig.last("y")["command_v"] == 0.0


def test_a_program_is_followed_from_its_start_tick_to_its_end():
    with Rig(with_sim(gantry())) as rig:
        rig.start()
        trajectory = point_to_point(0.0, 0.1, 0.5, 5.0, 500.0)
        slot = rig.memory.load_program(0, trajectory.segments)
        first = rig.ticks + 40
        rig.order(Verb.FOLLOW, "x", slot=slot, tick=first)
        rig.seconds(trajectory.duration_s + 0.1)
        rows = rig.rows("x")
        time_s = (np.arange(len(rows)) - first) * TS
        x, v, a = trajectory.sample(time_s)
        assert np.abs(rows["reference_m"] - x).max() < 1e-12
        moving = rows["state"] == AxisState.RUNNING
        assert np.abs(rows["reference_velocity_m_s"] - v).max() < 1e-9
        assert np.abs(rows["reference_acceleration_m_s2"] - a)[moving].max() < 1e-6
        last = int(np.nonzero(moving)[0][-1])
        assert first + trajectory.duration_s / TS - last == pytest.approx(0.5, abs=0.6)
        assert rig.state_of("x") is AxisState.IDLE
        assert rig.state("x")["slot"] == -1


def test_axes_that_start_together_are_in_step():
    with Rig(with_sim(gantry())) as rig:
        rig.start()
        same = point_to_point(0.0, 0.1, 0.3, 5.0, 500.0)
        rig.follow({"x": same, "y": same})
        rig.seconds(0.3)
        assert (rig.rows("x")["reference_m"] == rig.rows("y")["reference_m"]).all()


def test_a_program_without_duration_ends_in_the_tick_in_which_it_begins():
    rig = still()
    rig.order(Verb.START, "x")
    slot = rig.memory.load_program(0, Trajectory.at_rest(0.0).segments)
    assert rig.ask(Verb.FOLLOW, slot=slot) is Reply.OK
    assert rig.state_of("x") is AxisState.IDLE


def test_the_row_and_the_status_tell_the_same():
    with Hand(with_sim(gantry())) as hand:
        hand.step()
        hand.ask(Verb.START)
        hand.follow("x", point_to_point(0.0, 0.1, 0.3, 5.0, 500.0))
        hand.steps(200)
        status, row = hand.status(), hand.row()
        for name in ("state", "fault", "position_m", "velocity_m_s", "reference_m", "command_v"):
            assert status[name] == row[name]
        assert (status["theta_hat"] == row["theta_hat"]).all()
        assert row["flags"] & SampleFlag.HOMED
        assert row["following_error_m"] == row["position_m"] - row["reference_m"]
