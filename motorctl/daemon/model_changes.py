"""Change the models of a running machine: checked, compiled beforehand, on trial at first.

The first motions of a new model run under a tightened limit of the following error. Where one of
them trips, what ran before takes over again.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
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
from motorctl.daemon.protocol import ApplyCommand, Code, RefusedError
from motorctl.errors import MotorctlError
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import LoopMemory, Phase
from motorctl.loop.compile_models import compile_models
from motorctl.loop.model_thread import ModelOrder
from motorctl.loop.other_models import OtherModels
from motorctl.loop.vocabulary import Word

TRIAL_MOTIONS = 3
"""So many motions without a trip prove a model. More keep the limit tight for longer, fewer prove
less. By hand."""
TRIAL_WINDOW = 0.5
"""The part of the limits of following error that they have. Larger lets a bad model go further,
smaller trips good ones. By hand: an axis in order stays far below half of its limit."""
TRIPS = (FaultCause.FOLLOWING_ERROR, FaultCause.SATURATION, FaultCause.OVERSPEED)
"""Faults that a model may be the cause of."""
STANDING = (AxisState.OFF, AxisState.IDLE, AxisState.FAULT)
POLL_S = 0.005

_log = logging.getLogger("motorctl")


@dataclass
class _Trial:
    """A model that has to prove itself."""

    before: Machine
    axes: tuple[str, ...]
    moving: set[str]
    """Axes that were under way when it was looked at last."""
    motions: int = 0


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
        self._source = str(machine.source)
        self._trial: _Trial | None = None
        self._falling_back: asyncio.Task[None] | None = None

    def on_trial(self, axis: str) -> int | None:
        """Return how many motions prove an axis' model from here on; None: it is not on trial."""
        trial = self._trial
        return TRIAL_MOTIONS - trial.motions if trial and axis in trial.axes else None

    def history(self, axis: str) -> list[dict[str, Any]]:
        """Return an axis' changes, oldest first, JSON-serialisable."""
        return [c.model_dump() for c in self._history.read() if c.axis == axis]

    async def apply(self, request: ApplyCommand) -> dict[str, Any]:
        """Let other models take over.

        Parameters
        ----------
        request
            With the machine as it shall be.

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
            self._must_stand("apply", changed)
            log = await self._change(machine, changed, "apply", TRIAL_WINDOW)
            self._before, self._source = before, request.source
            self._trial = _Trial(before, tuple(changed), set())
            await self._note(before, machine, "applied", request.story, log)
            return {
                "axes": changed,
                "log": log,
                "trial": {"motions": TRIAL_MOTIONS, "window": TRIAL_WINDOW},
            }

    async def revert(self) -> dict[str, Any]:
        """Let the models before the last change take over again; as `apply`."""
        async with self._one:
            if self._before is None:
                message = "revert: no other models ran before since the daemon was started"
                raise RefusedError(Code.WRONG_STATE, message)
            return await self._go_back(self._before, "reverted", None)

    def watch(self) -> None:
        """Look whether a model on trial has proved itself, or tripped; takes no time."""
        trial = self._trial
        if trial is None or self._one.locked():
            return
        states = {name: self._state(name) for name in trial.axes}
        tripped = [name for name in trial.axes if self._fault(name) in TRIPS]
        if tripped:
            if self._falling_back is None:
                self._falling_back = asyncio.create_task(self._fall_back(trial, tripped[0]))
            return
        for name, state in states.items():
            if state is AxisState.RUNNING:
                trial.moving.add(name)
            elif name in trial.moving:
                trial.moving.discard(name)
                trial.motions += 1
        if trial.motions >= TRIAL_MOTIONS:
            self._trial = None
            asyncio.get_running_loop().create_task(self._prove(trial))

    async def _prove(self, trial: _Trial) -> None:
        async with self._one:
            with suppress(RefusedError):
                await self._order(None, 1.0)
            _log.info(
                "models of %s: %d motions without a trip; the whole following error is allowed",
                ", ".join(trial.axes),
                TRIAL_MOTIONS,
            )
            await self._note(trial.before, self._machine, "proven", [], None)

    async def _fall_back(self, trial: _Trial, axis: str) -> None:
        """Go back once everything stands; who asks for something else meanwhile waits."""
        why = f"axis {axis}: {self._fault(axis).name.lower()}"
        try:
            async with self._one:
                while not self._settled() or any(
                    self._state(name) not in STANDING for name in trial.axes
                ):
                    await asyncio.sleep(POLL_S)
                _log.warning("%s with a model on trial: what ran before takes over again", why)
                await self._go_back(trial.before, "fell_back", why)
        except RefusedError as no:
            _log.error("the models before could not take over again: %s", no.message)
        finally:
            self._trial, self._falling_back = None, None

    async def _go_back(self, machine: Machine, what: What, why: str | None) -> dict[str, Any]:
        before = self._machine
        changed = axes_with_other_models(before, machine)
        self._must_stand("revert", changed)
        log = await self._change(machine, changed, "revert", 1.0)
        self._before, self._trial = None, None
        self._source = str(machine.source)
        await self._note(before, machine, what, [], log, why)
        return {"axes": changed, "log": log, "trial": None}

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
        try:
            machine = await asyncio.to_thread(
                load_resolved,
                with_models_of(self._machine, request.config),
                request.source,
                hardware=True,
                may_run=self._may_run,
            )
        except MotorctlError as error:
            raise RefusedError(Code.OUT_OF_LIMITS, str(error)) from error
        return machine

    async def _change(
        self, machine: Machine, changed: list[str], do: str, window: float
    ) -> str | None:
        """Have the loop change models; return the first log of the new ones."""
        room = self._memory.layout["parameters"]
        compiling = partial(compile_models, self._machine, machine, room, self._loop_cpus())
        try:
            # It may take half a minute on a busy computer: the end of the daemon waits for none.
            models = await left_alone("compiling models", compiling)
        except MotorctlError as error:
            raise RefusedError(Code.OUT_OF_LIMITS, str(error)) from error
        self._must_stand(do, changed)  # others may have moved them while it was compiled
        self._announce(machine)
        refused = await self._order(models, window)
        if refused is not None:
            raise RefusedError(Code.WRONG_STATE, f"{do}: {refused}")
        self._machine = machine
        return await asyncio.to_thread(self._take_on, machine)

    async def _order(self, models: OtherModels | None, window: float) -> str | None:
        """Send an order and wait until it is done; return why it was refused, if it was."""
        self._number += 1
        order = ModelOrder(self._number, models, window)
        try:
            await asyncio.to_thread(self._send, order)
        except MotorctlError as error:
            raise RefusedError(Code.STOPPING, str(error)) from error
        while self._memory.look_at(Word.MODELS_DONE) != self._number:
            if self._memory.phase is not Phase.RUNNING:
                message = "the loop process has ended: the daemon is stopping"
                raise RefusedError(Code.STOPPING, message)
            await asyncio.sleep(POLL_S)
        status = self._memory.status
        told = bytes(status["models_told"][0]).decode(errors="replace")
        return told if status["models_refused"][0] else None

    async def _note(
        self,
        before: Machine,
        after: Machine,
        what: What,
        story: list[str],
        log: str | None,
        why: str | None = None,
    ) -> None:
        """Write it into the history; a disk that refuses undoes no change."""
        changes = changes_between(
            before, after, what, source=self._source, story=story, log=log, why=why
        )
        for change in changes:
            _log.info(
                "axis %s: model %s, from %s", change.axis, what.replace("_", " "), self._source
            )
        try:
            await asyncio.to_thread(self._history.add, changes)
        except OSError as error:
            _log.error("the history of models could not be written: %s", error)

    def _must_stand(self, do: str, changed: list[str]) -> None:
        for name in changed:
            state = self._state(name)
            if state not in STANDING:
                message = (
                    f"{do}: axis {name} is {state.name.lower()}: a model changes while its axis "
                    f"holds or is off; `motorctl stop {name}` first, or wait until it has ended"
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
