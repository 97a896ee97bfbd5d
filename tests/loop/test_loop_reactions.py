"""The reaction of each guard: zero volts at once, or a ramp to rest before."""

import dataclasses

import numpy as np
import pytest
from loop_bench import TS, Hand, Rig, Still, changed, gantry, with_axes, with_driver, with_sim

from motorctl.config.guard_keys import Thermal
from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Verb
from motorctl.motion import point_to_point

QUICK = {"reaction": "quick_stop"}
NOW = {"reaction": "disable"}
RESOLUTION_M = 0.5e-6


def rig_of(guards, faults=(), plants=None, **limits) -> Rig:
    machine = with_sim(gantry(), faults=list(faults), plants=plants or {})
    return Rig(with_axes(machine, ["x"], limits=limits, guards=guards))


def stopping_rows(rig: Rig) -> np.ndarray:
    """Return the rows of x from the trip on, once the axis has come to rest."""
    rig.wait_until(lambda: rig.state_of("x") is AxisState.FAULT, 5.0)
    rows = rig.rows("x")
    return rows[rows["fault"] != FaultCause.NONE]


def assert_ramped_down(rig: Rig, cause: FaultCause) -> np.ndarray:
    """Check that x braked with its limits, enabled, from the trip to rest."""
    rows = stopping_rows(rig)
    assert set(rows["fault"]) == {cause}
    stopping = rows[rows["state"] == AxisState.STOPPING]
    assert len(stopping) > 20
    limits = rig.machine.axes["x"].limits
    assert np.abs(stopping["reference_acceleration_m_s2"]).max() <= limits.max_acceleration_m_s2
    assert abs(rows["velocity_m_s"][len(stopping) - 1]) < 0.02
    assert rig.last("x")["command_v"] == 0.0
    return stopping


def assert_disabled(rig: Rig, cause: FaultCause) -> None:
    rows = stopping_rows(rig)
    assert set(rows["fault"]) == {cause}
    assert (rows["state"] == AxisState.FAULT).all()
    assert (rows["command_v"] == 0.0).all()


SHOVE = {"kind": "force_step", "at_s": 0.3, "duration_s": 0.009, "channel": 0, "force_v": -22.0}


@pytest.mark.parametrize("reaction", [QUICK, NOW])
def test_an_axis_that_was_shoved_away_is_ramped_down_from_where_it_is(reaction):
    with rig_of({"following_error": reaction}, [SHOVE]) as rig:
        rig.start()
        rig.move("x", 0.4)
        rig.seconds(0.6)
        if reaction is NOW:
            assert_disabled(rig, FaultCause.FOLLOWING_ERROR)
            return
        stopping = assert_ramped_down(rig, FaultCause.FOLLOWING_ERROR)
        assert abs(stopping["following_error_m"][0]) < 1e-9  # the reference begins anew
        assert abs(rig.state("x")["fault_value"]) > 1e-3


def test_a_quick_stop_that_is_not_followed_either_disables_at_once():
    blocked = {**SHOVE, "duration_s": 1.0, "force_v": -40.0}
    with rig_of({"following_error": QUICK}, [blocked]) as rig:
        rig.start()
        rig.move("x", 0.4)
        rig.seconds(0.5)
        rows = stopping_rows(rig)
        stopping_s = (rows["state"] == AxisState.STOPPING).sum() * TS
        assert 0.0 < stopping_s < 0.1
        assert rig.fault_of("x") is FaultCause.FOLLOWING_ERROR
        assert (rows["command_v"][rows["state"] == AxisState.FAULT] == 0.0).all()


def still(guards, **limits) -> Rig:
    machine = with_axes(gantry(), ["x"], guards=guards, limits=limits)
    rig = Rig(with_driver(machine, Still))
    rig.tick.open(virtual=True)
    rig.start()
    return rig


def test_a_limit_switch_may_end_the_motion_by_a_ramp():
    rig = still(
        {"limit_switch": QUICK, "encoder_stuck": None}, following_error={"filter_time_s": 1e3}
    )
    rig.move("x", 0.4)
    rig.seconds(0.3)
    rig.driver.status[0] = Status.LIMIT_POSITIVE
    rig.seconds(0.5)
    stopping = rig.rows("x")
    stopping = stopping[stopping["state"] == AxisState.STOPPING]
    assert rig.fault_of("x") is FaultCause.LIMIT_SWITCH
    assert len(stopping) > 20
    assert np.diff(stopping["reference_velocity_m_s"]).max() <= 1e-9
    assert rig.driver.enable[0] == 0


