"""Two faults in one tick: the axis is let go in it where either asks for that, and tells one."""

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from loop_bench import Hand, Still, changed, gantry, with_axes, with_driver

from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.motion import point_to_point

RAMP = {"reaction": "quick_stop"}
PATIENT = {"filter_time_s": 1e3}
PAUSE_TICKS = 600


def _nothing(_hand: Hand) -> None:
    pass


@dataclass(frozen=True)
class Event:
    """What goes wrong, and whether a ramp is its reaction here."""

    cause: FaultCause
    happens: Callable[[Hand], Any] = _nothing
    tick: dict[str, Any] = field(default_factory=dict)
    ramps: bool = False


def report(bit: Status) -> Callable[[Hand], None]:
    def happens(hand: Hand) -> None:
        hand.driver.status[0] |= bit

    return happens


def jump(hand: Hand) -> None:
    hand.driver.counts[0] += 10**6


def lose_a_number(hand: Hand) -> None:
    hand.tick.laws["theta"][0, 0] = np.nan


EVENTS = {
    "encoder lost": Event(FaultCause.ENCODER_LOST, report(Status.ENCODER_LOST)),
    "amplifier": Event(FaultCause.AMPLIFIER, report(Status.AMPLIFIER_FAULT)),
    "device lost": Event(FaultCause.COMMUNICATION, report(Status.COMMUNICATION_LOST)),
    "emergency chain": Event(FaultCause.ESTOP, report(Status.ESTOP)),
    "jump": Event(FaultCause.ENCODER_JUMP, jump),
    "no number": Event(FaultCause.NOT_A_NUMBER, lose_a_number),
    "estop": Event(FaultCause.ESTOP, lambda hand: hand.memory.post(Verb.ESTOP, 0)),
    "switch": Event(FaultCause.LIMIT_SWITCH, report(Status.LIMIT_POSITIVE), ramps=True),
    "late tick": Event(FaultCause.OVERRUN, tick={"overran": True}, ramps=True),
    "pause": Event(FaultCause.HOST_FROZEN, tick={"elapsed": PAUSE_TICKS}, ramps=True),
}
PAIRS = list(combinations(EVENTS, 2))


@pytest.fixture
def hand() -> Iterator[Hand]:
    """Return the gantry whose x is on its way; its counts stand still."""
    guards = {"limit_switch": RAMP, "host_frozen": RAMP, "encoder_stuck": None}
    machine = with_axes(gantry(), ["x"], limits={"following_error": PATIENT}, guards=guards)
    loop = changed(machine.loop, overrun_policy="stop")
    with Hand(with_driver(dataclasses.replace(machine, loop=loop), Still)) as hand:
        hand.steps(3)
        assert hand.ask(Verb.START) is Reply.OK
        hand.follow("x", point_to_point(0.0, 0.4, 0.5, 5.0, 500.0))
        hand.steps(120)
        assert hand.driver.volts[0] != 0.0
        yield hand


@pytest.mark.parametrize(("one", "other"), PAIRS, ids=[f"{one} and {two}" for one, two in PAIRS])
def test_an_axis_is_let_go_in_the_tick_in_which_either_of_two_faults_asks_for_it(
    hand: Hand, one: str, other: str
) -> None:
    both = EVENTS[one], EVENTS[other]
    for event in both:
        event.happens(hand)
    hand.step(**both[0].tick, **both[1].tick)
    status = hand.status()
    cause = FaultCause(int(status["fault"]))
    assert cause in {event.cause for event in both}
    if all(event.ramps for event in both):
        assert status["state"] == AxisState.STOPPING
        assert hand.driver.enable[0] == 1
    else:
        assert status["state"] == AxisState.FAULT
        assert (hand.driver.volts[0], hand.driver.enable[0]) == (0.0, 0)
    hand.steps(200)
    assert hand.status()["state"] == AxisState.FAULT
    assert hand.status()["fault"] == cause  # the first one stays
    assert (hand.driver.volts[0], hand.driver.enable[0]) == (0.0, 0)
    assert hand.status("y")["fault"] in (FaultCause.NONE, FaultCause.ESTOP)
