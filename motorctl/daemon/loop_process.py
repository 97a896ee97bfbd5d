"""The loop process as its supervisor sees it: born, alive, at an end; and safe afterwards."""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue

from motorctl.config.guard_keys import STALLED_S
from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.daemon.error_text import in_words
from motorctl.errors import RunError
from motorctl.loop import EndNote, LoopMemory, Phase, spawn
from motorctl.loop.fences import require_known_processor
from motorctl.loop.model_thread import ModelOrder
from motorctl.loop.tick import make_drivers

_log = logging.getLogger("motorctl")

KILL_TIMEOUT_S = 1.0
SAFE_TIMEOUT_S = 2.0
STOP_SLACK_S = 3.0


class LoopProcess:
    """The process that ticks, and the memory shared with it."""

    def __init__(self, machine: Machine) -> None:
        require_known_processor()
        self.machine = machine
        self.memory = LoopMemory.create(tuple(machine.axes), MOST_PARAMETERS, machine.rate_hz)
        self._bell_fd = os.eventfd(0)
        self._models_in, self._models_out = os.pipe2(os.O_CLOEXEC)
        self._process: subprocess.Popen[bytes] | None = None
        self._tick = -1
        self._progress_at = time.monotonic()

    @property
    def phase(self) -> Phase:
        """How far it is."""
        return self.memory.phase

    @property
    def alive(self) -> bool:
        """Whether the process is there."""
        return self._process is not None and self._process.poll() is None

    @property
    def cpus(self) -> frozenset[int]:
        """The CPUs that it may run on; those of a loop that is gone are none."""
        if self._process is not None:
            with contextlib.suppress(OSError):
                return frozenset(os.sched_getaffinity(self._process.pid))
        return frozenset()

    @property
    def message(self) -> str:
        """What the process left as its last word, or nothing."""
        text = bytes(self.memory.status["message"][0])
        return text.rstrip(b"\0").decode(errors="replace")

    @property
    def stop_timeout_s(self) -> float:
        """How long an orderly stop may take: the longest ramp, and some slack."""
        ramps = (
            limits.max_velocity_m_s / limits.stop.acceleration_m_s2
            + limits.stop.acceleration_m_s2 / limits.stop.jerk_m_s3
            for limits in (axis.limits for axis in self.machine.axes.values())
        )
        return 2.0 * max(ramps) + STOP_SLACK_S

    def start(
        self,
        learned: Mapping[str, Sequence[float]],
        keep_open: Sequence[int],
        end_note: EndNote | None = None,
    ) -> None:
        """Start the process.

        Parameters
        ----------
        learned
            theta_hat (n,) to start from, by axis.
        keep_open
            File descriptors that it holds as long as it lives.
        end_note
            What it leaves where it ends without this process.

        Raises
        ------
        RunError
            Where it does not start.
        """
        try:
            self._process = spawn(
                self.machine,
                self.memory,
                learned=learned,
                keep_open=keep_open,
                bell_fd=self._bell_fd,
                end_note=end_note,
                models_fd=self._models_in,
            )
        except OSError as error:
            raise RunError(f"the loop process did not start: {error.strerror}") from error

    def ring(self) -> None:
        """Wake the thread of the process that opens drivers anew."""
        os.eventfd_write(self._bell_fd, 1)

    def send(self, order: ModelOrder) -> None:
        """Send an order for other models; waits until the process has taken most of it.

        Raises RunError where it cannot be sent.
        """
        sent = memoryview(pickle.dumps(order, pickle.HIGHEST_PROTOCOL))
        try:
            while sent:
                sent = sent[os.write(self._models_out, sent) :]
        except OSError as error:
            raise RunError(f"the loop process takes no models: {error.strerror}") from error

    @property
    def ticks(self) -> bool:
        """Whether it runs and does not stand still."""
        moved = int(self.memory.status["tick"][0]) != self._tick
        recent = time.monotonic() - self._progress_at <= STALLED_S
        return self.alive and self.phase is Phase.RUNNING and (moved or recent)

    def insist(self) -> bool:
        """Return whether it has ticked since the last call.

        Raises RunError with the reason where the process is gone or no longer ticks.
        """
        if not self.alive:
            raise RunError(self._why_it_ended())
        tick, now = int(self.memory.status["tick"][0]), time.monotonic()
        running = self.phase is Phase.RUNNING
        moved = running and tick != self._tick
        self._tick = tick
        if moved or not running:
            self._progress_at = now
        elif now - self._progress_at > STALLED_S:
            stood_s = now - self._progress_at
            raise RunError(f"the loop has not ticked for {stood_s:.1f} s; limit {STALLED_S:g} s")
        return moved

    def insist_on_order(self) -> None:
        """Raise RunError with the reason where the process ended, but not in order."""
        if self.phase is not Phase.STOPPED:
            raise RunError(self._why_it_ended())

    def end(self) -> None:
        """Make sure that the process is gone and the outputs are safe.

        A loop that ended in order has seen to its outputs. For any other it is done from here, and
        what came of it is told driver by driver: nothing is called safe that may not be.
        """
        if not self.alive and self.phase is Phase.STOPPED:
            return
        if self._process is not None and not self._killed(self._process):
            _log.error(
                "the loop process was killed and is not gone after %g s: what keeps its CPU? "
                "Its drivers are told to disable all the same",
                KILL_TIMEOUT_S,
            )
        self.memory.phase = Phase.FAILED  # it can no longer say so itself
        for name, problem in self._make_safe().items():
            if problem is None:
                _log.warning(
                    "driver %s: the supervisor told it to zero and disable its outputs", name
                )
            else:
                _log.error("driver %s: its outputs may NOT be safe: %s", name, problem)

    def _killed(self, process: subprocess.Popen[bytes]) -> bool:
        """Kill the process and return whether it is gone; it never runs its own code again."""
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        # It needs time to die, of a CPU that may be the very thing that it did not get.
        with contextlib.suppress(OSError):
            for thread in Path(f"/proc/{process.pid}/task").iterdir():
                os.sched_setaffinity(int(thread.name), os.sched_getaffinity(0))
        try:
            process.wait(KILL_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return False
        return True

    def _make_safe(self) -> dict[str, str | None]:
        """Tell all drivers at once to zero and disable their outputs.

        Returns
        -------
        dict
            Why a driver's outputs may not be safe, None where it says that all was sent; in the
            order of the configuration.
        """
        names = list(dict.fromkeys(axis.driver for axis in self.machine.axes.values()))
        outcomes: dict[str, str | None] = dict.fromkeys(
            names, f"no answer within {SAFE_TIMEOUT_S:g} s"
        )
        answers: SimpleQueue[tuple[str, str | None]] = SimpleQueue()
        for name in names:
            # One that hangs keeps neither the others from being made safe, nor the process alive.
            work = threading.Thread(target=self._answer_safe, args=(name, answers), daemon=True)
            work.start()
        with contextlib.suppress(Empty):
            for _ in names:
                # Counted from the last answer: they share a lock, and many may need longer.
                name, problem = answers.get(timeout=SAFE_TIMEOUT_S)
                outcomes[name] = problem
        return outcomes

    def _answer_safe(self, name: str, answers: SimpleQueue[tuple[str, str | None]]) -> None:
        """Make one driver's outputs safe, and put why they may not be, or None."""
        alone = replace(self.machine, drivers={name: self.machine.drivers[name]})
        try:
            driver = make_drivers(alone)[name]
            driver.safe()
            sent, why = driver.safe_sent, driver.safe_failed
        except Exception as error:  # a driver may break its contract in any way
            answers.put((name, in_words(error)))
            return
        problem = None
        if sent is None:
            problem = "it was told to zero and disable them, and does not say whether that was sent"
        elif sent is not True:
            problem = f"what zeroes and disables them was not sent: {why or 'it does not say why'}"
        answers.put((name, problem))

    def close(self) -> None:
        """Release the memory."""
        for descriptor in (self._bell_fd, self._models_in, self._models_out):
            os.close(descriptor)
        self.memory.close()

    def _why_it_ended(self) -> str:
        status = 0 if self._process is None else self._process.returncode
        if self.phase is Phase.FAILED:
            return self.message
        cause = f"killed by {signal.Signals(-status).name}" if status < 0 else f"status {status}"
        said = f": {self.message}" if self.message else ""
        return f"the loop process ended ({cause}){said}"
