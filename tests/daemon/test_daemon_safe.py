"""A loop process that is gone: what is said of each driver's outputs is true."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from daemon_rig import DRIVER, Daemon, bench_config

from motorctl.config import load
from motorctl.daemon.loop_process import LoopProcess
from motorctl_sim import SimDriver

pytestmark = [pytest.mark.wall_clock(lanes=3), pytest.mark.bears_pauses, pytest.mark.slow]

released = threading.Event()


class Raises(SimDriver):
    """Cannot be made safe."""

    def safe(self) -> None:
        raise OSError("the cable is out")


class Hangs(SimDriver):
    """Does not come back until the test is over."""

    def safe(self) -> None:
        released.wait()


class SaysNothing(SimDriver):
    """Of a third party that knows of no `safe_sent`."""

    def safe(self) -> None:
        super().safe()
        self.safe_sent = None


class Refused(SimDriver):
    """Its device does not obey, which it says without a reason."""

    def safe(self) -> None:
        self.safe_sent = False


together = threading.Barrier(2)


class Meets(SimDriver):
    """Is only safe while another one is being made safe."""

    def safe(self) -> None:
        together.wait()
        super().safe()


class CannotBeMade(SimDriver):
    """Is not even there."""

    def __init__(self, *arguments: object) -> None:
        raise RuntimeError("no such device")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("broken", "cause"),
    [
        (Raises, "OSError: the cable is out"),
        (Hangs, "no answer within 2 s"),
        (CannotBeMade, "RuntimeError: no such device"),
        (
            SaysNothing,
            "it was told to zero and disable them, and does not say whether that was sent",
        ),
        (Refused, "what zeroes and disables them was not sent: it does not say why"),
    ],
)
def test_each_drivers_outputs_are_told_as_they_are(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    broken: type[SimDriver],
    cause: str,
) -> None:
    released.clear()
    (tmp_path / "bench.yaml").write_text(bench_config())
    machine = load(str(tmp_path / "bench.yaml"))
    good = machine.drivers["gantry"]
    axes = {**machine.axes, "x": machine.axes["x"].model_copy(update={"driver": "other"})}
    machine = replace(machine, drivers={"other": replace(good, cls=broken), "gantry": good})
    loop = LoopProcess(replace(machine, axes=axes))
    try:
        with caplog.at_level(logging.INFO, logger="motorctl"):
            loop.end()  # it never ran: all is done from here
    finally:
        released.set()
        loop.close()
    assert [record.getMessage() for record in caplog.records] == [
        f"driver other: its outputs may NOT be safe: {cause}",
        "driver gantry: the supervisor told it to zero and disable its outputs",
    ]


def test_no_driver_waits_for_another_to_be_made_safe(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    together.reset()
    (tmp_path / "bench.yaml").write_text(bench_config())
    machine = load(str(tmp_path / "bench.yaml"))
    both = replace(machine.drivers["gantry"], cls=Meets)
    axes = {**machine.axes, "x": machine.axes["x"].model_copy(update={"driver": "other"})}
    loop = LoopProcess(replace(machine, drivers={"other": both, "gantry": both}, axes=axes))
    try:
        with caplog.at_level(logging.INFO, logger="motorctl"):
            loop.end()
    finally:
        together.abort()
        loop.close()
    assert [record.getMessage() for record in caplog.records] == [
        f"driver {name}: the supervisor told it to zero and disable its outputs"
        for name in ("other", "gantry")
    ]


def test_nobody_is_told_that_a_port_which_is_not_there_made_its_device_safe(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    absent = tmp_path / "ttyUSB7"
    serial = f"{{type: serial, port: {absent}, baud: 3000000, mode: exchange}}"
    config = bench_config().replace(DRIVER, serial)
    (tmp_path / "bench.yaml").write_text(config)
    loop = LoopProcess(load(str(tmp_path / "bench.yaml")))
    try:
        with caplog.at_level(logging.INFO, logger="motorctl"):
            loop.end()
    finally:
        loop.close()
    assert [record.getMessage() for record in caplog.records] == [
        "driver gantry: its outputs may NOT be safe: what zeroes and disables them was not sent: "
        f"port {absent}: No such file or directory"
    ]


def test_a_service_that_ends_in_order_tells_of_outputs_that_may_not_be_safe(
    tmp_path: Path,
) -> None:
    config = bench_config().replace("{type: sim,", "{type: 'marking_driver:OutOfReach',")
    with Daemon(tmp_path, config, PYTHONPATH=str(Path(__file__).parent)) as daemon:
        status = daemon.end()
    assert status == 1
    assert "the loop could not make its outputs safe: the line is cut" in daemon.said
    assert "driver gantry: its outputs may NOT be safe" in daemon.said


@pytest.fixture
def immortal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[LoopProcess, int]]:
    """A loop process that gets no CPU to die on, and its number."""
    (tmp_path / "bench.yaml").write_text(bench_config())
    loop = LoopProcess(load(str(tmp_path / "bench.yaml")))
    monkeypatch.setattr(subprocess.Popen, "kill", lambda process: process.send_signal(0))
    loop.start({}, ())
    deadline = time.monotonic() + 30.0
    while not (pid := int(loop.memory.status["pid"][0])):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(pid, signal.SIGSTOP)
    yield loop, pid
    monkeypatch.undo()
    loop.end()
    loop.close()


@pytest.mark.slow
def test_outputs_are_made_safe_though_the_killed_loop_gets_no_cpu_to_die_on(
    immortal: tuple[LoopProcess, int], caplog: pytest.LogCaptureFixture
) -> None:
    loop, pid = immortal
    os.sched_setaffinity(pid, {min(os.sched_getaffinity(0))})
    with caplog.at_level(logging.INFO, logger="motorctl"):
        loop.end()
    told = [record.getMessage() for record in caplog.records]
    assert told[0].startswith("the loop process was killed and is not gone after 1 s")
    assert told[1:] == ["driver gantry: the supervisor told it to zero and disable its outputs"]
    assert os.sched_getaffinity(pid) == os.sched_getaffinity(0)
