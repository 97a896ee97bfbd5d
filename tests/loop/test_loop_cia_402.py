"""The table of states goes along the transitions of CiA 402 that it names, and along no others."""

from __future__ import annotations

import pytest
from state_walk import OWN, Walk

from motorctl.hal import Status
from motorctl.loop import Reply
from motorctl.loop.states import TRANSITIONS, DriveState, Event, State, Transition

D = DriveState
ANY = tuple(DriveState)
CIA_402 = {
    "2": ((D.SWITCH_ON_DISABLED,), D.READY_TO_SWITCH_ON),
    "3": ((D.READY_TO_SWITCH_ON,), D.SWITCHED_ON),
    "4": ((D.SWITCHED_ON,), D.OPERATION_ENABLED),
    "5": ((D.OPERATION_ENABLED,), D.SWITCHED_ON),
    "6": ((D.SWITCHED_ON,), D.READY_TO_SWITCH_ON),
    "7": ((D.READY_TO_SWITCH_ON,), D.SWITCH_ON_DISABLED),
    "8": ((D.OPERATION_ENABLED,), D.READY_TO_SWITCH_ON),
    "9": ((D.OPERATION_ENABLED,), D.SWITCH_ON_DISABLED),
    "10": ((D.SWITCHED_ON,), D.SWITCH_ON_DISABLED),
    "11": ((D.OPERATION_ENABLED,), D.QUICK_STOP_ACTIVE),
    "12": ((D.QUICK_STOP_ACTIVE,), D.SWITCH_ON_DISABLED),
    "13": (ANY, D.FAULT_REACTION_ACTIVE),
    "14": ((D.FAULT_REACTION_ACTIVE,), D.FAULT),
    "15": ((D.FAULT,), D.SWITCH_ON_DISABLED),
    "16": ((D.QUICK_STOP_ACTIVE,), D.OPERATION_ENABLED),
}
"""Between the states that motorctl has; 0 and 1 are a drive's own way up to the first of them."""
NOT_GONE = {"5", "6", "8", "9", "16"}
"""Which docs/states.md says of."""


@pytest.mark.parametrize(
    ("before", "line"),
    [(state, line) for line in TRANSITIONS for state in line.before],
    ids=lambda part: part.name.lower() if isinstance(part, State) else part.event.name.lower(),
)
def test_each_line_goes_along_the_transitions_that_it_names(
    before: State, line: Transition
) -> None:
    drive = before.drive
    for number in filter(None, line.number.split(", ")):
        begins, ends = CIA_402[number]
        assert drive in begins, f"transition {number} does not begin in {drive.name}"
        drive = ends
    assert drive is line.after.drive


def test_all_transitions_are_gone_but_those_that_the_page_names() -> None:
    gone = {number for line in TRANSITIONS for number in line.number.split(", ") if number}
    assert gone == set(CIA_402) - NOT_GONE


def test_a_stop_before_a_slow_axis_had_its_tick_never_enables_it() -> None:
    with Walk() as walk:
        walk.lead_to(State.SWITCHED_ON)
        assert walk.command(Event.STOP) is Reply.OK
        assert walk.state is State.SWITCH_ON_DISABLED
        for _ in range(3 * OWN):
            walk.step()
            assert (walk.driver.enable[0], walk.driver.volts[0]) == (0, 0.0)
        assert walk.state is State.READY_TO_SWITCH_ON
        assert walk.command(Event.START) is Reply.OK


def test_a_stop_while_an_axis_waits_for_power_disables_it_with_its_next_write() -> None:
    with Walk() as walk:
        walk.report(Status.UNPOWERED)
        walk.until_own_tick_is_over()
        assert walk.command(Event.START) is Reply.OK
        walk.until_own_tick_is_over()
        walk.steps(1)
        assert walk.state is State.SWITCHED_ON
        assert walk.driver.enable[0] == 1
        assert walk.command(Event.STOP) is Reply.OK
        assert walk.state is State.SWITCH_ON_DISABLED
        walk.until_own_tick_is_over()
        assert walk.driver.enable[0] == 0
