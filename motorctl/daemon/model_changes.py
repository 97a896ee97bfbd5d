"""Change the models of a running machine: checked, compiled beforehand, on trial at first.

The first motions of a new model run under a tightened limit of the following error. Where one of
them trips, what ran before takes over again.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import partial
from typing import Any

from motorctl.config import load_resolved
from motorctl.config.chosen_code import MayRun
from motorctl.config.machine import Machine
from motorctl.config.model_keys import (
    MODEL_KEYS,
    axes_with_other_models,
    other_keys_that_differ,
    with_models_of,
)
from motorctl.daemon.left_alone import left_alone
from motorctl.daemon.model_history import ModelHistory, What, changes_between
from motorctl.daemon.model_trials import TRIAL_MOTIONS, TRIAL_WINDOW, ModelTrials
from motorctl.daemon.protocol import ApplyCommand, Code, RefusedError
from motorctl.daemon.refusals import ENDED
from motorctl.errors import MotorctlError
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import LoopMemory, Phase
from motorctl.loop.compile_models import compile_models
from motorctl.loop.model_thread import ModelOrder
from motorctl.loop.other_models import OtherModels
from motorctl.loop.vocabulary import Word

STANDING = (AxisState.OFF, AxisState.IDLE)
"""States in which an axis may get another model."""
STANDING_AS_IT_TRIPPED = (*STANDING, AxisState.FAULT)
"""And in which it may get the one before again."""
POLL_S = 0.005
TRY_AGAIN_S = 5.0
"""Between two tries to go back to what ran before [s]: as long as compiling takes. By hand."""

Insist = Callable[[], None]
"""Raises RefusedError where what was asked for is overtaken by now."""

_log = logging.getLogger("motorctl")


class ModelChanges:
    """Orders them of the loop, one at a time.

    Parameters
    ----------
    machine
        What runs.
    memory
        Where the loop tells what became of an order.
    send
        Sends one to the loop's process; may wait.
    announce
        Told, before an order is sent, what runs if it is obeyed: the rows that come then.
    take_on
        Called with what runs from now on; returns the first log of it.
    may_run
        Tells whether code that a configuration names may be imported.
    history
        Keeps the changes.
    settled
        Tells whether what a fault is recorded with has been taken.
    loop_cpus
        Tells which CPUs compiling keeps off.
    """

    def __init__(
        self,
        machine: Machine,
        memory: LoopMemory,
        send: Callable[[ModelOrder], None],
        announce: Callable[[Machine], None],
        take_on: Callable[[Machine], str | None],
        may_run: MayRun,
        history: ModelHistory,
        settled: Callable[[], bool],
        loop_cpus: Callable[[], frozenset[int]],
    ) -> None:
        self._machine = machine
        self._memory = memory
        self._send = send
        self._announce = announce
        self._take_on = take_on
        self._may_run = may_run
        self._history = history
        self._settled = settled
        self._loop_cpus = loop_cpus
        self._names = list(machine.axes)
        self._number = 0
        self._one = asyncio.Lock()
        self._before: Machine | None = None
        """What ran before the last change; None: nothing else did."""
        self._trials_before = ModelTrials(self._names)
        """And what of that was on trial."""
        self._sources = dict.fromkeys(self._names, str(machine.source))
        """By axis: the configuration that its model came with."""
        self._trials = ModelTrials(self._names)
        self._falling_back: dict[str, asyncio.Task[None]] = {}
        """By axis: it tripped on trial, and what ran before has not taken over yet."""
        self._proving: asyncio.Task[None] | None = None

    def on_trial(self, axis: str) -> int | None:
        """Return how many motions prove an axis' model from here on; None: it is not on trial."""
        return self._trials.motions_left(axis)

    def insist_on_standing(self, axis: str) -> None:
        """Raise RefusedError while an axis that tripped on trial still has that model."""
        if axis in self._falling_back:
            message = (
                f"axis {axis} tripped with a model on trial, and what ran before takes over again: "
                "that takes some seconds. If it lasts, the daemon's log tells why"
            )
            raise RefusedError(Code.NOT_READY, message)

    def source(self, axis: str) -> str:
        """Return the configuration that an axis' model came with."""
        return self._sources[axis]

    def history(self, axis: str) -> list[dict[str, Any]]:
        """Return an axis' changes, oldest first, JSON-serialisable; RefusedError: unreadable."""
        try:
            return [c.model_dump() for c in self._history.read() if c.axis == axis]
        except OSError as error:
            message = f"the history of models cannot be read: {error}"
            raise RefusedError(Code.INTERNAL, message) from error

    async def apply(self, request: ApplyCommand, insist: Insist) -> dict[str, Any]:
        """Let other models take over.

        Parameters
        ----------
        request
            With the machine as it shall be.
        insist
            Called again once it is compiled.

        Returns
        -------
        dict
            The axes with other models, the first log of them, and how they are on trial; no axes
            where these models run already.

        Raises
        ------
        RefusedError
            Where it is no such machine, or the loop refuses; nothing has changed then.
        """
        async with self._one:
            machine = await self._checked(request)
            before = self._machine
            changed = axes_with_other_models(before, machine)
            if not changed:
                return {"axes": [], "log": None, "trial": None}
            self._must_stand("apply", changed, STANDING)
            earlier = self._trials
            trials = earlier.changed(before, machine, changed)
            log = await self._change(machine, changed, "apply", STANDING, trials, insist)
            self._before, self._trials_before = before, earlier
            self._sources |= dict.fromkeys(changed, request.source)
            await self._note(before, machine, changed, "applied", request.story, log)
            return self._answer(changed, log)

    async def revert(self, insist: Insist) -> dict[str, Any]:
        """Let the models before the last change take over again; as `apply`."""
        async with self._one:
            if self._before is None:
                message = (
                    "revert: no other models ran before since the daemon was started; after a "
                    "start those of its own file run"
                )
                raise RefusedError(Code.WRONG_STATE, message)
            return await self._go_back(self._before, "reverted", None, self._trials_before, insist)

    def watch(self) -> None:
        """Look whether a model on trial has proved itself, or tripped; takes no time."""
        states = {name: self._state(name) for name in self._names}
        tripped = self._trials.look(states, {name: self._fault(name) for name in self._names})
        new = [name for name in tripped if name not in self._falling_back]
        if new:
            task = asyncio.create_task(self._fall_back(tuple(new)))
            self._falling_back |= dict.fromkeys(new, task)
        if self._proving is None and self._trials.proved:
            self._proving = asyncio.create_task(self._prove())

    async def _prove(self) -> None:
        try:
            async with self._one:
                proved = self._trials.proved  # of now: others may have been applied meanwhile
                if not proved:
                    return
                machines = [(self._trials.proven(name), name) for name in proved]
                self._trials = self._trials.ended(proved)
                with suppress(RefusedError):
                    await self._order(None, self._trials)
                for before, name in machines:
                    assert before is not None
                    _log.info(
                        "axis %s: %d motions without a trip prove its model; the whole following "
                        "error is allowed",
                        name,
                        TRIAL_MOTIONS,
                    )
                    await self._note(before, self._machine, [name], "proven", [], None)
        finally:
            self._proving = None

    async def _fall_back(self, axes: tuple[str, ...]) -> None:
        """Go back, however often that takes; until it is done the axes cannot be reset."""
        why = "; ".join(f"axis {name}: {self._fault(name).name.lower()}" for name in axes)
        try:
            while self._memory.phase is Phase.RUNNING:
                try:
                    async with self._one:
                        while not self._settled():
                            await asyncio.sleep(POLL_S)
                        if not await self._fallen_back(axes, why):
                            return
                except RefusedError as no:
                    told = no.message
                except (MotorctlError, OSError) as error:
                    told = str(error)
                else:
                    return
                _log.error("%s: what ran before could not take over again: %s", why, told)
                _log.error("these axes keep the model that tripped, and stay disabled until then")
                await asyncio.sleep(TRY_AGAIN_S)
        finally:
            for name in axes:
                self._falling_back.pop(name, None)

    async def _fallen_back(self, axes: tuple[str, ...], why: str) -> bool:
        """Go back to what these axes have proved; return False where none is on trial any more."""
        proven = {name: self._trials.proven(name) for name in axes}
        own = {n: machine.resolved["axes"][n] for n, machine in proven.items() if machine}  # type: ignore[index]
        if not own:
            return False
        _log.warning("%s with a model on trial: what ran before takes over again", why)
        source = next(str(machine.source) for machine in proven.values() if machine)
        machine = await self._loaded(with_models_of(self._machine, {"axes": own}), source)
        await self._go_back(machine, "fell_back", why, ModelTrials(self._names), lambda: None)
        return True

    async def _go_back(
        self, machine: Machine, what: What, why: str | None, earlier: ModelTrials, insist: Insist
    ) -> dict[str, Any]:
        before = self._machine
        changed = axes_with_other_models(before, machine)
        self._must_stand("revert", changed, STANDING_AS_IT_TRIPPED)
        trials = self._trials.taken_back(earlier, changed)
        log = await self._change(machine, changed, "revert", STANDING_AS_IT_TRIPPED, trials, insist)
        self._before = None
        self._sources |= dict.fromkeys(changed, str(machine.source))
        await self._note(before, machine, changed, what, [], log, why)
        return self._answer(changed, log)

    def _answer(self, changed: list[str], log: str | None) -> dict[str, Any]:
        on_trial = any(self.on_trial(name) is not None for name in changed)
        trial = {"motions": TRIAL_MOTIONS, "window": TRIAL_WINDOW} if on_trial else None
        return {"axes": changed, "log": log, "trial": trial}

    async def _checked(self, request: ApplyCommand) -> Machine:
        """Return the machine that a request describes; refuse one that is another machine."""
        others = other_keys_that_differ(self._machine, request.config)
        if others:
            key, before, after = others[0]
            more = f", and {len(others) - 1} more" if len(others) > 1 else ""
            message = (
                f"apply: {request.source}: {key} is {after!r}, and {before!r} in what runs{more}: "
                f"only {', '.join(MODEL_KEYS)} of an axis can change while it runs; the rest takes "
                "a restart"
            )
            raise RefusedError(Code.OUT_OF_LIMITS, message)
        return await self._loaded(with_models_of(self._machine, request.config), request.source)

    async def _loaded(self, config: dict[str, object], source: str) -> Machine:
        try:
            return await asyncio.to_thread(
                load_resolved, config, source, hardware=True, may_run=self._may_run
            )
        except MotorctlError as error:
            raise RefusedError(Code.OUT_OF_LIMITS, str(error)) from error

    async def _change(
        self,
        machine: Machine,
        changed: list[str],
        do: str,
        standing: Collection[AxisState],
        trials: ModelTrials,
        insist: Insist,
    ) -> str | None:
        """Have the loop change models; return the first log of the new ones."""
        compiling = partial(compile_models, self._machine, machine, self._loop_cpus())
        try:
            # It may take half a minute on a busy computer: the end of the daemon waits for none.
            models = await left_alone("compiling models", compiling)
        except MotorctlError as error:
            raise RefusedError(Code.OUT_OF_LIMITS, str(error)) from error
        insist()  # others may have stopped or moved them while it was compiled
        self._must_stand(do, changed, standing)
        self._announce(machine)
        refused = await self._order(models, trials)
        if refused is not None:
            raise RefusedError(Code.WRONG_STATE, f"{do}: {refused}")
        self._machine, self._trials = machine, trials
        return await asyncio.to_thread(self._take_on, machine)

    async def _order(self, models: OtherModels | None, trials: ModelTrials) -> str | None:
        """Send an order and wait until it is done; return why it was refused, if it was."""
        self._number += 1
        order = ModelOrder(self._number, models, trials.windows)
        try:
            await asyncio.to_thread(self._send, order)
        except MotorctlError as error:
            raise RefusedError(Code.STOPPING, str(error)) from error
        while self._memory.look_at(Word.MODELS_DONE) != self._number:
            if self._memory.phase is not Phase.RUNNING:
                raise RefusedError(Code.STOPPING, ENDED)
            await asyncio.sleep(POLL_S)
        status = self._memory.status
        told = bytes(status["models_told"][0]).decode(errors="replace")
        return told if status["models_refused"][0] else None

    async def _note(
        self,
        before: Machine,
        after: Machine,
        axes: Collection[str],
        what: What,
        story: list[str],
        log: str | None,
        why: str | None = None,
    ) -> None:
        """Write it into the history; a disk that refuses undoes no change."""
        changes = changes_between(
            before, after, self._sources, axes, what, story=story, log=log, why=why
        )
        for change in changes:
            told = what.replace("_", " ")
            _log.info("axis %s: model %s, from %s", change.axis, told, change.source)
        try:
            await asyncio.to_thread(self._history.add, changes)
        except OSError as error:
            _log.error("the history of models could not be written: %s", error)

    def _must_stand(self, do: str, changed: list[str], standing: Collection[AxisState]) -> None:
        for name in changed:
            state = self._state(name)
            if state not in standing:
                fault = state is AxisState.FAULT
                first = f"`motorctl {'reset' if fault else 'stop'} {name}` first"
                message = (
                    f"{do}: axis {name} is {'in fault' if fault else state.name.lower()}: a model "
                    "changes while its axis "
                    f"holds or is off; {first}{'' if fault else ', or wait until it has ended'}"
                )
                raise RefusedError(Code.WRONG_STATE, message)
            status = self._memory.axis_status[self._names.index(name)]
            if int(status["excitation_left"]):
                message = f"{do}: axis {name} is excited: wait until that ends, or stop the axis"
                raise RefusedError(Code.WRONG_STATE, message)

    def _state(self, name: str) -> AxisState:
        return AxisState(int(self._memory.axis_status["state"][self._names.index(name)]))

    def _fault(self, name: str) -> FaultCause:
        """Return what the axis has tripped on; NONE while it is in no fault."""
        status = self._memory.axis_status[self._names.index(name)]
        faulty = int(status["state"]) == AxisState.FAULT
        return FaultCause(int(status["fault"])) if faulty else FaultCause(0)
