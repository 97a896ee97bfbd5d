"""Every safety rule fires, and in the tick in which it fires no voltage leaves any more."""

import numpy as np
import pytest
from loop_bench import TS, Rig, Still, changed, gantry, with_axes, with_driver, with_sim

from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.loop import Reply, Verb
from motorctl.loop.faults import lasting_words
from motorctl.motion import point_to_point

RESOLUTION_M = 0.5e-6
NO_FOLLOWING_ERROR = {"following_error": {"filter_time_s": 1e3}}
SLACK_M = 0.001
"""The published gantry's following error at rest, by which it may pass a soft limit."""


def still(guards=None, **limits) -> Rig:
    """Return the gantry on a device whose counts the test moves, both axes enabled at 0.2 m."""
    machine = with_axes(gantry(), limits=limits, guards=guards or {})
    rig = Rig(with_driver(machine, Still))
    rig.tick.open(virtual=True)
    rig.driver.counts[:] = round(0.2 / RESOLUTION_M)
    rig.start()
    return rig


def push(rig: Rig, metres_a_tick: list[float]) -> None:
    """Move the counts of x, a step a tick."""
    for step in metres_a_tick:
        rig.driver.counts[0] += round(step / RESOLUTION_M)
        rig.advance(1)


def assert_tripped(rig: Rig, axis: str, cause: FaultCause) -> None:
    """Check that the axis is in FAULT and that its first row there carries no voltage."""
    assert rig.fault_of(axis) is cause
    rows = rig.rows(axis)
    first = int(np.argmax(rows["state"] == AxisState.FAULT))
    assert rows["state"][first - 1] not in (AxisState.OFF, AxisState.FAULT)
    assert (rows["command_v"][first:] == 0.0).all()
    assert (rows["fault"][first:] == cause).all()
    number = rig.names.index(axis)
    if isinstance(rig.driver, Still):
        assert rig.driver.volts[number] == 0.0
        assert rig.driver.enable[number] == 0


STATUS_CAUSES = [
    (Status.ENCODER_LOST, FaultCause.ENCODER_LOST),
    (Status.COMMUNICATION_LOST, FaultCause.COMMUNICATION),
    (Status.AMPLIFIER_FAULT, FaultCause.AMPLIFIER),
    (Status.ESTOP, FaultCause.ESTOP),
]


@pytest.mark.parametrize(("bit", "cause"), STATUS_CAUSES)
def test_what_the_driver_reports_zeroes_the_voltage_within_one_tick(bit, cause):
    rig = still()
    push(rig, [1e-6] * 20)
    assert rig.last("x")["command_v"] != 0.0
    rig.driver.status[0] = bit
    rig.advance(1)
    assert_tripped(rig, "x", cause)
    assert rig.state_of("y") is AxisState.IDLE
    assert rig.driver.enable[1] == 1


@pytest.mark.parametrize(
    ("kind", "cause"),
    [
        ("encoder_lost", FaultCause.ENCODER_LOST),
        ("communication_lost", FaultCause.COMMUNICATION),
        ("amplifier_fault", FaultCause.AMPLIFIER),
        ("estop", FaultCause.ESTOP),
        ("encoder_jump", FaultCause.ENCODER_JUMP),
        ("encoder_stuck", FaultCause.ENCODER_STUCK),
        ("force_step", FaultCause.FOLLOWING_ERROR),
    ],
)
def test_a_fault_on_the_way_stops_its_axis_and_no_other(kind, cause):
    at_s = 0.3
    fault = {"kind": kind, "at_s": at_s, "channel": 0}
    fault |= {"encoder_jump": {"jump_m": 0.01}, "force_step": {"force_v": 30.0}}.get(kind, {})
    with Rig(with_sim(gantry(), faults=[fault])) as rig:
        rig.start()
        moves = {axis: point_to_point(0.0, 0.3, 0.5, 5.0, 500.0) for axis in "xy"}
        rig.follow(moves)
        rig.seconds(0.6)
        assert_tripped(rig, "x", cause)
        first = int(np.argmax(rig.rows("x")["state"] == AxisState.FAULT))
        # An error takes its time to grow.
        if cause not in (FaultCause.FOLLOWING_ERROR, FaultCause.ENCODER_STUCK):
            assert first == round(at_s / TS)
        assert rig.state_of("y") is AxisState.RUNNING
        assert abs(rig.last("y")["following_error_m"]) < 1e-4


