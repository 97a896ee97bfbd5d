"""The axis' state machine in the words of CiA 402: one table says what leads from where to where.

The loop changes an axis' state through `take` alone, which looks the table up; the words of a
refusal and `docs/states.md` with its drawing (`tools/draw_states.py`) are made from it, too. What
status and log tell as `state` is an `AxisState`, as ever; the state of CiA 402 stands beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.kernels import inner_kernel
from motorctl.log.sample import AxisState


class DriveState(IntEnum):
    """States of a drive as CiA 402 names them."""

    SWITCH_ON_DISABLED = 0
    READY_TO_SWITCH_ON = 1
    SWITCHED_ON = 2
    OPERATION_ENABLED = 3
    QUICK_STOP_ACTIVE = 4
    FAULT_REACTION_ACTIVE = 5
    FAULT = 6


class State(IntEnum):
    """States of an axis in the loop: those of CiA 402, and what it does while it is enabled."""

    SWITCH_ON_DISABLED = 0
    """Off, and it may not be enabled: its device is not ready, or it moves."""
    READY_TO_SWITCH_ON = 1
    """Off, and it may be enabled."""
    SWITCHED_ON = 2
    """Started; amplifier and law begin with the axis' next tick, in the same write."""
    HOLDING = 3
    HOMING = 4
    FOLLOWING = 5
    QUICK_STOP_ACTIVE = 6
    """It ramps down because it was told to, and is then off."""
    FAULT_REACTION_ACTIVE = 7
    """It ramps down because a guard tripped, and is then in fault."""
    FAULT = 8

    @property
    def told(self) -> AxisState:
        """What status and log tell as `state`."""
        return _MEANING[self][0]

    @property
    def drive(self) -> DriveState:
        """The state of CiA 402."""
        return _MEANING[self][1]


class Event(IntEnum):
    """What may change an axis' state; commands have the numbers of their verbs."""

    START = 1
    STOP = 2
    HOME = 3
    FOLLOW = 4
    RESET = 5
    ESTOP = 6
    READY = 7
    NOT_READY = 8
    LAW_BEGINS = 9
    HOMED = 10
    PROGRAM_ENDS = 11
    AT_REST = 12
    QUICK_STOP = 13
    TRIP = 14

    @property
    def words(self) -> str:
        """What a reader of table and drawing is told."""
        return _EVENT_WORDS.get(self, self.name.lower())


@dataclass(frozen=True)
class Transition:
    """One line of the table: in any of these states, an event leads to that state."""

    before: tuple[State, ...]
    event: Event
    after: State
    number: str = ""
    """Of the transitions in CiA 402 that it goes through; empty: the drive's state stays."""
    only_if: str = ""
    """What the loop asks besides, in words."""


_S, _E = State, Event
OPERATION = (_S.HOLDING, _S.HOMING, _S.FOLLOWING)
"""All that CiA 402 calls "operation enabled"."""
POWERED = (_S.SWITCHED_ON, *OPERATION)
"""Enabled, and not being stopped."""
STOPPING = (_S.QUICK_STOP_ACTIVE, _S.FAULT_REACTION_ACTIVE)
OFF = (_S.SWITCH_ON_DISABLED, _S.READY_TO_SWITCH_ON)

_HOMED = "homed, and the program begins where the axis stands"
_HAS_HOMING = "the encoder is not absolute"
_HAS_POWER = "the device does not say that it is still without power"

