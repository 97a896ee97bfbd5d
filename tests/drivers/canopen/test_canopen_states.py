"""What the driver tells of a drive's states and faults, and how it leads it through them."""

from __future__ import annotations

import time

import can
import pytest
from canopen_bench import FAULT, opened
from canopen_peer import RATED_V

from motorctl.hal import Status, error_words
from motorctl.loop.faults import device_message

pytestmark = pytest.mark.wall_clock(lanes=3)

LOST, RESTARTED = Status.COMMUNICATION_LOST, Status.DEVICE_RESTARTED | Status.ENCODER_LOST


def test_a_disabled_drive_rests_in_ready_to_switch_on():
    with opened() as bench:
        bench.until(lambda: bench.drive.state == "READY TO SWITCH ON")
        bench.periods(5)
        assert bench.drive.state == "READY TO SWITCH ON"
        assert bench.status == 0


def test_enabling_goes_through_every_state_and_torque_acts_only_in_the_last():
    with opened() as bench:
        bench.until(lambda: bench.drive.state == "READY TO SWITCH ON")
        bench.drive.controlwords.clear()
        bench.drive.asked.clear()
        bench.enable(2.5)
        before = [torque for word, torque in bench.drive.asked if word != 0x0F]
        assert before == [0] * len(before)
        assert next(torque for word, torque in bench.drive.asked if word == 0x0F) == 0
        words = list(bench.drive.controlwords)
        assert sorted(set(words)) == [0x06, 0x07, 0x0F]
        assert words == sorted(words)
        assert bench.drive.torque == 2.5 / RATED_V * 1000


@pytest.mark.parametrize(("volts", "permille"), [(-5.0, -400), (1e9, 32767), (-1e9, -32767)])
def test_volts_become_thousandths_of_the_rated_torque_and_never_wrap(volts, permille):
    with opened() as bench:
        bench.enable(volts)
        assert bench.drive.torque == permille


def test_disabling_takes_the_voltage_at_once():
    with opened(command_at="arrival") as bench:
        bench.enable(2.5)
        bench.ask(2.5, 0)
        bench.period()
        bench.until(lambda: not bench.drive.enabled)
        assert 0x00 in list(bench.drive.controlwords)[-2:]
        assert bench.drive.torque == 0
        bench.until(lambda: bench.drive.state == "READY TO SWITCH ON")
        assert bench.status == 0


def test_a_drive_that_is_disabled_and_enabled_again_at_once_is_no_fault():
    with opened() as bench:
        bench.drive.tells_late = 2
        for gap in range(1, 6):
            bench.enable(1.0)
            bench.ask(1.0, 0)
            bench.periods(gap)
            bench.ask(1.0, 1)
            for _ in range(30):
                bench.period()
                assert not bench.status & FAULT
            assert bench.drive.enabled


def test_a_fault_of_the_drive_is_told_with_the_code_of_its_emergency_message():
    with opened() as bench:
        bench.enable(1.0)
        bench.drive.trip(0x2310)
        bench.period()
        assert bench.status & FAULT
        assert bench.code == 0x2310
        words = device_message(int(bench.inputs.status[0]))
        assert "error 2310h: continuous over current" in words


def test_a_fault_stays_until_it_is_cleared_and_then_the_drive_can_be_enabled_again():
    with opened() as bench:
        bench.enable(1.0)
        bench.drive.trip(0x4210)
        bench.ask(0.0, 0)
        bench.periods(20)
        assert bench.drive.state == "FAULT"
        assert bench.status & FAULT
        bench.driver.clear_fault(0)
        bench.until(lambda: bench.drive.state == "READY TO SWITCH ON")
        bench.periods(2)
        assert bench.status == 0
        assert bench.code == 0
        assert bench.drive.controlwords.count(0x80) >= 1
        bench.enable(1.0)


def test_a_fault_whose_reaction_is_under_way_is_reset_after_it():
    with opened() as bench:
        bench.drive.state = "FAULT REACTION ACTIVE"
        bench.period()
        assert bench.status & FAULT
        bench.driver.clear_fault(0)
        bench.until(lambda: bench.drive.state == "READY TO SWITCH ON")