def test_the_following_error_trips_once_it_lasts_longer_than_the_filter_time():
    minimum, per_velocity, filter_ticks = 0.001, 0.002, 10
    limit = {"minimum_m": minimum, "per_velocity_s": per_velocity}
    error = limit | {"filter_time_s": filter_ticks * TS}
    rig = still({"encoder_stuck": None}, following_error=error)
    rig.move("x", 0.4)  # the counts stand still: the reference runs away
    rig.seconds(0.2)
    assert_tripped(rig, "x", FaultCause.FOLLOWING_ERROR)
    rows = rig.rows("x")
    allowed = minimum + per_velocity * np.abs(rows["reference_velocity_m_s"])
    running = rows["state"] == AxisState.RUNNING
    beyond = running & (np.abs(rows["following_error_m"]) > allowed)
    assert beyond.sum() == filter_ticks
    assert allowed[beyond].min() > 1.2 * minimum  # the limit had grown with the speed
    status = rig.state("x")
    assert abs(status["fault_value"]) > status["fault_limit"]
    assert status["fault_limit"] == pytest.approx(allowed[beyond].max(), rel=0.05)


def test_a_following_error_shorter_than_the_filter_time_is_forgiven():
    rig = still(following_error={"minimum_m": 0.001, "filter_time_s": 10 * TS})
    for _ in range(3):
        push(rig, [0.0011, *[0.0] * 8, -0.0011, *[0.0] * 9])
    assert rig.state_of("x") is AxisState.IDLE


def test_overspeed_trips():
    rig = still(**NO_FOLLOWING_ERROR)  # 1.5 m/s may be exceeded by a fifth
    push(rig, [-1.85 * TS] * 10)
    assert_tripped(rig, "x", FaultCause.OVERSPEED)
    assert rig.state("x")["fault_value"] == pytest.approx(-1.85, rel=0.01)
    # 1.2 times the top speed, and two counts of 0.5 um a period.
    assert rig.state("x")["fault_limit"] == pytest.approx(1.8 + 2 * 0.5e-6 / TS)


def test_top_speed_does_not_trip_even_where_reads_are_late():
    rig = still(**NO_FOLLOWING_ERROR)
    speed = 1.45 * TS
    push(rig, [speed] * 50)
    # Late by 0.9 of a period, one read in two; then later and later, and on time again.
    push(rig, [1.9 * speed, 0.1 * speed] * 10)
    push(rig, [-1.24 * speed] * 4 + [-0.04 * speed] + [-speed] * 20)
    assert rig.state_of("x") is AxisState.IDLE


@pytest.mark.parametrize("side", [-1, 1])
def test_soft_limits_trip(side):
    rig = still(**NO_FOLLOWING_ERROR)
    end = 0.45 if side > 0 else -0.05
    push(rig, [side * 1.0 * TS] * round(abs(end - 0.2) / TS))
    push(rig, [side * 0.1 * SLACK_M] * 9)
    assert rig.state_of("x") is AxisState.IDLE
    push(rig, [side * 0.1 * SLACK_M] * 2)
    assert_tripped(rig, "x", FaultCause.SOFT_LIMIT)
    assert rig.state("x")["fault_limit"] == pytest.approx(end + side * SLACK_M)


def test_soft_limits_are_not_in_force_before_homing():
    machine = with_axes(gantry(), ["x"], limits=NO_FOLLOWING_ERROR, guards={"saturation": None})
    machine = with_axes(
        machine, ["x"], homing=changed(machine.axes["x"].homing, method="switch", timeout_s=9.0)
    )
    rig = Rig(with_driver(machine, Still))
    rig.tick.open(virtual=True)
    assert rig.ask(Verb.START) is Reply.OK
    push(rig, [1.0 * TS] * 3000)  # 0.6 m away
    assert rig.state_of("x") is AxisState.IDLE
    assert not rig.state("x")["homed"]


def test_an_axis_outside_its_travel_may_come_back_but_not_go_further():
    rig = still(**NO_FOLLOWING_ERROR)
    rig.ask(Verb.STOP)
    rig.driver.counts[0] = round(0.46 / RESOLUTION_M)
    rig.tick.axes["have_counts"][0] = 0  # as found at power-on
    rig.advance(1)
    assert rig.ask(Verb.START) is Reply.OK
    push(rig, [-0.5 * TS] * 50)  # 5 mm back
    assert rig.state_of("x") is AxisState.IDLE
    push(rig, [0.5 * TS] * 20)  # the way out again ends where it had come in to
    assert_tripped(rig, "x", FaultCause.SOFT_LIMIT)
    assert rig.state("x")["fault_value"] == pytest.approx(0.455 + SLACK_M, abs=2e-4)