TRANSITIONS = (
    Transition((_S.SWITCH_ON_DISABLED,), _E.READY, _S.READY_TO_SWITCH_ON, "2"),
    Transition((_S.READY_TO_SWITCH_ON,), _E.NOT_READY, _S.SWITCH_ON_DISABLED, "7"),
    Transition((_S.READY_TO_SWITCH_ON,), _E.START, _S.SWITCHED_ON, "3"),
    Transition(
        (_S.READY_TO_SWITCH_ON,), _E.HOME, _S.HOMING, "3, 4", f"{_HAS_HOMING}; {_HAS_POWER}"
    ),
    Transition((_S.SWITCHED_ON,), _E.LAW_BEGINS, _S.HOLDING, "4", _HAS_POWER),
    Transition((_S.SWITCHED_ON,), _E.HOME, _S.HOMING, "4", f"{_HAS_HOMING}; {_HAS_POWER}"),
    Transition((_S.SWITCHED_ON,), _E.FOLLOW, _S.FOLLOWING, "4", f"{_HOMED}; {_HAS_POWER}"),
    Transition((_S.HOLDING,), _E.HOME, _S.HOMING, "", _HAS_HOMING),
    Transition((_S.HOLDING,), _E.FOLLOW, _S.FOLLOWING, "", _HOMED),
    Transition((_S.HOMING,), _E.HOMED, _S.HOLDING),
    Transition((_S.FOLLOWING,), _E.PROGRAM_ENDS, _S.HOLDING),
    # No law leads it yet: there is nothing to ramp down.
    Transition((_S.SWITCHED_ON,), _E.STOP, _S.SWITCH_ON_DISABLED, "10"),
    Transition(OPERATION, _E.STOP, _S.QUICK_STOP_ACTIVE, "11"),
    Transition((_S.QUICK_STOP_ACTIVE,), _E.AT_REST, _S.SWITCH_ON_DISABLED, "12"),
    Transition((*POWERED, _S.QUICK_STOP_ACTIVE), _E.QUICK_STOP, _S.FAULT_REACTION_ACTIVE, "13"),
    Transition((_S.FAULT_REACTION_ACTIVE,), _E.AT_REST, _S.FAULT, "14"),
    Transition((*POWERED, _S.QUICK_STOP_ACTIVE), _E.TRIP, _S.FAULT, "13, 14"),
    Transition((_S.FAULT_REACTION_ACTIVE,), _E.TRIP, _S.FAULT, "14"),
    Transition((*OFF, *POWERED, _S.QUICK_STOP_ACTIVE), _E.ESTOP, _S.FAULT, "13, 14"),
    Transition((_S.FAULT_REACTION_ACTIVE,), _E.ESTOP, _S.FAULT, "14"),
    Transition((_S.FAULT,), _E.RESET, _S.SWITCH_ON_DISABLED, "15", "what tripped it is gone"),
    # Taken, and nothing is left to do: who wants an axis to stand need not look before.
    *(Transition((state,), _E.STOP, state) for state in (*OFF, *STOPPING)),
    Transition((_S.FAULT,), _E.ESTOP, _S.FAULT),
)
"""All that leads from one state to another; what does not stand here does not happen."""

_MEANING = {
    _S.SWITCH_ON_DISABLED: (AxisState.OFF, DriveState.SWITCH_ON_DISABLED),
    _S.READY_TO_SWITCH_ON: (AxisState.OFF, DriveState.READY_TO_SWITCH_ON),
    _S.SWITCHED_ON: (AxisState.IDLE, DriveState.SWITCHED_ON),
    _S.HOLDING: (AxisState.IDLE, DriveState.OPERATION_ENABLED),
    _S.HOMING: (AxisState.HOMING, DriveState.OPERATION_ENABLED),
    _S.FOLLOWING: (AxisState.RUNNING, DriveState.OPERATION_ENABLED),
    _S.QUICK_STOP_ACTIVE: (AxisState.STOPPING, DriveState.QUICK_STOP_ACTIVE),
    _S.FAULT_REACTION_ACTIVE: (AxisState.STOPPING, DriveState.FAULT_REACTION_ACTIVE),
    _S.FAULT: (AxisState.FAULT, DriveState.FAULT),
}
_EVENT_WORDS = {
    _E.FOLLOW: "move, program",
    _E.READY: "device ready, axis at rest",
    _E.NOT_READY: "no longer so",
    _E.LAW_BEGINS: "the law begins",
    _E.HOMED: "zero found",
    _E.PROGRAM_ENDS: "program ends",
    _E.AT_REST: "at rest",
    _E.QUICK_STOP: "guard: quick_stop",
    _E.TRIP: "guard: disable",
}
_SENTENCE = {AxisState.FAULT: "in fault"}
"""How a state is called after "axis x is", where that is not its name."""


