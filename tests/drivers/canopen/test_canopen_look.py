"""`init --from devices` on a CANopen bus: every drive that answers, and nothing changed."""

from __future__ import annotations

import pytest
from canopen_bench import data, peer_of

from motorctl.errors import RunError
from motorctl_canopen import CanopenDriver

pytestmark = pytest.mark.wall_clock(lanes=3)

TWO = {
    "x": {"node": 5, "rated_torque_v": 10.0},
    "y": {"node": 9, "rated_torque_v": 10.0},
}


def test_every_drive_that_answers_is_found_by_its_number_and_left_as_it_is():
    chosen = data(nodes=TWO)
    with peer_of(chosen) as peer:
        before = [drive.state for drive in peer.drives]
        found = CanopenDriver.look({key: chosen[key] for key in ("interface", "channel")})
        assert [drive.state for drive in peer.drives] == before
        assert not any(drive.controlwords for drive in peer.drives)
    assert [axis.channel + 1 for axis in found.axes] == [5, 9]
    assert {axis.counter_bits for axis in found.axes} == {32}
    assert all("profile 402" in axis.remarks[0] for axis in found.axes)


def test_a_bus_on_which_nothing_answers_is_told_with_its_name():
    with pytest.raises(RunError, match=r"channel 'nobody': no node from 1 to 127 answered"):
        CanopenDriver.look({"interface": "virtual", "channel": "nobody"})
