"""The real loop process for a while, its axes following their programs, every tick logged."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motorctl.config.machine import Machine
from motorctl.config.metadata import log_axes, log_metadata
from motorctl.daemon.axis_faults import faults_of
from motorctl.daemon.commander import Commander
from motorctl.daemon.loop_process import LoopProcess
from motorctl.daemon.protocol import AxisCommand, RefusedError
from motorctl.daemon.recorder import Recorder
from motorctl.daemon.report import Report
from motorctl.errors import RunError
from motorctl.latency.host import stolen_s
from motorctl.log import LogWriter
from motorctl.log.sample import AxisState
from motorctl.loop import Phase, Verb, reasons
from motorctl.loop.realtime import chosen_cpu

BEAT_PERIOD_S = 0.02
LOOK_PERIOD_S = 0.05
NO_SOCKET = Path()


@dataclass(frozen=True)
class LoopRun:
    """What the loop process itself told, and where its log stands."""

    log: Path
    first_tick: int
    """From here on the axes followed their programs."""
    last_tick: int
    """Until here; the log goes on until every axis has stopped."""
    ended_at_tick: int
    overruns: int
    skipped_periods: int
    rows_lost: int
    stolen_share: float
    """Of the time, what a hypervisor took of the loop's CPU, 0 to 1."""
    degraded: list[str]
    refusals: list[str]
    """Why an axis did not do what it should have."""


def run_loop(
    machine: Machine,
    log: Path,
    duration_s: float,
    *,
    moving: bool,
    progress: Callable[[float], None],
) -> LoopRun:
    """Run the loop process for so long and log every tick.

    Without `moving` the axes stay off: the loop reads, computes and writes zeros. Raises RunError
    where the loop fails or a real axis trips; every axis is stopped then, and the log is complete.
    """
    return asyncio.run(_Session(machine, log).live(duration_s, moving, progress))


class _Session:
    """A supervisor without a socket."""

    def __init__(self, machine: Machine, log: Path) -> None:
        self._machine = machine
        self._loop = LoopProcess(machine)
        self._memory = self._loop.memory
        self._report = Report(machine, self._memory, NO_SOCKET)
        self._commander = Commander(machine, self._memory, self._report)
        self._log = log
        self._recorder: Recorder | None = None
        self._refusals: dict[str, None] = {}

    async def live(
        self, duration_s: float, moving: bool, progress: Callable[[float], None]
    ) -> LoopRun:
        beating = asyncio.create_task(self._beat())
        try:
            recorder = await self._begin()
            if moving:
                await self._home()
                await self._keep_moving()
            first, cpu = self._tick, chosen_cpu(self._machine.loop)
            began, stolen = time.monotonic(), stolen_s(cpu)
            while (passed := time.monotonic() - began) < duration_s:
                self._loop.insist()
                if moving:
                    await self._keep_moving()
                progress(passed / duration_s)
                await asyncio.sleep(min(LOOK_PERIOD_S, duration_s - passed))
            if moving:
                await self._see_trips()
            last = self._tick
            stolen_share = (stolen_s(cpu) - stolen) / (time.monotonic() - began)
            await self._stop()
            self._loop.insist_on_order()
        finally:
            await self._stop()
            await asyncio.to_thread(self._loop.end)
            beating.cancel()
            status = self._memory.status[0].copy()
            if self._recorder is not None:
                await asyncio.to_thread(self._recorder.finish, self._closing_facts)
            self._loop.close()
        if recorder.failure:
            raise RunError(f"recording: {recorder.failure}")
        return LoopRun(
            log=recorder.path,
            first_tick=first,
            last_tick=last,
            ended_at_tick=int(status["tick"]),
            overruns=int(status["overruns"]),
            skipped_periods=int(status["skipped_periods"]),
            rows_lost=recorder.rows_lost,
            stolen_share=stolen_share,
            degraded=reasons(int(status["degraded"])),
            refusals=list(self._refusals),
        )

    @property
    def _tick(self) -> int:
        return int(self._memory.status["tick"][0])

    async def _beat(self) -> None:
        while True:
            self._memory.beat()
            await asyncio.sleep(BEAT_PERIOD_S)

    async def _begin(self) -> Recorder:
        await asyncio.to_thread(self._loop.start, {}, ())
        while self._loop.phase is not Phase.RUNNING:
            self._loop.insist()
            await asyncio.sleep(LOOK_PERIOD_S)
        # In a thread: the loop ticks already, and waits half a second for a sign of life.
        recorder = Recorder(self._memory, await asyncio.to_thread(self._new_log))
        recorder.start()
        self._recorder = self._report.recorder = recorder
        return recorder

    def _new_log(self) -> LogWriter:
        metadata = {**log_metadata(self._machine), "clock": "wall"}
        return LogWriter(self._log, metadata, log_axes(self._machine))

    async def _home(self) -> None:
        for name, axis in self._machine.axes.items():
            if axis.homing.method == "absolute":
                continue
            await self._ask("start", name)
            await self._ask("home", name)
            deadline = time.monotonic() + (axis.homing.timeout_s or 0.0)
            while self._state(name) is AxisState.HOMING and time.monotonic() < deadline:
                self._loop.insist()
                await self._see_trips()
                await asyncio.sleep(LOOK_PERIOD_S)

    async def _keep_moving(self) -> None:
        """Start what stands: after its program an axis follows it again."""
        await self._see_trips()
        for name, axis in self._machine.axes.items():
            state = self._state(name)
            if state is AxisState.OFF or (state is AxisState.IDLE and axis.program):
                await self._ask("start", name)

    async def _see_trips(self) -> None:
        """Reset a simulated axis that tripped; where a real one did, give up.

        Whether a machine may move again is for people to say. Where nothing real moves, a pause of
        this computer that trips an axis is just what is to be measured.
        """
        trips = {
            name: f"axis {name} tripped: {fault['message']}"
            for name, fault in faults_of(self._machine, self._memory.axis_status).items()
            if fault
        }
        if trips and not all(setup.cls.simulated for setup in self._machine.drivers.values()):
            raise RunError(f"{'; '.join(trips.values())}; every axis was stopped")
        for name, told in trips.items():
            self._refusals[f"{told}; it is simulated, and was started again"] = None
            await self._ask("reset", name)

    async def _ask(self, command: str, axis: str) -> None:
        try:
            await self._commander.handle(AxisCommand.model_validate({"do": command, "axis": axis}))
        except RefusedError as error:
            # An axis may trip between the look and the command; then the next look tells.
            if self._state(axis) is not AxisState.FAULT:
                self._refusals[error.message] = None

    def _state(self, name: str) -> AxisState:
        index = list(self._machine.axes).index(name)
        return AxisState(int(self._memory.axis_status["state"][index]))

    async def _stop(self) -> None:
        """Let every axis ramp down and the loop process end; `end` does it by force otherwise."""
        if not self._loop.alive or self._loop.phase is not Phase.RUNNING:
            return
        with suppress(BufferError):
            self._memory.post(Verb.SHUTDOWN)
        deadline = time.monotonic() + self._loop.stop_timeout_s
        while self._loop.alive and time.monotonic() < deadline:
            await asyncio.sleep(LOOK_PERIOD_S)

    def _closing_facts(self) -> dict[str, Any]:
        assert self._recorder is not None
        return {
            "rows_lost": self._recorder.rows_lost,
            "loop": self._report.loop(),
            "motions": self._commander.history,
        }
