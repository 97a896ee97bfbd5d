"""A machine of one axis to walk through its states: in perfect order, until a test says otherwise.

The axis has a tenth of the loop's rate, so that it is seen between the tick in which it is enabled
and the one in which its law begins.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

from loop_bench import Hand, Still, gantry, homed_by, with_axes, with_driver

from motorctl.config.machine import Machine
from motorctl.hal import Status
from motorctl.log.sample import AxisState
from motorctl.loop import Reply, Verb
from motorctl.loop.states import Event, State
from motorctl.motion import point_to_point

OWN = 10
"""Ticks of the loop in one of the axis."""
FROZEN = 600
"""Periods without a tick that the axis takes for a computer that stood still."""
LONG_M, SPEED_M_S = 0.2, 0.2
QUICK = {"reaction": "quick_stop"}
SLOW_GAINS = {"k1_1_s": 40.0, "ks_v_s_m": 12.0, "gamma_d": 10.0}


@cache
def machine(method: str) -> Machine:
    """Return the axis; it is homed by this method."""
    changes: dict[str, Any] = {
        "gains": SLOW_GAINS,
        "adaptation": {"filter_rad_s": 60.0},
        "guards": {"limit_switch": QUICK, "host_frozen": QUICK},
        # So gentle that a ramp lasts longer than a frozen computer.
        "limits": {"stop": {"acceleration_m_s2": 0.5, "jerk_m_s3": 50.0}},
    }
    if method != "absolute":
        changes["homing"] = homed_by(method)
    whole = with_driver(with_axes(gantry(), ["x"], divisor=OWN, **changes), Still)
    return dataclasses.replace(whole, axes={"x": whole.axes["x"]}, programs={})


class Walk(Hand):
    """The loop, and a device whose axis goes where the reference goes."""

    def __init__(self, method: str = "absolute") -> None:
        super().__init__(machine(method))
        self._metres_per_count = float(self.tick.settings["metres_per_count"][0])
        self._travelled_m = 0.0
        self.steps(OWN + 1)

    def step(self, elapsed: int = 1, **arguments: Any) -> None:
        before = int(self.driver.counts[0])
        if self.number >= 0:
            self._travelled_m += float(self.status()["reference_velocity_m_s"]) * 0.2e-3
            moved = round(self._travelled_m / self._metres_per_count)
            self._travelled_m -= moved * self._metres_per_count
            self.driver.counts[0] = before + moved
        super().step(elapsed, **arguments)

    @property
    def state(self) -> State:
        """The state in the words of CiA 402, and what the axis does while it is enabled."""
        state = State(int(self.status()["inner_state"]))
        assert AxisState(int(self.status()["state"])) is state.told
        return state

    def report(self, bits: int) -> None:
        """Let the device report this from now on."""
        self.driver.status[0] = bits

    def post(self, command: Event) -> int:
        """Post a command; what follows is a long slow way from where the axis is."""
        arguments = {}
        if command is Event.FOLLOW:
            here = float(self.status()["reference_m"])
            way = LONG_M if here < LONG_M else -LONG_M
            path = point_to_point(here, here + way, SPEED_M_S, 2.0, 200.0)
            arguments["slot"] = self.memory.load_program(0, path.segments)
        return self.memory.post(Verb[command.name], 0, **arguments)

    def command(self, command: Event) -> Reply | None:
        """Post a command and give the answer to it, a tick later."""
        number = self.post(command)
        self.step()
        return self.memory.reply(number)

    def until_own_tick_is_over(self) -> None:
        """Go on to where the axis has had its own tick, and the next one is not."""
        while self.number % OWN:
            self.step()

    def lead_to(self, state: State) -> None:
        """Bring the axis from rest into a state, on the shortest way."""
        match state:
            case State.SWITCH_ON_DISABLED:
                self.report(Status.AMPLIFIER_FAULT)
                self.steps(OWN)
            case State.SWITCHED_ON:
                self.until_own_tick_is_over()
                self.command(Event.START)
            case State.HOLDING:
                self.command(Event.START)
                self.steps(OWN)
            case State.HOMING:
                self.command(Event.HOME)
            case State.FOLLOWING | State.QUICK_STOP_ACTIVE | State.FAULT_REACTION_ACTIVE:
                self.lead_to(State.HOLDING)
                if not self.status()["homed"]:
                    self.command(Event.HOME)
                    self.cause(Event.HOMED)
                    self.report(0)
                self.command(Event.FOLLOW)
                self.steps(1000)
                if state is State.QUICK_STOP_ACTIVE:
                    self.command(Event.STOP)
                elif state is State.FAULT_REACTION_ACTIVE:
                    self.report(Status.LIMIT_POSITIVE)
                    self.steps(OWN)
                    self.report(0)
            case State.FAULT:
                self.command(Event.ESTOP)
        assert self.state is state

    def cause(self, event: Event) -> None:
        """Let something happen that is no command."""
        match event:
            case Event.READY:
                self.report(0)
                self.steps(OWN)
            case Event.NOT_READY | Event.TRIP:
                self.report(Status.AMPLIFIER_FAULT)
                self.steps(OWN)
            case Event.LAW_BEGINS:
                self.steps(OWN)
            case Event.HOMED:
                self.report(Status.INDEX_LATCHED)
                self.steps(40 * OWN)
            case Event.PROGRAM_ENDS | Event.AT_REST:
                self.steps(7500)
            case Event.QUICK_STOP:
                self.step(FROZEN)
