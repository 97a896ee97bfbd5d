"""An amplifier that takes time to be enabled: the law begins with its power, and no motion."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from loop_bench import Hand, Still, gantry, homed_by, with_axes, with_driver

from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.loop.states import State
from motorctl.motion import point_to_point

UNPOWERED = int(Status.UNPOWERED)
MOVED_COUNTS = 4000


@pytest.fixture
def hand() -> Iterator[Hand]:
    machine = with_axes(with_driver(gantry(), Still), homing=homed_by("index"))
    with Hand(machine) as one:
        one.driver.status[:] = UNPOWERED
        one.steps(3)
        yield one


def test_a_started_axis_is_enabled_and_waits_without_volts_where_it_is(hand: Hand):
    assert hand.ask(Verb.START) is Reply.OK
    for k in range(20):  # it sinks while its brake opens
        hand.driver.counts[0] = -k * MOVED_COUNTS // 20
        hand.step()
        assert hand.status()["inner_state"] == State.SWITCHED_ON
        assert (hand.driver.enable[0], hand.driver.volts[0]) == (1, 0.0)
        assert hand.row()["following_error_m"] == pytest.approx(0.0, abs=2e-4)
    hand.driver.status[:] = 0
    hand.step()
    assert hand.status()["inner_state"] == State.HOLDING
    assert abs(hand.driver.volts[0]) < 1.0  # it holds where it is, and is not pulled back
    held_m = float(hand.status()["reference_m"])
    hand.steps(5)
    assert hand.status()["reference_m"] == held_m


def test_nothing_moves_an_axis_that_has_no_power_yet(hand: Hand):
    assert hand.ask(Verb.HOME) is Reply.NOT_POWERED
    assert hand.status()["state"] == AxisState.OFF
    assert hand.ask(Verb.START) is Reply.OK
    assert hand.ask(Verb.HOME) is Reply.NOT_POWERED
    there = point_to_point(0.0, 0.1, 0.5, 5.0, 500.0)
    slot = hand.memory.load_program(0, there.segments)
    assert hand.ask(Verb.FOLLOW, slot=slot) is Reply.NOT_POWERED
    assert hand.status()["inner_state"] == State.SWITCHED_ON
    hand.driver.status[:] = 0
    hand.step()
    assert hand.ask(Verb.HOME) is Reply.OK
    assert hand.status()["state"] == AxisState.HOMING


def test_an_axis_that_waits_for_power_can_be_stopped_and_trips_as_any_other(hand: Hand):
    assert hand.ask(Verb.START) is Reply.OK
    assert hand.ask(Verb.STOP) is Reply.OK
    hand.steps(50)
    assert hand.status()["state"] == AxisState.OFF
    assert hand.ask(Verb.START) is Reply.OK
    hand.driver.status[0] = UNPOWERED | int(Status.AMPLIFIER_FAULT)
    hand.step()
    assert hand.status()["fault"] == FaultCause.AMPLIFIER
    assert hand.driver.enable[0] == 0
