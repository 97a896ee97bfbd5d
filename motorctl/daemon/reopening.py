"""Have the loop bring a device back: open its driver anew, or ask it to forget its fault.

When that helps, and what came of it.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from functools import partial

from motorctl.config.machine import Machine
from motorctl.daemon.protocol import Code, RefusedError
from motorctl.daemon.refusals import ENDED
from motorctl.hal import Status
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory, Phase
from motorctl.loop.faults import device_message, needs_opening
from motorctl.loop.vocabulary import Word

ANSWER_S = 20.0
"""How long one command waits for a driver to open, or for its turn to clear a fault; a client waits
for 30 s."""
POLL_S = 0.005
CLEARED_S = 1.0
"""How long a device has to forget its fault."""
CLEARABLE = int(Status.AMPLIFIER_FAULT | Status.COMMUNICATION_LOST)
DISABLED = (AxisState.OFF, AxisState.FAULT)

_log = logging.getLogger("motorctl")


class Reopening:
    """Orders the loop's thread for that, one driver at a time."""

    def __init__(self, machine: Machine, memory: LoopMemory, ring: Callable[[], None]) -> None:
        self._machine = machine
        self._memory = memory
        self._ring = ring
        self._names = list(machine.axes)
        self._under_way: dict[str, asyncio.Task[str | None]] = {}
        self._one = asyncio.Lock()

    def is_needed(self, name: str) -> bool:
        """Return whether an axis is disabled and its driver has to be opened anew."""
        status = self._memory.axis_status
        words = {n: int(status["device_status"][self._names.index(n)]) for n in self._beside(name)}
        return self._state(name) in DISABLED and needs_opening(words[name], list(words.values()))

    def may_clear(self, name: str) -> bool:
        """Return whether an axis is disabled and its device has a fault that it keeps till told."""
        driver = self._machine.drivers[self._machine.axes[name].driver]
        disabled = self._state(name) in DISABLED
        return driver.cls.clears_faults and disabled and bool(self._word(name) & CLEARABLE)

    async def clear_fault(self, name: str) -> bool:
        """Ask the device of an axis to forget its fault.

        Parameters
        ----------
        name
            The axis.

        Returns
        -------
        bool
            Whether the fault is gone, within CLEARED_S.

        Raises
        ------
        RefusedError
            Where the loop does not pass it on.
        """
        try:
            async with asyncio.timeout(ANSWER_S), self._one:
                await self._ask(name, clears=True)
        except TimeoutError as error:
            message = (
                f"axis {name}: reset refused: the loop did not ask the device within "
                f"{ANSWER_S:g} s to forget its fault; another driver may be on its way to be "
                f"opened. `motorctl reset {name}` tries again"
            )
            raise RefusedError(Code.STILL_FAULTY, message) from error
        deadline = time.monotonic() + CLEARED_S
        while self._word(name) & CLEARABLE:
            if time.monotonic() > deadline:
                return False
            await asyncio.sleep(POLL_S)
        return True

    async def open_anew(self, name: str) -> str:
        """Open the driver of an axis anew; who asks while it is being opened waits for the same.

        Parameters
        ----------
        name
            The axis.

        Returns
        -------
        str
            The driver's name.

        Raises
        ------
        RefusedError
            Where it is not open afterwards, and all of its axes are disabled; or where another
            axis of it is enabled, and nothing was done.
        """
        driver = self._machine.axes[name].driver
        if not self._machine.drivers[driver].cls.reopens:
            message = (
                f"axis {name}: reset refused: {self._trouble(name)}. Driver {driver} can be opened "
                "once in a process only: restart the daemon once the device is back"
            )
            raise RefusedError(Code.STILL_FAULTY, message)
        task = self._under_way.get(driver)
        if task is None:
            self._must_rest(name, driver)
            task = asyncio.create_task(self._order(name, driver))
            self._under_way[driver] = task
            task.add_done_callback(partial(self._forget, driver))
        done, _ = await asyncio.wait({task}, timeout=ANSWER_S)
        if not done:
            message = (
                f"axis {name}: driver {driver} is not open again after {ANSWER_S:g} s, and still "
                f"trying; `motorctl reset {name}` waits for it"
            )
            raise RefusedError(Code.STILL_FAULTY, message)
        if why := task.result():
            message = (
                f"axis {name}: reset refused: driver {driver} could not be opened anew: {why}. "
                f"Once that is mended, `motorctl reset {name}` tries again"
            )
            raise RefusedError(Code.STILL_FAULTY, message)
        return driver

    async def _order(self, name: str, driver: str) -> str | None:
        """Have the loop open a driver; return why it is not open, None where it is."""
        memory = self._memory
        async with self._one:
            self._must_rest(name, driver)  # others may have been opened meanwhile
            began = time.monotonic()
            await self._ask(name, clears=False)
            took_s = time.monotonic() - began
            told = bytes(memory.status["reopen_told"][0]).decode(errors="replace")
            failed = bool(memory.status["reopen_failed"][0])
        if failed:
            _log.warning("driver %s: not opened anew, after %.1f s: %s", driver, took_s, told)
            return told
        _log.info("driver %s: opened anew in %.1f s, for axis %s", driver, took_s, name)
        for note in told.splitlines():
            _log.warning("%s", note)
        return None

    async def _ask(self, name: str, *, clears: bool) -> None:
        """Give the loop's thread an order, and wait until it is done.

        Raises RefusedError where the loop ends before.
        """
        memory = self._memory
        number = memory.look_at(Word.REOPEN_ASKED) + 1
        await self._until_done(number - 1)  # which nobody may wait for any more
        memory.status["reopen_axis"][0] = self._names.index(name)
        memory.status["reopen_clears"][0] = clears
        memory.announce(Word.REOPEN_ASKED, number)
        self._ring()
        await self._until_done(number)

    async def _until_done(self, number: int) -> None:
        while self._memory.look_at(Word.REOPEN_DONE) != number:
            if self._memory.phase is not Phase.RUNNING:
                raise RefusedError(Code.STOPPING, ENDED)
            await asyncio.sleep(POLL_S)

    def _forget(self, driver: str, done: asyncio.Task[str | None]) -> None:
        del self._under_way[driver]
        if not done.cancelled():
            done.exception()  # perhaps nobody waits for it any more

    def _must_rest(self, name: str, driver: str) -> None:
        for other in self._beside(name):
            if self._state(other) not in DISABLED:
                message = (
                    f"axis {name}: reset refused: {self._trouble(name)}. Opening driver {driver} "
                    f"anew would take axis {other} along, which is enabled: `motorctl stop "
                    f"{other}` first"
                )
                raise RefusedError(Code.WRONG_STATE, message)

    def _beside(self, name: str) -> list[str]:
        driver = self._machine.axes[name].driver
        return [axis.name for axis in self._machine.axes.values() if axis.driver == driver]

    def _trouble(self, name: str) -> str:
        return device_message(self._word(name)).partition("; once the device")[0]

    def _word(self, name: str) -> int:
        return int(self._memory.axis_status["device_status"][self._names.index(name)])

    def _state(self, name: str) -> AxisState:
        return AxisState(int(self._memory.axis_status["state"][self._names.index(name)]))