def test_a_fault_whose_cause_lasts_stays():
    with opened() as bench:
        bench.drive.trip(0x4210)
        bench.drive.stays_faulty = True
        bench.driver.clear_fault(0)
        bench.periods(400)
        assert bench.status & FAULT
        assert bench.code == 0x4210
        assert bench.drive.controlwords[-1] == 0x00  # it does not press the button for ever


@pytest.mark.parametrize(
    ("state", "number"), [("QUICK STOP ACTIVE", 5), ("SWITCHED ON", 3), ("SWITCH ON DISABLED", 1)]
)
def test_a_drive_that_leaves_operation_enabled_by_itself_is_a_fault_at_once(state, number):
    with opened() as bench:
        bench.enable(1.0)
        bench.drive.stuck_in = state
        bench.drive.state = state
        bench.period()
        assert bench.status & FAULT
        assert "left Operation Enabled by itself" in error_words(bench.code)
        assert bench.code & 0xF == number
        bench.until(lambda: bench.drive.state == "SWITCH ON DISABLED")
        bench.periods(10)
        assert bench.status & FAULT  # as long as it is to be enabled
        assert not bench.drive.enabled
        bench.ask(0.0, 0)
        bench.until(lambda: not bench.status & FAULT)


def test_a_drive_that_is_not_enabled_in_time_is_a_fault_that_names_its_state():
    with opened(enable_timeout_s=0.05) as bench:
        bench.drive.stuck_in = "READY TO SWITCH ON"
        bench.ask(1.0, 1)
        bench.until(lambda: bool(bench.status & FAULT))
        words = error_words(bench.code)
        assert words == "it was not enabled in time and is in Ready to Switch On"


ON = "it was not disabled in time and is in Operation Enabled"


@pytest.mark.parametrize("started_again", [False, True])
def test_a_drive_that_stays_enabled_whatever_it_is_told_is_a_fault(started_again):
    with opened(enable_timeout_s=0.05) as bench:
        bench.enable(1.0)
        bench.drive.stays_on = True
        bench.ask(0.0, 0)
        for _ in range(20):  # of 25 that it has
            bench.period()
            assert not bench.status & FAULT
        if started_again:
            bench.ask(1.0, 1)
        bench.until(lambda: bool(bench.status & FAULT))
        assert error_words(bench.code) == ON
        bench.periods(5)
        assert bench.drive.asked[-1] == (0x00, 0)
        bench.drive.stays_on = False
        bench.ask(0.0, 0)
        bench.until(lambda: not bench.status & FAULT)
        bench.enable(1.0)


def test_a_drive_that_enables_itself_is_switched_off_and_a_fault_where_it_does_not_obey():
    with opened(enable_timeout_s=0.05) as bench:
        for obeys in (True, False):
            bench.until(lambda: bench.drive.state == "READY TO SWITCH ON")
            bench.drive.stays_on = not obeys
            bench.drive.state = "OPERATION ENABLED"
            for _ in range(20):
                bench.period()
                assert not bench.status & FAULT
            assert bench.drive.enabled != obeys
        bench.until(lambda: bool(bench.status & FAULT))
        assert error_words(bench.code) == ON


def test_a_drive_that_is_silent_while_it_is_disabled_is_stale_and_not_its_fault():
    with opened(enable_timeout_s=0.05, sync={"wait_s": 0.005}) as bench:
        bench.enable(1.0)
        bench.drive.silent = True
        bench.ask(0.0, 0)
        for _ in range(40):  # 25 is what it has
            bench.period()
            assert bench.status & ~Status.CORRUPT == Status.STALE
        bench.drive.silent = False
        bench.until(lambda: bench.drive.state == "READY TO SWITCH ON")
        assert not bench.status & FAULT


def test_a_quick_stop_that_is_active_is_left_before_the_drive_is_enabled_anew():
    with opened() as bench:
        bench.drive.state = "QUICK STOP ACTIVE"
        bench.periods(3)
        assert not bench.status & FAULT
        bench.enable(1.0)


