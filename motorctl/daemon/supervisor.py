"""The daemon: one supervisor for one loop process, from its birth to the closed log."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
from collections.abc import Awaitable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from motorctl.config.chosen_code import MayRun, allowed_by
from motorctl.config.machine import Machine
from motorctl.config.metadata import log_axes, log_metadata
from motorctl.config.model_keys import learns_the_same
from motorctl.daemon import learned
from motorctl.daemon.access import ControlSocket
from motorctl.daemon.commander import Commander
from motorctl.daemon.config_watch import ConfigWatch, named_files
from motorctl.daemon.early_stop import EarlyStop
from motorctl.daemon.ending import Ending
from motorctl.daemon.error_text import in_words
from motorctl.daemon.flight_recorder import FlightRecorder
from motorctl.daemon.journal import Journal
from motorctl.daemon.last_run import LastRun
from motorctl.daemon.log_keeper import LogKeeper
from motorctl.daemon.loop_process import LoopProcess
from motorctl.daemon.model_changes import ModelChanges
from motorctl.daemon.model_history import ModelHistory
from motorctl.daemon.notify import ServiceNotifier
from motorctl.daemon.paths import daemon_socket, run_file, state_file
from motorctl.daemon.recorder import Recorder
from motorctl.daemon.recording_watch import RecordingWatch
from motorctl.daemon.reopening import Reopening
from motorctl.daemon.report import Report
from motorctl.daemon.rotating_log import RotatingLog
from motorctl.daemon.server import ControlServer
from motorctl.errors import MotorctlError, RunError
from motorctl.kernels import CompilingBeside
from motorctl.log.folder import must_be_writable
from motorctl.loop import Phase, Verb, reasons
from motorctl.loop.compiled_beside import compile_beside
from motorctl.loop.compiling_time import compiling_words

BEAT_PERIOD_S = 0.02
WATCH_PERIOD_S = 0.05
NOTIFY_PERIOD_S = 0.5
TAKE_ON_S = 10.0
"""How long the recorder may take to begin the log of other models [s]. Larger keeps who asked
waiting for a disk that hangs; smaller gives up slow ones. By hand."""
NICENESS = -10
"""Before ordinary programs: a busy computer would starve it of its signs of life, which the loop
misses after half a second, and then stops every axis."""

_log = logging.getLogger("motorctl")


@dataclass(frozen=True)
class DaemonOptions:
    """What a user may set for one run; None: the usual."""

    socket: Path | None = None
    group: str | None = None
    """Whose members may connect; None: the group that the daemon runs in."""
    operators: str | None = None
    """Whose members may command, of those who may connect; None: all of them."""
    log_directory: Path | None = None
    may_run: MayRun | None = None
    """What of the code that models name which come later may be imported; None: what this user
    chose before."""


def run_daemon(machine: Machine, options: DaemonOptions) -> None:
    """Run the daemon in the foreground until SIGTERM or SIGINT.

    Raises
    ------
    UsageError
        Where it cannot start: log folder, control socket, or a processor that is not supported.
    RunError
        Where the loop refuses or dies, or the log cannot be completed.
    """
    with EarlyStop() as early:
        # Half of what a first start compiles, begun while the loop's process is not there yet.
        beside = CompilingBeside(partial(compile_beside, machine))
        with suppress(OSError):  # only root and a service may; it runs all the same
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
        try:
            asyncio.run(_run(machine, options, beside, early))
        finally:
            beside.end()


async def _run(
    machine: Machine, options: DaemonOptions, beside: CompilingBeside, early: EarlyStop
) -> None:
    directory = options.log_directory or machine.log_directory
    must_be_writable(directory, "log directory")
    control = ControlSocket(
        options.socket or daemon_socket(), options.group, options.operators, machine.source
    )
    try:
        may_run = options.may_run or allowed_by()
        await Supervisor(machine, control, directory, beside, may_run).live(early)
    finally:
        control.close()


class Supervisor:
    """Holds everything that lives as long as the daemon."""

    def __init__(
        self,
        machine: Machine,
        control: ControlSocket,
        directory: Path,
        beside: CompilingBeside,
        may_run: MayRun,
    ) -> None:
        self.machine = machine
        """What runs; another one once its models have changed."""
        self._own = machine
        """What the daemon was started with, and starts with the next time."""
        self._beside = beside
        self._control = control
        self._directory = directory
        self._state = state_file(machine.name)
        self._loop = LoopProcess(machine)
        self._report = Report(machine, self._loop.memory, control.path)
        reopening = Reopening(machine, self._loop.memory, self._loop.ring)
        self._flight = FlightRecorder(machine, self._loop.memory, directory, self._loop_facts)
        self._journal = Journal(machine, self._loop.memory)
        self._models = self._report.models = ModelChanges(
            machine,
            self._loop.memory,
            self._loop.send,
            self._announce_models,
            self._take_on,
            may_run,
            ModelHistory(machine.name),
            lambda: not self._flight.busy,
            lambda: self._loop.cpus,
        )
        self._commander = Commander(
            machine, self._loop.memory, self._report, reopening, self._look_at_axes, self._models
        )
        to_read = self._loop.memory.open_to_read
        leave = self._commander.excitations.leave
        self._server = ControlServer(control, self._commander.handle, to_read, leave)
        self._notifier = ServiceNotifier()
        self._ending = Ending(self._notifier)
        self._recorder: Recorder | None = None
        self._recording_watch: RecordingWatch | None = None
        self._log: RotatingLog | None = None
        self._keeper = LogKeeper(machine, directory)
        self._last_run = LastRun(machine, run_file(machine.name))
        self._config = self._report.config = ConfigWatch(machine.source, named_files(machine))
        self._report.flight, self._report.keeper = self._flight, self._keeper
        self._asked = asyncio.Event()

    async def live(self, early: EarlyStop) -> None:
        """Start, serve until asked to stop, stop; raises RunError with all that went wrong."""
        events = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup sets SIGHUP
                events.add_signal_handler(number, self._on_signal)
        if early.asked:
            self._asked.set()
        await self._server.start()
        beating = asyncio.create_task(self._beat())
        wrong: list[str] = []
        orderly = False
        try:
            wrong += self._told_at_once(await _problems(self._begin_and_serve()))
            # Whatever it was that failed: a loop that ticks can ramp its axes down.
            if not wrong or self._loop.ticks:
                not_stopped = self._told_at_once(await _problems(self._stop()))
                orderly = not not_stopped
                wrong += not_stopped
        finally:
            self._report.stopping = True
            self._report.loop_ended = "; ".join(wrong) if wrong and not orderly else None
            # From here on no tick feeds the watchdog: what a dead loop leaves takes its time, too.
            self._notifier.stopping("making outputs safe and closing the log")
            wrong += await _problems(asyncio.to_thread(self._loop.end))
            beating.cancel()
            died = "\n".join(wrong) if wrong and not orderly else None
            record = partial(self._flight.finish, died)
            wrong += await _problems(self._ending.wait_for("the flight record", record))
            wrong += await self._close_log()
            if orderly and self._recorder and self._recorder.rows_written:
                wrong += await self._keep_learned()
            wrong += await self._note_how_it_ended("; ".join(wrong))
            self._config.end()
            await self._server.close()
            self._loop.close()
            self._notifier.close()
        if wrong:
            raise RunError("\n".join(wrong))

    def _told_at_once(self, wrong: list[str]) -> list[str]:
        """Tell why a run that was under way ends: closing a large log may take its time."""
        if self._recorder is not None:
            for problem in wrong:
                _log.error("ending: %s", problem)
        return wrong

    def _on_signal(self) -> None:
        """Stop in order at the first signal, at once at the second; the log is kept anyhow."""
        if self._asked.is_set() and self._loop.alive:
            _log.warning("second signal to stop: emergency stop")
            with suppress(BufferError):  # the loop hangs: it will be killed
                self._loop.memory.post(Verb.ESTOP)
        self._asked.set()

    async def _beat(self) -> None:
        while True:
            self._loop.memory.beat()
            await asyncio.sleep(BEAT_PERIOD_S)

    async def _begin_and_serve(self) -> None:
        await self._begin()
        await self._serve()

    async def _begin(self) -> None:
        """Start the loop process and wait until it ticks."""
        # Before the loop ticks: removing many old logs may take longer than the ring holds.
        await asyncio.to_thread(self._keeper.begin)
        for remark in await asyncio.to_thread(self._last_run.begin):
            _log.warning("%s", remark)
        self._config.start()
        theta, remarks = await asyncio.to_thread(learned.take_up, self.machine, self._state)
        for remark in remarks:
            _log.info("%s", remark)
        note = self._last_run.loop_note
        await asyncio.to_thread(self._loop.start, theta, (self._control.lock_fd,), note)
        told = False
        while (phase := self._loop.phase) is not Phase.RUNNING:
            if self._asked.is_set():
                _log.info(
                    "told to stop after %.1f s of starting, before the first tick: no axis was "
                    "enabled",
                    self._report.uptime_s,
                )
                return
            self._loop.insist()
            if phase is Phase.COMPILING and not told:
                told = True
                self._notifier.status(self._report.preparing or "compiling the control loop")
                takes = compiling_words(len(self.machine.axes))
                _log.info("compiling the control loop (%s), or taking it from the cache", takes)
            await asyncio.sleep(WATCH_PERIOD_S)
        # In threads: the loop ticks already, and waits half a second for a sign of life.
        await asyncio.to_thread(self._beside.end)
        log = self._log = await asyncio.to_thread(self._new_log)
        recorder = self._recorder = self._report.recorder = Recorder(self._loop.memory, log)
        watch = RecordingWatch(recorder, self._loop.memory, self.machine.rate_hz)
        self._recording_watch = self._report.recording_watch = watch
        recorder.start()
        self._keeper.start(log, self._loop.cpus)
        self._announce(recorder)

    async def _serve(self) -> None:
        """Watch over the loop until somebody asks to stop."""
        told_at = 0.0
        while not self._asked.is_set() and self._recorder is not None:
            ticked = self._loop.insist()
            # The watchdog is fed by what the loop does, not by the passing of time.
            if ticked and time.monotonic() - told_at >= NOTIFY_PERIOD_S:
                told_at = time.monotonic()
                self._notifier.alive()
                self._notifier.status(self._report.summary())
            self._recorder.insist()
            self._look_at_axes()
            await asyncio.sleep(WATCH_PERIOD_S)

    def _look_at_axes(self) -> None:
        """Tell and keep what became of the axes; before each reset, too, or a fault were missed."""
        if self._recording_watch is not None:
            self._recording_watch.look()
            self._journal.tell_changes()
        self._flight.watch()
        self._models.watch()

    async def _stop(self) -> None:
        """Let every axis ramp down and the loop process end; raises RunError where it does not."""
        self._report.stopping = True
        self._notifier.stopping("stopping every axis")
        if self._loop.phase is not Phase.RUNNING:
            return
        _log.info("stopping every axis")
        with suppress(BufferError):  # the loop hangs: the deadline tells
            self._loop.memory.post(Verb.SHUTDOWN)
        deadline = time.monotonic() + self._loop.stop_timeout_s
        while self._loop.alive:
            if time.monotonic() > deadline:
                raise RunError(
                    f"the loop did not end within {self._loop.stop_timeout_s:.1f} s of being told "
                    "to; it is killed, and every driver is told to disable its outputs"
                )
            await asyncio.sleep(WATCH_PERIOD_S)
        self._loop.insist_on_order()

    async def _close_log(self) -> list[str]:
        """Make the log complete and return what went wrong with that."""
        if self._recorder is None:
            return []
        wrong: list[str] = []
        close = partial(self._recorder.finish, self._closing_facts)
        wrong += await _problems(self._ending.wait_for("closing the log", close))
        seen = self._recording_watch or self._recorder  # it sees what a write that hangs costs, too
        rows, lost = self._recorder.rows_written, seen.rows_lost
        if not wrong:
            _log.info("log %s: %d ticks, %d lost", self._recorder.path, rows, lost)
        why = seen.failure or self._recorder.lost_because
        if why is not None and (lost or not wrong):
            wrong.append(f"recording: {why}; {lost} rows were lost")
        finishing = asyncio.create_task(
            self._ending.wait_for("making logs of what was recorded", self._keeper.finish)
        )
        failed = await _problems(finishing)
        return wrong + (failed or finishing.result())

    async def _note_how_it_ended(self, why: str) -> list[str]:
        """Leave a note for the next start and return what went wrong with that."""
        noting = asyncio.create_task(
            self._ending.wait_for("the note of how it ended", partial(self._last_run.end, why))
        )
        failed = await _problems(noting)
        for remark in failed or noting.result():
            _log.warning("%s", remark)
        return failed

    async def _keep_learned(self) -> list[str]:
        if not learned.keeps_learned(self._own):
            return []
        # A copy: the memory is closed, even where a disk hangs and this is given up.
        estimates = self._loop.memory.axis_status["theta_hat"].copy()
        theta = dict(zip(self._own.axes, estimates, strict=True))
        others = [n for n in theta if not learns_the_same(self._own, self.machine, n)]
        save = partial(learned.save, self._own, theta, self._state, others)
        try:
            await self._ending.wait_for("saving the learned parameters", save)
        except (OSError, ValueError, RunError) as error:
            return [f"{self._state}: the learned parameters were not saved: {error}"]
        return []

    def _new_log(self) -> RotatingLog:
        machine = self.machine
        return RotatingLog(
            self._directory,
            machine.name,
            log_axes(machine),
            partial(_opening_of, machine),
            self._closing_facts,
            machine.recording,
            self._keeper.take,
        )

    def _announce_models(self, machine: Machine) -> None:
        """Say what the rows are like that come once other models run."""
        assert self._recorder is not None  # the loop ticks only while it records
        assert self._log is not None
        opening = partial(_opening_of, machine)
        begin = partial(self._log.change_models, log_axes(machine), opening)
        self._recorder.begin_other_models = begin

    def _take_on(self, machine: Machine) -> str | None:
        """Go on with other models; return the log that was begun for them, once it was."""
        for part in (self, self._report, self._flight, self._commander):
            part.machine = machine
        self._commander.models_row = self._loop.memory.models_row
        assert self._recorder is not None
        deadline = time.monotonic() + TAKE_ON_S
        while self._recorder.models_row != self._loop.memory.models_row:
            if time.monotonic() > deadline:
                return None
            time.sleep(WATCH_PERIOD_S)
        begun = self._log is not None and not self._log.trouble
        return self._recorder.path.name if begun else None

    def _closing_facts(self) -> dict[str, Any]:
        lost = self._recorder.rows_lost if self._recorder else 0
        return {"rows_lost": lost, **self._loop_facts()}

    def _loop_facts(self) -> dict[str, Any]:
        return {"loop": self._report.loop(), "motions": self._commander.history}

    def _announce(self, recorder: Recorder) -> None:
        machine = self.machine
        axes = f"{'axis' if len(machine.axes) == 1 else 'axes'} {', '.join(machine.axes)}"
        self._notifier.ready(f"{axes} at {machine.rate_hz:g} Hz")
        _log.info("%s: %s at %g Hz", machine.name, axes, machine.rate_hz)
        _log.info("control socket %s", self._control.path)
        _log.info("recording to %s", recorder.path)
        degraded = reasons(int(self._loop.memory.status["degraded"][0]))
        if degraded:
            _log.warning("DEGRADED, not real time: %s", "; ".join(degraded))
            if machine.loop.waits:
                _log.info(
                    "while this computer pauses the simulated machine waits; a real one would go on"
                )
        for note in self._loop.memory.notes:
            _log.warning("%s", note)


def _opening_of(machine: Machine) -> dict[str, Any]:
    """Return the metadata with which a log of this machine begins."""
    return {**log_metadata(machine), "clock": "wall"}


async def _problems(doing: Awaitable[object]) -> list[str]:
    """Await it and return what went wrong; a mistake of ours must not keep axes from their ramp."""
    try:
        await doing
    except MotorctlError as error:
        return [in_words(error)]
    except Exception as error:
        _log.exception("the supervisor failed")
        return [f"the supervisor failed: {in_words(error)}"]
    return []
