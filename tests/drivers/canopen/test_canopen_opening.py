"""What `open` sets in a drive, and what it refuses in one line that names node, object and why."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from canopen_bench import data, driver, opened, peer_of
from canopen_peer import Drive

from motorctl.errors import RunError

pytestmark = pytest.mark.wall_clock(lanes=3)

TWO = {
    "x": {"node": 5, "rated_torque_v": 10.0},
    "y": {"node": 6, "rated_torque_v": 10.0},
}
NOT_MAPPABLE, NO_OBJECT, WRONG_STATE = 0x06040041, 0x06020000, 0x08000022


def refusal(prepare: Callable[[Drive], None], **given: object) -> str:
    """Return why a driver does not open with a drive that was changed."""
    chosen = data(**{"open_timeout_s": 0.3, **given})
    with peer_of(chosen) as peer:
        prepare(peer.drives[0])
        with pytest.raises(RunError) as no:
            driver(chosen).open()
    message = str(no.value)
    assert "\n" not in message
    assert "node 5 (axis x)" in message
    assert chosen["channel"] in message
    return message


def test_a_drive_is_set_up_as_the_options_say():
    inputs = {"limit_negative": 0, "limit_positive": 1}
    node = {"node": 5, "rated_torque_v": 10.0, "inputs": inputs}
    with opened(nodes={"x": node}, watchdog_s=0.5, heartbeat_s=0.25, host_node=100) as bench:
        written = bench.drive.node.sdo
        assert written[0x6060].raw == 10
        assert written[0x1016][1].raw == 100 << 16 | 500
        assert written[0x1017].raw == 250
        assert written[0x6007].raw == 1
        assert [written[0x1600][i].raw for i in range(3)] == [2, 0x60400010, 0x60710010]
        assert [written[0x1A00][i].raw for i in range(3)] == [2, 0x60410010, 0x60640020]
        assert [written[0x1A01][i].raw for i in range(2)] == [1, 0x60FD0020]
        assert written[0x1400][1].raw == 0x205
        assert written[0x1800][1].raw == 0x40000185
        assert [written[i][2].raw for i in (0x1400, 0x1800, 0x1801)] == [1, 1, 1]
        assert bench.drive.node.nmt.state == "OPERATIONAL"
        assert bench.driver.notes == ()


def test_commands_on_arrival_are_mapped_as_such_and_act_without_delay():
    with opened(command_at="arrival") as bench:
        assert bench.drive.node.sdo[0x1400][2].raw == 255
        assert bench.driver.exchange_delay_periods == 0.0
    assert driver(data()).exchange_delay_periods == 1.0


def test_what_nobody_asked_for_is_not_sent():
    with opened() as bench:
        assert bench.drive.node.sdo[0x1801][1].raw >> 31 == 1


def test_drives_boot_and_start_side_by_side():
    reset, start = 130, 1
    chosen = data(nodes=TWO)
    told = []
    with peer_of(chosen) as peer:
        peer.network.subscribe(0, lambda _id, sent, _time: told.append(tuple(sent)))
        made = driver(chosen)
        made.open()
        assert told == [(reset, 5), (reset, 6), (start, 5), (start, 6)]
        made.close()


def test_a_second_drive_that_does_not_start_is_named():
    chosen = data(nodes=TWO, open_timeout_s=0.2)
    with peer_of(chosen) as peer:
        peer.drives[1].silent = True
        with pytest.raises(RunError) as no:
            driver(chosen).open()
    assert "node 6 (axis y) sends no statusword with SYNC, within" in str(no.value)


def test_a_node_that_is_not_there_is_named():
    chosen = data(open_timeout_s=0.2)
    chosen["nodes"]["x"]["node"] = 6
    with peer_of(data(channel=chosen["channel"])), pytest.raises(RunError) as no:
        driver(chosen).open()
    assert "node 6 (axis x) did not report after its reset within open_timeout_s = 0.2" in str(
        no.value
    )


def test_a_device_that_is_no_drive_is_refused():
    def prepare(drive: Drive) -> None:
        drive.node.sdo[0x1000].raw = 0x00030191

    assert "device type (1000h) is 00030191h, profile 401" in refusal(prepare)


def test_a_drive_without_torque_mode_is_refused_with_the_modes_that_it_has():
    def prepare(drive: Drive) -> None:
        drive.node.sdo[0x6502].raw = 1 << 0 | 1 << 7

    told = refusal(prepare)
    assert "no cyclic synchronous torque" in told
    assert "profile position, cyclic synchronous position" in told


def test_a_mapping_that_the_drive_refuses_is_told_with_the_object_and_the_abort_in_words():
    def prepare(drive: Drive) -> None:
        drive.refused[0x1600, 0x60710010] = NOT_MAPPABLE

    told = refusal(prepare)
    assert "6071h:00 (target torque)" in told
    assert "1600h:02 (mapping of RPDO 1)" in told
    assert "the object cannot be mapped into a PDO (SDO abort 06040041h)" in told


def test_any_other_refusal_is_told_with_its_object():
    def prepare(drive: Drive) -> None:
        drive.refused[0x6060, 0] = WRONG_STATE

    told = refusal(prepare)
    assert "writing 0xa to 6060h:00 (mode of operation) was refused" in told
    assert "the drive's present state does not allow it (SDO abort 08000022h)" in told


def test_a_node_that_does_not_answer_sdo_is_told_with_what_was_asked():
    def prepare(drive: Drive) -> None:
        drive.node.network.unsubscribe(0x605)

    told = refusal(prepare)
    assert "reading 1000h:00 (device type): no answer within 0.3 s" in told


def test_a_drive_that_stays_in_another_mode_is_refused():
    def prepare(drive: Drive) -> None:
        drive.node.sdo[0x6061].raw = 8

    assert "stays in mode 8 (6061h)" in refusal(prepare)


def test_a_drive_in_fault_is_reset_by_opening_and_that_is_noted():
    chosen = data()
    with peer_of(chosen) as peer:
        peer.drives[0].trip(0x8130)
        made = driver(chosen)
        made.open()
        try:
            (note,) = made.notes
            assert "node 5 (axis x) was in Fault and was reset: error 8130h: life guard" in note
            assert peer.drives[0].state != "FAULT"
            assert not peer.drives[0].enabled
        finally:
            made.close()


def test_a_drive_whose_fault_cannot_be_reset_is_refused_with_its_code():
    def prepare(drive: Drive) -> None:
        drive.trip(0x3220)
        drive.stays_faulty = True

    told = refusal(prepare)
    assert "in Fault and cannot be reset: error 3220h: under voltage of the DC link" in told


def test_a_drive_that_cannot_say_what_it_does_without_motorctl_is_noted():
    chosen = data()
    with peer_of(chosen) as peer:
        peer.drives[0].refused[0x6007, 0] = NO_OBJECT
        made = driver(chosen)
        made.open()
        try:
            assert "has no 6007h:00 (abort connection option code)" in made.notes[0]
        finally:
            made.close()


def test_safe_tells_whether_the_bus_took_it() -> None:
    reached = driver(data())
    reached.safe()
    assert (reached.safe_sent, reached.safe_failed) == (True, "")
    absent = driver(data(interface="socketcan", channel="nocan7"))
    absent.safe()
    assert absent.safe_sent is False
    assert "socketcan channel 'nocan7' cannot be opened" in absent.safe_failed
