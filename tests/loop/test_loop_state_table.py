"""Every line of the table of states is walked, nothing else is, and outputs are as it says."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from state_walk import FROZEN, OWN, Walk

from motorctl.hal import Status
from motorctl.loop import Reply
from motorctl.loop.states import POWERED, STOPPING, TRANSITIONS, Event, State

COMMANDS = (Event.START, Event.STOP, Event.HOME, Event.FOLLOW, Event.RESET, Event.ESTOP)
GUARDS = (Event.QUICK_STOP, Event.TRIP)
TABLE = {(state, line.event): line.after for line in TRANSITIONS for state in line.before}
CALM = [event for event in Event if event not in (*COMMANDS, *GUARDS)]


def words(value: State | Event) -> str:
    return value.name.lower().replace("_", "-")


def walk_for(state: State, event: Event) -> Walk:
    """Return an axis whose homing lets both be; it stands."""
    homes = event is Event.HOME or state is State.HOMING
    return Walk("index" if homes else "absolute")


@pytest.mark.parametrize(("state", "event"), TABLE, ids=words)
def test_every_line_of_the_table_is_walked(state: State, event: Event) -> None:
    with walk_for(state, event) as walk:
        walk.lead_to(state)
        after = TABLE[state, event]
        if event in COMMANDS:
            if state is not State.SWITCHED_ON:
                walk.until_own_tick_is_over()
            assert walk.command(event) is Reply.OK
        else:
            walk.cause(event)
            if after is State.SWITCH_ON_DISABLED and event is Event.AT_REST:
                after = State.READY_TO_SWITCH_ON  # nothing stands against it: in the same tick
        assert walk.state is after


REFUSED = [(s, c) for s in State for c in COMMANDS if (s, c) not in TABLE]


@pytest.mark.parametrize(("state", "command"), REFUSED, ids=words)
def test_a_command_without_a_line_is_refused_and_changes_nothing(
    state: State, command: Event
) -> None:
    with walk_for(state, command) as walk:
        walk.lead_to(state)
        if state is not State.SWITCHED_ON:
            walk.until_own_tick_is_over()
        assert walk.command(command) not in (Reply.OK, None)
        assert walk.state is state


def reachable(states: set[State], events: Iterable[Event]) -> set[State]:
    """Return all states to which these events may lead, any number of them in any order."""
    found = set(states)
    while True:
        more = {TABLE[s, e] for s in found for e in events if (s, e) in TABLE} - found
        if not more:
            return found
        found |= more


troubles = [
    0,
    *(Status.ENCODER_LOST, Status.AMPLIFIER_FAULT, Status.ESTOP, Status.STALE),
    *(Status.LIMIT_POSITIVE, Status.LIMIT_NEGATIVE, Status.INDEX_LATCHED, Status.HOME_SWITCH),
]
happenings = st.one_of(
    st.tuples(st.just("commands"), st.lists(st.sampled_from(COMMANDS), min_size=1, max_size=3)),
    # Often all that a way forward needs, so that walks come further than to the first refusal.
    st.tuples(st.just("commands"), st.sampled_from([[Event.RESET, Event.START], [Event.FOLLOW]])),
    st.tuples(st.just("report"), st.sampled_from(troubles)),
    st.tuples(st.just("report"), st.just(0)),
    st.tuples(st.just("shove"), st.integers(-20000, 20000)),
    st.tuples(st.just("skip"), st.sampled_from([2, OWN, FROZEN])),
    st.tuples(st.just("run"), st.integers(1, 4 * OWN)),
    st.tuples(st.just("run"), st.just(FROZEN)),
)


def check_tick(
    walk: Walk, before: State, commands: list[Event], numbers: list[int], elapsed: int
) -> None:
    """Check that one tick went along lines of the table, and answered as it says."""
    now_s = walk.number * 0.2e-3
    tripped = float(walk.status()["fault_time_s"]) == pytest.approx(now_s, abs=1e-9)
    free = (*CALM, *GUARDS) if tripped or before is State.FAULT_REACTION_ACTIVE else CALM
    states = reachable({before}, free)
    for command, number in zip(commands, numbers, strict=True):
        if walk.memory.reply(number) is Reply.OK:
            states = {TABLE[s, command] for s in states if (s, command) in TABLE}
            assert states, f"{command.name} was obeyed in {before.name}"
        states = reachable(states, free)
    after = walk.state
    assert after in states, f"{before.name} to {after.name} on {[c.name for c in commands]}"
    if walk.number // OWN != (walk.number - elapsed) // OWN:  # else nothing was written
        assert bool(walk.driver.enable[0]) is (after in (*POWERED, *STOPPING))
        assert walk.driver.enable[0] or walk.driver.volts[0] == 0.0


@settings(max_examples=40)
@given(st.sampled_from(State), st.lists(happenings, min_size=1, max_size=30))
def test_whatever_comes_the_axis_walks_along_the_table(
    first: State, walked: list[tuple[str, object]]
) -> None:
    with Walk("index") as walk:
        walk.lead_to(first)
        for kind, value in walked:
            commands: list[Event] = []
            elapsed, ticks = 1, 1
            match kind, value:
                case "commands", list():
                    commands = value
                case "report", int():
                    walk.report(value)
                case "shove", int():
                    walk.driver.counts[0] += value
                case "skip", int():
                    elapsed = value
                case "run", int():
                    ticks = value
            numbers = [walk.post(command) for command in commands]
            for _ in range(ticks):
                before = walk.state
                walk.step(elapsed)
                check_tick(walk, before, commands, numbers, elapsed)
                commands, numbers = [], []


@pytest.mark.slow
@settings(max_examples=200)
@given(st.sampled_from(State), st.lists(happenings, min_size=1, max_size=30))
def test_on_many_more_ways_the_axis_walks_along_the_table(
    first: State, walked: list[tuple[str, object]]
) -> None:
    test_whatever_comes_the_axis_walks_along_the_table.hypothesis.inner_test(first, walked)