def test_a_tpdo_that_does_not_come_is_stale_and_the_count_repeats():
    with opened(sync={"wait_s": 0.01}) as bench:
        bench.drive.position = 77
        bench.periods(2)
        bench.drive.silent = True
        bench.drive.position = 88
        bench.periods(5)
        assert bench.status == Status.STALE
        assert bench.inputs.counts[0] == 77
        bench.drive.silent = False
        bench.periods(5)
        assert bench.inputs.counts[0] == 88


def test_an_answer_nobody_asked_for_is_not_taken_for_a_sample():
    with opened(sync={"wait_s": 0.05}) as bench:
        bench.drive.position = 5
        bench.periods(2)
        stray = can.Message(arbitration_id=0x185, is_extended_id=False, data=b"\x21\0\7\0\0\0")
        bench.peer.network.bus.send(stray)
        time.sleep(0.02)
        bench.period()
        assert bench.status & Status.STALE
        assert bench.status & Status.CORRUPT
        assert bench.inputs.counts[0] == 5
        bench.periods(2)
        assert bench.status == 0


def test_missing_heartbeats_are_communication_lost_and_may_be_a_restart():
    with opened(heartbeat_s=0.05) as bench:
        bench.drive.node.nmt.stop_heartbeat()
        bench.until(lambda: bool(bench.status & LOST), 1.0)
        assert bench.status & RESTARTED == RESTARTED


def test_a_boot_up_message_is_a_restart_until_the_driver_is_opened_again():
    with opened() as bench:
        bench.drive.restart()
        bench.until(lambda: bench.status & RESTARTED == RESTARTED)
        bench.driver.close()
        bench.driver.open()
        bench.periods(3)
        assert bench.status == 0


def test_a_node_that_left_operational_is_started_again_when_its_fault_is_cleared():
    with opened(heartbeat_s=0.05) as bench:
        bench.drive.node.nmt.state = "PRE-OPERATIONAL"
        bench.until(lambda: bool(bench.status & LOST))
        assert not bench.status & RESTARTED
        bench.driver.clear_fault(0)
        bench.until(lambda: bench.status == 0)


def test_a_drive_switches_off_by_itself_when_motorctl_is_gone():
    with opened(watchdog_s=0.1) as bench:
        bench.enable(1.0)
        time.sleep(0.3)
        assert bench.drive.state == "FAULT"
        bench.period()
        assert bench.code == 0x8130


def test_a_drive_that_was_closed_waits_for_no_heartbeat():
    with opened(watchdog_s=0.1) as bench:
        bench.enable(1.0)
        bench.driver.close()
        time.sleep(0.3)
        assert bench.drive.state == "SWITCH ON DISABLED"


def test_digital_inputs_are_limit_and_home_switches():
    inputs = {"limit_negative": 0, "limit_positive": 1, "home_switch": 2}
    nodes = {"x": {"node": 5, "rated_torque_v": 10.0, "inputs": inputs}}
    with opened(nodes=nodes) as bench:
        bench.drive.inputs = 0b101
        bench.periods(2)
        assert bench.status == Status.LIMIT_NEGATIVE | Status.HOME_SWITCH
        bench.drive.inputs = 0b010
        bench.periods(2)
        assert bench.status == Status.LIMIT_POSITIVE


def test_inverted_inputs_are_pressed_where_the_drive_tells_0():
    inputs = {"limit_negative": 3, "inverted": True}
    nodes = {"x": {"node": 5, "rated_torque_v": 10.0, "inputs": inputs}}
    with opened(nodes=nodes) as bench:
        assert bench.status == Status.LIMIT_NEGATIVE
        bench.drive.inputs = 1 << 3
        bench.periods(2)
        assert bench.status == 0


def test_a_drive_tells_that_it_gives_no_torque_until_it_is_enabled():
    with opened() as bench:
        assert bench.inputs.status[0] & Status.UNPOWERED
        bench.enable(1.0)
        assert not bench.inputs.status[0] & Status.UNPOWERED
        bench.ask(0.0, 0)
        bench.until(lambda: bool(bench.inputs.status[0] & Status.UNPOWERED))
