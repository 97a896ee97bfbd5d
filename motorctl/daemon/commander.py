"""Carry out the commands of the control socket: check, order the loop, tell what came of it.

The loop decides what its state allows; what is checked here first only makes for clear words.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from motorctl.config.learned_file import learned_paths
from motorctl.config.machine import Axis, Machine
from motorctl.config.metadata import log_axes, log_metadata
from motorctl.daemon.excitations import Excitations
from motorctl.daemon.model_changes import ModelChanges
from motorctl.daemon.overtaking import Begun, Stops
from motorctl.daemon.program_transfer import unpacked
from motorctl.daemon.protocol import (
    ApplyCommand,
    AxisCommand,
    Code,
    EmergencyStopCommand,
    ExciteCommand,
    ModelsCommand,
    MoveCommand,
    ProgramCommand,
    RefusedError,
    Request,
    RevertCommand,
    SamplesCommand,
    StatusCommand,
)
from motorctl.daemon.refusals import ENDED, ENDING, START_MARGIN_S, Refusals
from motorctl.daemon.reopening import Reopening
from motorctl.daemon.report import Report
from motorctl.errors import MotorctlError
from motorctl.hal import Status
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory, Phase, Reply, Verb
from motorctl.loop.layout import signature
from motorctl.loop.plan import ProgramPlan, load_plan, plan_move, plan_program
from motorctl.loop.states import State
from motorctl.motion import Program

REPLY_TIMEOUT_S = 1.0
POWER_TIMEOUT_S = 20.0
"""How long a command waits for an amplifier to be enabled; a client waits for 30 s."""
POLL_S = 0.002
MOST_MOTIONS = 1000

_log = logging.getLogger("motorctl")


@dataclass(frozen=True)
class _Motion:
    """A motion that was ordered."""

    name: str
    start_tick: int
    approach_s: float
    duration_s: float
    period_s: float | None
    cycles: int


class Commander:
    """Handles one request at a time for motions, any number at once for everything else."""

    def __init__(
        self,
        machine: Machine,
        memory: LoopMemory,
        report: Report,
        reopening: Reopening | None = None,
        before_reset: Callable[[], None] | None = None,
        models: ModelChanges | None = None,
    ) -> None:
        self.machine = machine
        """What runs; another one once its models have changed."""
        self.models_row = 0
        """The first row of its models."""
        self._models = models
        self._refusals = Refusals(machine, memory)
        self._reopening = reopening
        self._before_reset = before_reset
        """Called while the fault still stands: whoever looks only now and then sees it, too."""
        self._memory = memory
        self._report = report
        self._names = list(machine.axes)
        self._learned_files = learned_paths(machine)  # later models may come from anywhere
        self._motions: dict[str, _Motion] = {}
        self._history: deque[dict[str, Any]] = deque(maxlen=MOST_MOTIONS)
        self._waiting: dict[str, Program] = {}
        """Axes that were started and whose program begins when its other axes are, too."""
        self._stopping: int | None = None
        """Number of the last emergency stop that was ordered."""
        self._stops = Stops(self._names)
        self.excitations = Excitations(
            machine, memory, self._refusals, self._stops, self._order, self._take_back
        )
        # A trajectory is written into the slot that is not in use: one writer at a time.
        self._ordering = asyncio.Lock()

    @property
    def history(self) -> list[dict[str, Any]]:
        """The last motions that were followed, JSON-serialisable, for the log's metadata."""
        return list(self._history)

    async def handle(self, request: Request) -> dict[str, Any]:
        """Carry out a request.

        Parameters
        ----------
        request
            As `motorctl.daemon.protocol.parse_request` returns it.

        Returns
        -------
        dict
            The answer's content, without `id` and `ok`.

        Raises
        ------
        RefusedError
            Where the request cannot be carried out, with the reason.
        """
        if isinstance(request, StatusCommand):
            return self._status(request.axis)
        if isinstance(request, SamplesCommand):
            return self._samples()
        if isinstance(request, EmergencyStopCommand):
            # As long as anything may move: also on the way down, when all else is refused.
            self._must_tick()
            self._waiting.clear()
            self._stops.emergencies += 1
            await self._stop_all_at_once()
            return {"axes": self._names}
        if isinstance(request, ApplyCommand | RevertCommand):
            self._must_go_on()
            assert self._models is not None  # as the supervisor makes it
            begun = self._stops.begin(request.do)

            def insist() -> None:
                self._must_go_on()
                begun.insist()

            if isinstance(request, ApplyCommand):
                return await self._models.apply(request, insist)
            return await self._models.revert(insist)
        if request.axis not in self._names:
            raise self._refusals.unknown(request.axis)
        if isinstance(request, ModelsCommand):
            return {"axis": request.axis, **await self._models_of(request.axis)}
        self._must_go_on()
        self._waiting.pop(request.axis, None)
        if self._models is not None and request.do != "stop":
            self._models.insist_on_standing(request.axis)
        begun = self._stops.begin(request.do)
        match request:
            case MoveCommand():
                async with self._ordering:
                    return await self._move(request, begun)
            case ProgramCommand():
                async with self._ordering:
                    return await self._program(request, begun)
            case ExciteCommand():
                async with self._ordering:
                    begun.insist(request.axis)
                    lasts_s = await self.excitations.begin(self.machine, request)
                    return {"axis": request.axis, "duration_s": lasts_s}
            case AxisCommand(do="start"):
                async with self._ordering:
                    axis = self.machine.axes[request.axis]
                    return await self._start(axis, request.hold, begun)
            case AxisCommand(do="home"):
                return await self._home(request.axis, begun)
            case AxisCommand(do="reset"):
                return await self._reset(request.axis, begun)
            case AxisCommand():
                self._stops.of_axis[request.axis] += 1
                await self._order(Verb[request.do.upper()], request.axis)
                return {"axis": request.axis, "state": self._state(request.axis).name.lower()}

    def _must_go_on(self) -> None:
        if self._report.stopping:
            raise RefusedError(Code.STOPPING, ENDING)
        self._must_tick()

    async def _models_of(self, axis: str) -> dict[str, Any]:
        assert self._models is not None  # as the supervisor makes it
        changes = await asyncio.to_thread(self._models.history, axis)
        return {"models": changes, "runs": self._models.source(axis)}

    def _status(self, axis: str | None) -> dict[str, Any]:
        if axis is not None and axis not in self._names:
            raise self._refusals.unknown(axis)
        tick = int(self._memory.status["tick"][0])
        motions = {
            name: {
                "name": motion.name,
                "elapsed_s": (tick - motion.start_tick) * self.machine.period_s,
                "approach_s": motion.approach_s,
                "duration_s": motion.duration_s,
            }
            for name, motion in self._motions.items()
        }
        return self._report.document([axis] if axis else self._names, motions)

    def _samples(self) -> dict[str, Any]:
        """Return what it takes to read the ring: how it is laid out, and what theta is made of."""
        return {
            "machine": self.machine.name,
            "rate_hz": self.machine.rate_hz,
            "layout": self._memory.layout,
            "signature": signature(self._memory.layout),
            "models_row": self.models_row,
            "metadata": log_metadata(self.machine),
            "axes": {
                axis.name: {
                    "theta_names": list(axis.theta_names),
                    "theta_units": list(axis.theta_units),
                    "dual_drive": axis.dual_drive,
                    "position_unit": axis.units.position,
                }
                for axis in log_axes(self.machine)
            },
        }

    async def _reset(self, name: str, begun: Begun) -> dict[str, Any]:
        """Clear a fault; where the driver says that its bus is gone, open it anew before.

        A device that keeps its own fault is asked to forget it before.
        """
        answer: dict[str, Any] = {"axis": name, "state": "off"}
        if self._reopening is not None and self._reopening.is_needed(name):
            answer["opened"] = await self._reopening.open_anew(name)
        elif self._reopening is not None and self._reopening.may_clear(name):
            if not await self._reopening.clear_fault(name):
                raise self._refusals.of(Verb.RESET, name, Reply.STILL_FAULTY)
            answer["cleared"] = True
        if not answer.keys() & {"opened", "cleared"} or self._state(name) is AxisState.FAULT:
            if self._before_reset is not None:
                self._before_reset()
            if self._models is not None:
                self._models.insist_on_standing(name)  # what was just seen may be its trip
            begun.insist()
            await self._order(Verb.RESET, name)
        return {**answer, "state": self._state(name).name.lower(), "homed": self._homed(name)}

    async def _start(self, axis: Axis, hold: bool, begun: Begun) -> dict[str, Any]:
        """Enable the axis; then its program, as soon as every axis of it is enabled."""
        begun.insist(axis.name)
        own = None if hold else axis.program
        program = self.machine.programs[own] if own else None
        if program is not None and not self._homed(axis.name):
            raise self._refusals.not_homed(axis.name)
        if self._state(axis.name) is not AxisState.IDLE:
            await self._order(Verb.START, axis.name)
            await self._until_idle(axis.name, begun)
        program = program or next((p for p in self._waiting.values() if axis.name in p.axes), None)
        if hold:
            self._waiting = {n: p for n, p in self._waiting.items() if axis.name not in p.axes}
        if hold or program is None:
            return {"axis": axis.name, "state": "idle"}
        missing = [n for n in program.axes if self._state(n) is not AxisState.IDLE]
        if missing:
            self._waiting[axis.name] = program
            answer = {"axis": axis.name, "state": "idle", "program": program.name}
            return {**answer, "waits_for": missing}
        return await self._follow_program(axis.name, program, begun)

    async def _home(self, name: str, begun: Begun) -> dict[str, Any]:
        """Look for the axis' zero; where its amplifier takes time, enable it before."""
        reply = await self._reply(self._post(Verb.HOME, name))
        if reply is Reply.NOT_POWERED:
            begun.insist(name)
            if self._state(name) is not AxisState.IDLE:
                await self._order(Verb.START, name)
            await self._until_idle(name, begun)
            reply = await self._reply(self._post(Verb.HOME, name))
        if reply is not Reply.OK:
            raise self._refusals.of(Verb.HOME, name, reply)
        return {"axis": name, "state": self._state(name).name.lower()}

    async def _move(self, request: MoveCommand, begun: Begun) -> dict[str, Any]:
        name = request.axis
        begun.insist(name)
        self._must_stand("move", name)
        begin_m, target_m = self._reference(name), request.position_m
        if target_m is None:
            assert request.by_m is not None  # either is given
            target_m = begin_m + request.by_m
        try:
            trajectory = await asyncio.to_thread(
                plan_move,
                self.machine,
                name,
                begin_m,
                target_m,
                request.velocity_m_s,
                request.acceleration_m_s2,
            )
        except MotorctlError as error:
            raise RefusedError(Code.OUT_OF_LIMITS, f"axis {name}: {error}") from error
        motion = _Motion("move", 0, 0.0, trajectory.duration_s, None, 1)
        await self._follow(motion, ProgramPlan({name: trajectory}, 0.0, None), begun)
        return {
            "axis": name,
            "state": "running",
            "target_m": target_m,
            "duration_s": trajectory.duration_s,
        }

    async def _program(self, request: ProgramCommand, begun: Begun) -> dict[str, Any]:
        if request.document is None:
            program = self.machine.programs.get(request.name)
            if program is None:
                known = ", ".join(self.machine.programs) or "none"
                message = f"unknown program '{request.name}'; known: {known}"
                raise RefusedError(Code.UNKNOWN_PROGRAM, message)
        else:
            program = await asyncio.to_thread(
                unpacked, request.name, request.document, request.files, self._names
            )
        if request.axis not in program.axes:
            moves = f"moves {', '.join(program.axes)}, not axis {request.axis}"
            message = f"program '{program.name}' {moves}: name one that it moves"
            raise RefusedError(Code.BAD_PROGRAM, message)
        begun.insist(*program.axes)
        for name in program.axes:
            self._must_stand("program", name)
        return await self._follow_program(request.axis, program, begun)

    async def _follow_program(self, axis: str, program: Program, begun: Begun) -> dict[str, Any]:
        row, standing = self.models_row, {name: self._reference(name) for name in program.axes}
        try:
            # Nothing of the program's motion is asked for here: its signs of life would wait.
            plan = await asyncio.to_thread(
                plan_program, self.machine, program, standing, self._learned_files, row
            )
        except MotorctlError as error:
            raise RefusedError(Code.OUT_OF_LIMITS, str(error)) from error
        motion = _Motion(
            program.name, 0, plan.approach_s, plan.duration_s, plan.period_s, program.cycles
        )
        for note in plan.notes:
            _log.warning(note)
        await self._follow(motion, plan, begun)
        return {
            "axis": axis,
            "state": "running",
            "program": program.name,
            "axes": list(program.axes),
            "approach_s": plan.approach_s,
            "duration_s": plan.duration_s,
            **{k: list(v) for k in ("learned", "notes") if (v := getattr(plan, k))},
        }

    async def _follow(self, motion: _Motion, plan: ProgramPlan, begun: Begun) -> None:
        """Let the axes follow their plans from one and the same tick on, or none of them."""
        begun.insist(*plan.trajectories)
        slots = load_plan(self._memory, self._names, plan)
        margin = max(round(START_MARGIN_S * self.machine.rate_hz), 2)
        tick = int(self._memory.status["tick"][0]) + margin
        # What else moves at that time is another program, and not stopped for this one.
        shared = self._memory.program_number()
        numbers: dict[str, int] = {}
        replies: dict[str, Reply] = {}
        try:
            for name, slot in slots.items():
                numbers[name] = self._post(Verb.FOLLOW, name, slot=slot, tick=tick, program=shared)
            for name, number in numbers.items():
                replies[name] = await self._reply(number)
        except BaseException:
            await self._take_back(n for n in numbers if replies.get(n, Reply.OK) is Reply.OK)
            raise
        refused = {name: reply for name, reply in replies.items() if reply is not Reply.OK}
        if refused:
            await self._take_back(name for name in replies if name not in refused)
            name, reply = next(iter(refused.items()))
            raise self._refusals.of(Verb.FOLLOW, name, reply)
        started = _Motion(**{**vars(motion), "start_tick": tick})
        self._motions.update(dict.fromkeys(plan.trajectories, started))
        for name in plan.trajectories:
            self._waiting.pop(name, None)
        self._history.append({"axes": list(plan.trajectories), **vars(started)})

    async def _take_back(self, names: Iterable[str]) -> None:
        """Stop axes that were ordered to follow a program or were excited, or may have been.

        While the mailbox has no room it is tried again, for as long as a reply may take.
        """
        deadline = time.monotonic() + REPLY_TIMEOUT_S
        numbers = []
        for name in names:
            with suppress(RefusedError):
                numbers.append(await self._posted(Verb.STOP, name, deadline))
        # Who asked is told why the program is not followed, not what became of the stop.
        with suppress(RefusedError):
            for number in numbers:
                await self._reply(number)

    async def _posted(self, verb: Verb, name: str, deadline: float) -> int:
        while True:
            try:
                return self._post(verb, name)
            except RefusedError:
                if time.monotonic() > deadline:
                    raise
            await asyncio.sleep(POLL_S)

    async def _until_idle(self, name: str, begun: Begun) -> None:
        began = time.monotonic()
        while (state := self._state(name)) is not AxisState.IDLE or self._waits_for_power(name):
            allowed_s = POWER_TIMEOUT_S if state is AxisState.IDLE else REPLY_TIMEOUT_S
            if state is AxisState.FAULT or time.monotonic() > began + allowed_s:
                raise self._refusals.of(Verb.START, name, Reply.WRONG_STATE)
            await asyncio.sleep(POLL_S)
            begun.insist(name)
        begun.insist(name)  # the loop may not have taken the stop yet

    async def _stop_all_at_once(self) -> None:
        """Order an emergency stop; who asks while one is on its way to the loop shares it."""
        number = self._stopping
        if number is None or self._memory.reply(number) is not None:
            number = self._stopping = self._post(Verb.ESTOP, self._names[0])
        reply = await self._reply(number)
        if reply is not Reply.OK:
            raise self._refusals.of(Verb.ESTOP, self._names[0], reply)

    async def _order(self, verb: Verb, name: str) -> None:
        reply = await self._reply(self._post(verb, name))
        if reply is not Reply.OK:
            raise self._refusals.of(verb, name, reply)

    def _post(
        self, verb: Verb, name: str, *, slot: int = 0, tick: int = 0, program: int = 0
    ) -> int:
        try:
            return self._memory.post(
                verb, self._names.index(name), slot=slot, tick=tick, program=program
            )
        except BufferError as error:
            raise RefusedError(Code.LOOP_SILENT, str(error)) from error

    async def _reply(self, number: int) -> Reply:
        deadline = time.monotonic() + REPLY_TIMEOUT_S
        while (reply := self._memory.reply(number)) is None:
            if time.monotonic() > deadline:
                message = (
                    f"the loop did not answer within {REPLY_TIMEOUT_S:g} s; `motorctl status` "
                    "tells whether it ticks"
                )
                raise RefusedError(Code.LOOP_SILENT, message)
            await asyncio.sleep(POLL_S)
        return reply

    def _must_tick(self) -> None:
        phase = self._memory.phase
        if phase in (Phase.STOPPED, Phase.FAILED):
            raise RefusedError(Code.STOPPING, ENDED)
        if phase is not Phase.RUNNING:
            message = self._report.preparing or "the loop is about to begin"
            raise RefusedError(Code.NOT_READY, f"{message}; try again in some seconds")

    def _must_stand(self, command: str, name: str) -> None:
        if self._state(name) is not AxisState.IDLE:
            raise self._refusals.wrong_state(command, name)
        if not self._homed(name):
            raise self._refusals.not_homed(name)

    def _state(self, name: str) -> AxisState:
        return AxisState(int(self._memory.axis_status["state"][self._names.index(name)]))

    def _waits_for_power(self, name: str) -> bool:
        status = self._memory.axis_status[self._names.index(name)]
        unpowered = int(status["device_status"]) & Status.UNPOWERED
        return bool(unpowered) and int(status["inner_state"]) == State.SWITCHED_ON

    def _homed(self, name: str) -> bool:
        return bool(self._memory.axis_status["homed"][self._names.index(name)])

    def _reference(self, name: str) -> float:
        return float(self._memory.axis_status["reference_m"][self._names.index(name)])
