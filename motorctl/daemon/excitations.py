"""Excitations of axes: checked, begun, and ended where whoever began one is gone."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable, Iterable

import numpy as np

from motorctl.config.machine import Machine
from motorctl.daemon.overtaking import Stops
from motorctl.daemon.protocol import Code, ExciteCommand, RefusedError
from motorctl.daemon.refusals import Refusals
from motorctl.log.sample import AxisState
from motorctl.loop import Excitation, LoopMemory, Reply, Verb

_log = logging.getLogger("motorctl")


class Excitations:
    """Has the loop excite axes.

    `order` posts a verb for an axis and raises what is refused; `take_back` stops axes of which it
    is not known whether the loop obeys.
    """

    def __init__(
        self,
        machine: Machine,
        memory: LoopMemory,
        refusals: Refusals,
        stops: Stops,
        order: Callable[[Verb, str], Awaitable[None]],
        take_back: Callable[[Iterable[str]], Awaitable[None]],
    ) -> None:
        self._memory = memory
        self._names = list(machine.axes)
        self._refusals = refusals
        self._stops = stops
        self._order = order
        self._take_back = take_back
        self._begun_by: dict[str, ExciteCommand] = {}
        """What has excited each axis last."""

    async def begin(self, machine: Machine, request: ExciteCommand) -> float:
        """Have the loop begin an excitation, and return how long it lasts [s].

        Parameters
        ----------
        machine
            That runs now.
        request
            What is asked for.

        Raises
        ------
        RefusedError
            Where a limit or the axis' state does not allow it.
        """
        name = request.axis
        axis, period_s = machine.axes[name], machine.period_of(name)
        excitation = Excitation(np.array(request.volts), request.periods, request.fade_periods)
        if problem := excitation.problem(axis.limits, period_s):
            raise RefusedError(Code.OUT_OF_LIMITS, f"axis {name}: {problem}")
        states: tuple[AxisState, ...] = (AxisState.IDLE, AxisState.RUNNING)
        if request.state is not None:  # what who asks takes for granted: others may move it, too
            states = (AxisState[request.state.upper()],)
        index = self._names.index(name)
        if AxisState(int(self._memory.axis_status["state"][index])) not in states:
            raise self._refusals.wrong_state("excite", name)
        if self._is_excited(name):
            raise self._refusals.of(Verb.EXCITE, name, Reply.EXCITED)
        self._memory.load_excitation(index, excitation)
        self._begun_by[name] = request
        try:
            await self._order(Verb.EXCITE, name)
        except RefusedError as no:
            if no.code is Code.LOOP_SILENT:  # it may take the order yet, and nobody waits for it
                await self._take_back([name])
            raise
        return excitation.total_ticks * period_s

    async def leave(self, request: ExciteCommand) -> None:
        """Stop the axis of an excitation whose client is gone, unless it has ended since.

        Nobody is left who would stop it where it does harm. What others do with the axis
        afterwards is theirs.
        """
        name = request.axis
        if self._begun_by.get(name) is not request or not self._is_excited(name):
            return
        _log.warning("axis %s: who excited it is gone: it is stopped", name)
        self._stops.of_axis[name] += 1
        try:
            await self._order(Verb.STOP, name)
        except RefusedError as no:
            _log.warning("axis %s: not stopped: %s", name, no.message)

    def _is_excited(self, name: str) -> bool:
        return bool(self._memory.axis_status["excitation_left"][self._names.index(name)])