@pytest.mark.parametrize(("bit", "side"), [(Status.LIMIT_POSITIVE, 1), (Status.LIMIT_NEGATIVE, -1)])
def test_a_limit_switch_stops_motion_towards_it_and_lets_motion_away_from_it(bit, side):
    for direction in (-side, side):
        rig = still(**NO_FOLLOWING_ERROR)
        rig.move("x", 0.2 + direction * 0.1)
        rig.driver.status[0] = bit
        rig.advance(50)
        if direction == side:
            assert_tripped(rig, "x", FaultCause.LIMIT_SWITCH)
        else:
            assert rig.state_of("x") is AxisState.RUNNING
            flag = SampleFlag.LIMIT_POSITIVE if side > 0 else SampleFlag.LIMIT_NEGATIVE
            assert rig.last("x")["flags"] & flag


@pytest.mark.parametrize("place", range(6))
def test_a_command_that_is_no_number_never_leaves(place):
    learned = [0.19, 0.25, 0.1, 0.0, -0.005, -0.0005]
    learned[place] = np.nan
    rig = Rig(with_driver(gantry(), Still), learned={"x": learned})
    rig.tick.open(virtual=True)
    rig.ask(Verb.START)
    assert rig.fault_of("x") is FaultCause.NOT_A_NUMBER
    assert rig.driver.volts[0] == 0.0
    assert rig.driver.enable[0] == 0
    assert (rig.rows("x")["command_v"] == 0.0).all()


@pytest.mark.parametrize("place", [("theta", 2), ("theta", 5), ("D", 0), ("U", (1, 4))])
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_an_axis_that_would_start_with_no_number_again_is_not_reset(place, wrong):
    field, index = place
    rig = held_with_no_number()
    record = rig.tick.laws[field][0]
    good = record[index]
    record[index] = wrong
    assert rig.ask(Verb.RESET) is Reply.CAUSE_LASTS
    assert rig.state_of("x") is AxisState.FAULT
    assert "new start of the daemon" in lasting_words(FaultCause.NOT_A_NUMBER)
    record[index] = good
    assert rig.ask(Verb.RESET) is Reply.OK


def test_an_axis_that_tripped_once_on_no_number_and_learned_none_is_reset_and_starts():
    rig = held_with_no_number()
    assert rig.ask(Verb.RESET) is Reply.OK
    rig.advance(1)
    assert rig.ask(Verb.START) is Reply.OK
    rig.advance(20)
    assert rig.state_of("x") is AxisState.IDLE


def test_what_was_learned_keeps_no_axis_from_the_reset_of_another_fault():
    rig = still()
    rig.order(Verb.ESTOP, "x")
    rig.tick.laws["theta"][0, 0] = np.nan
    assert rig.ask(Verb.RESET) is Reply.OK


def held_with_no_number():
    """Return a machine whose x has tripped on no number, though it has learned good ones."""
    rig = still()
    rig.tick.laws["d0"][0] = np.nan
    rig.advance(1)
    assert rig.fault_of("x") is FaultCause.NOT_A_NUMBER
    return rig


def test_a_jump_of_the_count_is_a_fault_and_no_position():
    rig = still()
    push(rig, [0.002])  # ten times what the axis can move in a tick
    assert_tripped(rig, "x", FaultCause.ENCODER_JUMP)
    assert rig.state("x")["fault_value"] == pytest.approx(0.002)


def test_the_software_emergency_stop_zeroes_every_axis_at_once():
    with Rig(with_sim(gantry())) as rig:
        rig.order(Verb.START, "x")
        rig.move("x", 0.3)
        rig.seconds(0.2)
        assert abs(rig.last("x")["command_v"]) > 0.0
        assert rig.ask(Verb.ESTOP) is Reply.OK
        assert_tripped(rig, "x", FaultCause.ESTOP)
        assert rig.state_of("y") is AxisState.FAULT  # it was off, and stays so until reset
        assert rig.fault_of("y") is FaultCause.ESTOP


def test_the_voltage_stays_within_its_limit_and_the_row_says_so():
    rig = still(max_voltage_v=3.0, **NO_FOLLOWING_ERROR)
    push(rig, list(np.tile([1e-3, -1e-3], 20)))
    rows = rig.rows("x")
    assert np.abs(rows["command_v"]).max() == 3.0
    saturated = (rows["flags"] & SampleFlag.SATURATED) != 0
    assert (saturated == (np.abs(rows["command_v"]) == 3.0)).all()


def test_the_first_cause_of_a_fault_is_kept():
    rig = still()
    rig.driver.status[0] = Status.AMPLIFIER_FAULT
    rig.advance(1)
    at = rig.state("x")["fault_time_s"]
    rig.driver.status[0] = Status.ESTOP | Status.ENCODER_LOST
    rig.advance(10)
    rig.ask(Verb.ESTOP)
    assert rig.fault_of("x") is FaultCause.AMPLIFIER
    assert rig.state("x")["fault_time_s"] == at
    assert at == pytest.approx(2 * TS)