def drive_words(state: DriveState) -> str:
    """Return the name of a state as CiA 402 writes it, such as "ready to switch on"."""
    return state.name.lower().replace("_", " ")


def state_words(state: State) -> str:
    """Return how a state is called in a sentence, with its name in CiA 402.

    Examples
    --------
    >>> state_words(State.FOLLOWING)
    'running (operation enabled)'
    """
    told, drive = state.told, drive_words(state.drive)
    words = _SENTENCE.get(told, told.name.lower())
    return words if drive == told.name.lower() else f"{words} ({drive})"


def possible_words(state: State, absolute: bool = False) -> str:
    """Return which commands a state obeys, in words; `estop` is always one of them.

    Parameters
    ----------
    state
        Of the axis.
    absolute
        Whether its encoder is: then there is nothing to home.
    """
    asked = (_E.START, _E.STOP, *(() if absolute else (_E.HOME,)), _E.FOLLOW, _E.RESET)
    commands = [
        line.event.words
        for event in asked
        for line in TRANSITIONS
        if line.event is event and state in line.before and line.after is not state
    ]
    if commands:
        return ", ".join(commands)
    if state is State.SWITCH_ON_DISABLED:
        ready = possible_words(State.READY_TO_SWITCH_ON, absolute)
        return f"nothing until its device is ready and it stands, then {ready}"
    return "nothing until it stands"


def _looked_up(transitions: Sequence[Transition]) -> NDArray[np.int64]:
    """Return the state after each state (rows) and event (columns); -1 where there is none."""
    after = np.full((len(State), max(Event) + 1), -1, np.int64)
    for line in transitions:
        for state in line.before:
            if after[state, line.event] >= 0:
                raise ValueError(f"{state.name}: two lines for {line.event.name}; keep one")
            after[state, line.event] = line.after
    return after


def _marked(states: Sequence[State]) -> NDArray[np.bool_]:
    return np.isin(np.arange(len(State)), states)


AFTER = _looked_up(TRANSITIONS)
TOLD = np.array([state.told for state in State], np.int64)
_IS_OFF, _IS_POWERED, _IS_STOPPING = _marked(OFF), _marked(POWERED), _marked(STOPPING)


@inner_kernel
def allows(axis: Any, event: int) -> bool:
    """Return whether the axis' state knows the event."""
    return AFTER[axis.state, event] >= 0  # type: ignore[no-any-return]


@inner_kernel
def take(axis: Any, event: int) -> bool:
    """Change the axis' state as the table says; return whether it knows the event there."""
    after = AFTER[axis.state, event]
    if after < 0:
        return False
    axis.state = after
    return True


@inner_kernel
def is_off(axis: Any) -> bool:
    """Return whether the axis is disabled, without a fault."""
    return _IS_OFF[axis.state]  # type: ignore[no-any-return]


@inner_kernel
def is_powered(axis: Any) -> bool:
    """Return whether the axis is enabled, and not being stopped."""
    return _IS_POWERED[axis.state]  # type: ignore[no-any-return]


@inner_kernel
def is_stopping(axis: Any) -> bool:
    """Return whether the axis ramps down, told to or for a fault."""
    return _IS_STOPPING[axis.state]  # type: ignore[no-any-return]


@inner_kernel
def is_enabled(axis: Any) -> bool:
    """Return whether the next write enables the axis' amplifier: stopping or not."""
    return _IS_POWERED[axis.state] or _IS_STOPPING[axis.state]  # type: ignore[no-any-return]
