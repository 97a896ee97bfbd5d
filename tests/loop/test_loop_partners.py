"""Axes that stop together: when one trips, its partners ramp down and tell for whom."""

import dataclasses

import numpy as np
import pytest
from loop_bench import TS, Rig, gantry, with_sim

from motorctl.daemon.axis_faults import faults_of
from motorctl.errors import RunError
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.motion import point_to_point

LOST = {"kind": "encoder_lost", "at_s": 1.2, "channel": 0}
ERROR = {"kind": "force_step", "at_s": 1.2, "channel": 0, "force_v": 30.0}


def machine_of(groups=None, *, fault=LOST):
    """Return the gantry whose x is hit at 1.2 s, with these groups."""
    return dataclasses.replace(with_sim(gantry(), faults=[fault]), stop_together=groups)


def on_the_ring(rig: Rig) -> None:
    """Let both axes run a circle; after 1.2 s both are on it."""
    rig.start()
    rig.follow_programs(["ring"])


def on_moves_of_their_own(rig: Rig) -> None:
    rig.start()
    rig.follow({axis: point_to_point(0.0, 0.4, 0.3, 5.0, 500.0) for axis in "xy"})


def ramped_down(rig: Rig, axis: str) -> None:
    """Check that the axis came to rest by its ramp, and in FAULT, enabled to the end."""
    rows = rig.rows(axis)
    stopping = rows[rows["state"] == AxisState.STOPPING]
    limits = rig.machine.axes[axis].limits
    assert len(stopping) > 0.02 / TS
    assert np.abs(stopping["reference_acceleration_m_s2"]).max() <= limits.max_acceleration_m_s2
    assert np.abs(np.diff(stopping["reference_velocity_m_s"])).max() < (
        limits.max_acceleration_m_s2 * TS * 1.001
    )
    assert np.abs(stopping["following_error_m"]).max() < 1e-3
    assert abs(stopping["reference_velocity_m_s"][-1]) < 0.01
    assert rig.state_of(axis) is AxisState.FAULT
    assert rig.last(axis)["command_v"] == 0.0


def test_the_axes_of_one_running_program_stop_together():
    with Rig(machine_of()) as rig:
        on_the_ring(rig)
        rig.seconds(1.5)
        assert rig.fault_of("x") is FaultCause.ENCODER_LOST
        assert rig.fault_of("y") is FaultCause.PARTNER
        ramped_down(rig, "y")


def test_a_partner_begins_its_ramp_in_the_tick_in_which_the_device_is_lost():
    with Rig(machine_of()) as rig:
        on_the_ring(rig)
        rig.seconds(1.5)
        first = {axis: int(np.argmax(rig.rows(axis)["fault"] != FaultCause.NONE)) for axis in "xy"}
        assert first["x"] == first["y"]


def test_a_partner_tells_the_axis_that_tripped_and_why():
    with Rig(machine_of(fault=ERROR)) as rig:
        on_the_ring(rig)
        rig.seconds(1.6)
        fault = faults_of(rig.machine, rig.memory.axis_status)["y"]
        assert fault["cause"] == "partner"
        assert fault["message"].startswith("partner x tripped: following error ")
        assert "limit 1" in fault["message"]
        assert fault["message"].endswith("`motorctl reset y` clears the fault")
        rig.order(Verb.RESET, "x")
        fault = faults_of(rig.machine, rig.memory.axis_status)["y"]
        assert fault["message"].startswith("partner x tripped, at 1.")


def test_a_simulation_that_ends_in_a_fault_tells_the_axis_that_tripped_first():
    with Rig(machine_of(fault={**LOST, "channel": 1})) as rig:
        on_the_ring(rig)
        rig.seconds(1.6)
        assert rig.fault_of("x") is FaultCause.PARTNER
        with pytest.raises(RunError, match=r"axis y tripped \(encoder_lost\)"):
            rig.raise_faults()


def test_axes_on_programs_of_their_own_do_not_stop_together():
    with Rig(machine_of()) as rig:
        rig.start()
        rig.follow_programs(["published_x", "published_y"])
        rig.seconds(1.5)
        assert rig.fault_of("x") is FaultCause.ENCODER_LOST
        assert rig.state_of("y") is AxisState.RUNNING


def test_an_axis_whose_program_has_ended_is_no_partner_of_it_any_more():
    with Rig(machine_of(fault={**LOST, "at_s": 6.0})) as rig:
        on_the_ring(rig)
        rig.seconds(6.2)
        assert rig.fault_of("x") is FaultCause.ENCODER_LOST
        assert rig.state_of("y") is AxisState.IDLE


def test_a_group_stops_together_whatever_its_axes_do():
    with Rig(machine_of((("x", "y"),))) as rig:
        on_moves_of_their_own(rig)
        rig.seconds(1.5)
        assert rig.fault_of("y") is FaultCause.PARTNER
        ramped_down(rig, "y")


def test_an_axis_of_the_group_that_holds_is_disabled_as_well_and_one_that_is_off_stays_off():
    for enabled in (True, False):
        with Rig(machine_of((("x", "y"),))) as rig:
            rig.order(Verb.START, "x")
            if enabled:
                rig.order(Verb.START, "y")
            rig.seconds(1.3)
            assert rig.fault_of("x") is FaultCause.ENCODER_LOST
            cause = FaultCause.PARTNER if enabled else FaultCause.NONE
            assert rig.fault_of("y") is cause


def test_with_no_groups_every_axis_is_by_itself():
    with Rig(machine_of(())) as rig:
        on_the_ring(rig)
        rig.seconds(1.5)
        assert rig.fault_of("x") is FaultCause.ENCODER_LOST
        assert rig.state_of("y") is AxisState.RUNNING


def test_an_ordinary_stop_stops_one_axis():
    with Rig(machine_of((("x", "y"),), fault={**LOST, "at_s": 9.0})) as rig:
        on_the_ring(rig)
        rig.seconds(1.0)
        rig.order(Verb.STOP, "x")
        rig.seconds(0.5)
        assert rig.state_of("x") is AxisState.OFF
        assert rig.state_of("y") is AxisState.RUNNING


def test_a_partner_may_be_reset_and_moved_while_the_axis_that_tripped_is_not():
    with Rig(machine_of((("x", "y"),))) as rig:
        on_moves_of_their_own(rig)
        rig.seconds(1.5)
        assert rig.ask(Verb.RESET, "x") is Reply.STILL_FAULTY
        assert rig.ask(Verb.RESET, "y") is Reply.OK
        assert rig.ask(Verb.START, "y") is Reply.OK
        rig.seconds(0.1)
        assert rig.state_of("y") is AxisState.IDLE


def test_a_fault_during_the_ramp_disables_at_once_and_keeps_the_first_cause():
    machine = with_sim(gantry(), faults=[LOST, {**LOST, "at_s": 1.21, "channel": 1}])
    with Rig(machine) as rig:
        on_the_ring(rig)
        rig.seconds(1.2 - rig.ticks * TS + 0.005)
        assert rig.state_of("y") is AxisState.STOPPING
        rig.seconds(0.01)
        assert rig.state_of("y") is AxisState.FAULT
        assert rig.fault_of("y") is FaultCause.PARTNER