def test_overspeed_may_be_braked():
    with rig_of({"overspeed": QUICK}) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 1.45, 30.0, 8000.0)})
        rig.seconds(0.15)
        rig.tick.settings["max_velocity_m_s"][0] = 1.0  # as if less had been allowed
        stopping = assert_ramped_down(rig, FaultCause.OVERSPEED)
        assert np.abs(stopping["following_error_m"]).max() < 1e-3


def test_a_soft_limit_may_be_braked_at():
    with rig_of({"soft_limit": QUICK}) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.4, 0.5, 30.0, 8000.0)})
        rig.seconds(0.3)
        rig.tick.settings["travel_high_m"][0] = 0.1
        rig.tick.axes["soft_high_m"][0] = 0.1
        assert_ramped_down(rig, FaultCause.SOFT_LIMIT)


def test_a_warm_motor_is_ramped_down_and_may_be_let_go_at_once():
    for reaction in ("quick_stop", "disable"):
        guard = Thermal(continuous_voltage_v=0.3, time_constant_s=0.5, reaction=reaction)
        with rig_of({"thermal": guard}) as rig:
            rig.start()
            rig.follow({"x": point_to_point(0.0, 0.4, 0.5, 30.0, 8000.0)})
            if reaction == "quick_stop":
                assert_ramped_down(rig, FaultCause.THERMAL)
            else:
                assert_disabled(rig, FaultCause.THERMAL)


def test_a_partner_may_be_let_go_at_once():
    fault = {"kind": "encoder_lost", "at_s": 0.3, "channel": 1}
    machine = with_axes(with_sim(gantry(), faults=[fault]), ["x"], guards={"partner": NOW})
    with Rig(dataclasses.replace(machine, stop_together=(("x", "y"),))) as rig:
        rig.start()
        rig.move("x", 0.4)
        assert_disabled(rig, FaultCause.PARTNER)


@pytest.mark.parametrize("guard", ["late_ticks", "supervisor_lost"])
@pytest.mark.parametrize("reaction", [QUICK, NOW])
def test_late_ticks_and_a_lost_supervisor_ramp_down_or_let_go(guard, reaction):
    machine = with_axes(with_sim(gantry()), ["x"], guards={guard: reaction})
    with Hand(changed(machine, loop={"overrun_policy": "stop"})) as hand:
        moving(hand)
        if guard == "late_ticks":
            hand.step(overran=True)
        else:
            hand.steps(2501, beat=False)
        wanted = AxisState.STOPPING if reaction is QUICK else AxisState.FAULT
        assert hand.status()["state"] == wanted
        cause = FaultCause.OVERRUN if guard == "late_ticks" else FaultCause.SUPERVISOR_LOST
        assert hand.status()["fault"] == cause


def moving(hand: Hand) -> None:
    hand.step()
    hand.tick.watch["bucket_size"] = 0
    hand.ask(Verb.START, "x")
    hand.follow("x", point_to_point(0.0, 0.4, 0.3, 5.0, 500.0))
    hand.steps(600)
    hand.tick.watch["bucket_size"] = 1


def test_a_computer_that_stood_still_may_be_answered_by_a_ramp_from_where_the_axis_is():
    machine = with_axes(with_sim(gantry()), ["x"], guards={"host_frozen": QUICK})
    with Hand(machine) as hand:
        moving(hand)
        hand.tick.watch["bucket_size"] = 0
        hand.step(round(0.1 / TS) + 2)
        assert hand.status()["state"] == AxisState.STOPPING
        assert hand.status()["fault"] == FaultCause.HOST_FROZEN
        assert abs(hand.row()["following_error_m"]) < 1e-9
        errors = []
        while hand.status()["state"] == AxisState.STOPPING:
            hand.step()
            errors.append(abs(hand.row()["following_error_m"]))
            assert len(errors) < 2000
        assert len(errors) > 20
        assert max(errors) < 1e-3
        assert abs(hand.row()["velocity_m_s"]) < 0.02


def test_a_trip_during_an_ordinary_stop_is_told():
    shove = {**SHOVE, "at_s": 0.32, "force_v": -40.0}
    with rig_of({"following_error": QUICK}, [shove]) as rig:
        rig.start()
        rig.move("x", 0.4)
        rig.seconds(0.3)
        rig.order(Verb.STOP, "x")
        rig.seconds(0.5)
        assert rig.state_of("x") is AxisState.FAULT
        assert rig.fault_of("x") is FaultCause.FOLLOWING_ERROR
