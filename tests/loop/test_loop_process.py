"""The loop process: it runs, it obeys, it ends by itself, and it says why."""

import dataclasses
import signal
import time
from collections.abc import Callable
from pathlib import Path

import failing_drivers
import numpy as np
import pytest
import real_time
from loop_bench import gantry, with_axes, with_sim

from motorctl.config.machine import DriverSetup
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import LoopMemory, Phase, Reply, Verb, spawn

pytestmark = pytest.mark.wall_clock(lanes=3)

TIMEOUT_S = 200.0
"""Compiling on a busy machine takes its time."""


def slow_gantry():
    """Return the gantry at a rate that any machine keeps, with gains for it and wide limits."""
    machine = dataclasses.replace(with_sim(gantry()), rate_hz=200.0)
    gentle = {
        "gains": {"k1_1_s": 10.0, "gamma_d": 5.0},
        "limits": {"following_error": {"minimum_m": 0.2, "filter_time_s": 1.0}},
        "adaptation": {"enabled": False},
    }
    machine = with_axes(machine, **gentle)
    machine = with_axes(machine, ["x"], gains={"ks_v_s_m": 4.0})
    return with_axes(machine, ["y"], gains={"ks_v_s_m": 12.0})


def with_failing(cls, mark: Path):
    setup = DriverSetup("gantry", "failing", cls, cls.Options(mark=mark))
    return dataclasses.replace(slow_gantry(), drivers={"gantry": setup})


class Process:
    """A loop process and its supervisor, which beats only while it waits here."""

    def __init__(self, machine) -> None:
        self.memory = LoopMemory.create(list(machine.axes), 6, machine.rate_hz)
        real_time.begins()
        self.process = spawn(machine, self.memory)

    def __enter__(self) -> "Process":
        return self

    def __exit__(self, *_) -> None:
        self.process.kill()
        self.process.wait()
        self.memory.close()

    @property
    def phase(self) -> Phase:
        return self.memory.phase

    @property
    def message(self) -> str:
        return bytes(self.memory.status["message"][0]).rstrip(b"\0").decode()

    def wait(self, reached: Callable[[], bool], *, beat: bool = True) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not reached():
            assert time.monotonic() < deadline, (self.phase, self.message)
            if beat:
                self.memory.beat()
            time.sleep(0.01)

    def wait_until_running(self) -> None:
        self.wait(lambda: self.phase is Phase.RUNNING or self.process.poll() is not None)
        assert self.phase is Phase.RUNNING, self.message

    def wait_until_ended(self, *, beat: bool = True) -> int:
        self.wait(lambda: self.process.poll() is not None, beat=beat)
        return self.process.returncode

    def ask(self, verb: Verb, axis: int = 0) -> Reply | None:
        number = self.memory.post(verb, axis)
        self.wait(lambda: self.memory.reply(number) is not None)
        return self.memory.reply(number)


def test_the_loop_runs_obeys_and_shuts_down():
    with Process(slow_gantry()) as loop:
        loop.wait_until_running()
        assert loop.memory.status["pid"][0] == loop.process.pid
        assert loop.ask(Verb.START) is Reply.OK
        # What stops a service and what Ctrl-C sends is the supervisor's business.
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.process.send_signal(number)
        head = int(loop.memory.status["ring_head"][0])
        loop.wait(lambda: int(loop.memory.status["ring_head"][0]) > head + 20)
        assert loop.memory.axis_status["state"][0] == AxisState.IDLE
        loop.memory.post(Verb.SHUTDOWN)
        assert loop.wait_until_ended() == 0
        assert loop.phase is Phase.STOPPED
        assert loop.message == ""
        ticks, samples, lost = loop.memory.drain()
        assert lost == 0
        assert ticks["tick"][0] >= 0
        assert samples["state"][-1].tolist() == [AxisState.OFF, AxisState.OFF]
        assert (ticks["lateness_s"] >= 0.0).all()
        assert (ticks["turnaround_s"] > 0.0).all()


def test_the_loop_ends_by_itself_when_the_supervisor_falls_silent():
    with Process(slow_gantry()) as loop:
        loop.wait_until_running()
        assert loop.ask(Verb.START) is Reply.OK
        assert loop.wait_until_ended(beat=False) == 0
        assert loop.phase is Phase.STOPPED
        assert "no sign of life from the supervisor for 0.5 s" in loop.message
        _, samples, _ = loop.memory.drain()
        assert samples["state"][-1, 0] == AxisState.FAULT
        assert samples["fault"][-1, 0] == FaultCause.SUPERVISOR_LOST
        assert samples["command_v"][-1, 0] == 0.0


@pytest.mark.slow
def test_a_simulated_machine_that_waits_rides_out_a_pause_of_any_length():
    machine = slow_gantry()
    settings = machine.loop.model_copy(update={"without_realtime": "wait"})
    machine = with_axes(
        dataclasses.replace(machine, loop=settings),
        limits={"following_error": {"minimum_m": 0.001, "filter_time_s": 0.02}},
    )
    with Process(machine) as loop:
        loop.wait_until_running()
        assert loop.ask(Verb.START) is Reply.OK
        for _ in range(3):
            loop.process.send_signal(signal.SIGSTOP)
            time.sleep(0.3)  # three times the pause that trips a machine of metal
            loop.process.send_signal(signal.SIGCONT)
            head = int(loop.memory.status["ring_head"][0])
            loop.wait(lambda head=head: int(loop.memory.status["ring_head"][0]) > head + 20)
        ticks, samples, _ = loop.memory.drain()
        assert (np.diff(ticks["tick"]) == 1).all()
        assert loop.memory.status["skipped_periods"][0] >= 3 * (0.3 * machine.rate_hz - 2)
        assert loop.memory.axis_status["state"][0] == AxisState.IDLE
        assert np.abs(samples["following_error_m"][:, 0]).max() < 1e-3


@pytest.mark.slow
def test_without_real_time_the_loop_refuses_where_it_shall():
    # No machine has this CPU, so it cannot be pinned to it.
    machine = slow_gantry()
    settings = machine.loop.model_copy(update={"without_realtime": "refuse", "cpu": 4095})
    with Process(dataclasses.replace(machine, loop=settings)) as loop:
        assert loop.wait_until_ended() == 1
        assert loop.phase is Phase.FAILED
        assert "loop.without_realtime is 'refuse'" in loop.message
        assert "not pinned to a CPU" in loop.message
        assert "\n" not in loop.message
        assert loop.memory.status["ring_head"][0] == 0


@pytest.mark.parametrize(
    ("cls", "said"),
    [
        (failing_drivers.RaisesWhileReading, "OSError: the cable is out"),
        (failing_drivers.DoesNotOpen, "drivers.gantry: no device at the other end"),
    ],
)
def test_a_driver_that_breaks_ends_the_loop_with_safe_outputs(cls, said, tmp_path):
    mark = tmp_path / "mark"
    with Process(with_failing(cls, mark)) as loop:
        assert loop.wait_until_ended() == 1
        assert loop.phase is Phase.FAILED
        assert loop.message == said
        assert mark.read_text().startswith("safe\n")
