"""What a refused command is answered: the axis' state, what is possible in it, what to do next."""

from __future__ import annotations

from motorctl.config.machine import Machine
from motorctl.daemon.protocol import Code, RefusedError
from motorctl.log.sample import FaultCause
from motorctl.loop import LoopMemory, Reply, Verb
from motorctl.loop.axis_records import STANDSTILL_RATIO
from motorctl.loop.faults import device_message, lasting_words
from motorctl.loop.states import State, possible_words, state_words

START_MARGIN_S = 0.05
"""How long before its first tick a motion is ordered [s]: time for the orders of all its axes."""

_WHY = {
    Reply.NOT_AT_START: "the axis no longer stands where the motion was planned to begin",
    Reply.LATE: f"the loop took the order after its first tick, {START_MARGIN_S * 1e3:g} ms ahead",
}
"""Refusals that come of time that passed while a motion was planned."""


ENDED = (
    "the loop process has ended, and the daemon is stopping: its journal tells why; ask again once "
    "it is started anew"
)
"""What is answered to whatever needs the loop."""
ENDING = "the daemon is stopping and takes no command but estop; ask again once it is started anew"


class Refusals:
    """Words for what the loop refuses, by what it tells of the axes."""

    def __init__(self, machine: Machine, memory: LoopMemory) -> None:
        self._memory = memory
        self._names = list(machine.axes)
        axes = machine.axes.values()
        self._units = {axis.name: axis.units for axis in axes}
        self._top_m_s = {axis.name: axis.limits.max_velocity_m_s for axis in axes}
        self._absolute = {axis.name for axis in axes if axis.homing.method == "absolute"}

    def of(self, verb: Verb, name: str, reply: Reply) -> RefusedError:
        """Return what is answered where the loop refuses a command."""
        command, index = verb.name.lower(), self._names.index(name)
        match reply:
            case Reply.WRONG_STATE:
                return self.wrong_state(command, name)
            case Reply.NOT_HOMED:
                return self.not_homed(name)
            case Reply.STILL_FAULTY:
                message = f"axis {name}: {command} refused: the device still reports a fault"
                word = int(self._memory.axis_status["device_status"][index])
                if told := device_message(word):
                    message += f": {told}"
                message += "; mend that, then try again"
                return RefusedError(Code.STILL_FAULTY, message)
            case Reply.NOT_POWERED:
                message = (
                    f"axis {name}: {command} is possible once its amplifier is enabled: "
                    f"`motorctl start {name}` first"
                )
                return RefusedError(Code.WRONG_STATE, message)
            case Reply.CAUSE_LASTS:
                cause = FaultCause(int(self._memory.axis_status["fault"][index]))
                message = (
                    f"axis {name}: {command} refused: what tripped it is still so: "
                    f"{lasting_words(cause)}; then try again"
                )
                return RefusedError(Code.STILL_FAULTY, message)
            case Reply.STILL_MOVING:
                speed_m_s = abs(float(self._memory.axis_status["velocity_m_s"][index]))
                message = (
                    f"axis {name} still moves, with {speed_m_s:.3g} m/s: wait until it is slower "
                    f"than {STANDSTILL_RATIO * self._top_m_s[name]:.3g} m/s, "
                    f"{STANDSTILL_RATIO:.0%} of its top speed, then {command} is possible"
                )
                return RefusedError(Code.STILL_MOVING, self._units[name].words(message))
            case Reply.EXCITED:
                message = f"axis {name} is excited already: wait until that ends, or stop the axis"
                return RefusedError(Code.WRONG_STATE, message)
            case Reply.NO_HOMING if self._state(name) is State.FAULT:
                return self.wrong_state(command, name)
            case Reply.NO_HOMING:
                message = (
                    f"axis {name} has an absolute encoder: there is nothing to home; "
                    f"`motorctl start {name}` is enough"
                )
                return RefusedError(Code.NO_HOMING, message)
            case _:
                message = f"axis {name}: {command}: {_WHY[reply]}; try again"
                return RefusedError(Code.INTERNAL, message)

    def not_homed(self, name: str) -> RefusedError:
        """Return what is answered where an axis does not know its place."""
        message = f"axis {name} is not homed: `motorctl home {name}` first"
        return RefusedError(Code.NOT_HOMED, message)

    def wrong_state(self, command: str, name: str) -> RefusedError:
        """Return what is answered where the axis' state does not allow a command."""
        state = self._state(name)
        absolute = name in self._absolute
        message = (
            f"axis {name} is {state_words(state)}: {command} is not possible; "
            f"possible now: {possible_words(state, absolute)}"
        )
        if state is State.FAULT:
            message += f"; `motorctl status {name}` tells why it tripped, and what to do"
        return RefusedError(Code.WRONG_STATE, message)

    def _state(self, name: str) -> State:
        return State(int(self._memory.axis_status["inner_state"][self._names.index(name)]))

    def unknown(self, axis: str) -> RefusedError:
        """Return what is answered where there is no such axis."""
        known = ", ".join(self._names)
        return RefusedError(Code.UNKNOWN_AXIS, f"unknown axis '{axis}'; known: {known}")
