"""Drivers are prepared in another process while the tick is compiled; its fate is nobody's."""

import dataclasses
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from failing_drivers import RaisesWhileReading
from loop_bench import gantry

from motorctl.config.machine import DriverSetup
from motorctl.loop import prepared_beside as room
from motorctl.loop.prepared_beside import prepared_beside


class Told(RaisesWhileReading):
    """Writes down which process prepared it."""

    def prepare(self) -> None:
        """Write the process' number."""
        with self.mark.open("a") as marks:
            marks.write(f"{os.getpid()}\n")


class Raises(Told):
    """Fails when it is prepared."""

    def prepare(self) -> None:
        """Write the process' number and fail."""
        super().prepare()
        raise OSError("no")


class Hangs(Told):
    """Never ends when it is prepared."""

    def prepare(self) -> None:
        """Write the process' number and hang."""
        super().prepare()
        time.sleep(1000.0)


def machine_with(cls, mark: Path):
    setup = DriverSetup("gantry", "failing", cls, cls.Options(mark=mark))
    return dataclasses.replace(gantry(), drivers={"gantry": setup})


def prepared_by(mark: Path) -> list[int]:
    return [int(line) for line in mark.read_text().splitlines()]


@pytest.mark.parametrize("cls", [Told, Raises])
def test_another_process_prepares_the_drivers_and_is_gone_at_the_end(cls, tmp_path):
    mark = tmp_path / "mark"
    with prepared_beside(machine_with(cls, mark)):
        pass
    (child,) = prepared_by(mark)
    assert child != os.getpid()
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


def test_one_that_hangs_is_waited_for_so_long_and_no_longer(monkeypatch, tmp_path):
    monkeypatch.setattr(room, "LATER_S", 0.1)
    mark = tmp_path / "mark"
    with prepared_beside(machine_with(Hangs, mark)):
        while not (mark.exists() and prepared_by(mark)):
            time.sleep(0.01)
    with pytest.raises(ProcessLookupError):
        os.kill(prepared_by(mark)[0], 0)


def test_what_fails_meanwhile_leaves_no_process(tmp_path):
    mark = tmp_path / "mark"
    with suppress(ValueError), prepared_beside(machine_with(Hangs, mark)):
        while not (mark.exists() and prepared_by(mark)):
            time.sleep(0.01)
        raise ValueError
    with pytest.raises(ProcessLookupError):
        os.kill(prepared_by(mark)[0], 0)


def test_where_no_process_can_be_made_the_start_goes_on(monkeypatch, tmp_path):
    def refuse() -> int:
        raise OSError("too many processes")

    monkeypatch.setattr(os, "fork", refuse)
    with prepared_beside(machine_with(Told, tmp_path / "mark")):
        pass
    assert not (tmp_path / "mark").exists()


KILLED = """
import os, sys, time
sys.path[:] = {path!r}
from pathlib import Path
from test_loop_prepared_beside import Hangs, machine_with
from motorctl.loop.prepared_beside import prepared_beside
with prepared_beside(machine_with(Hangs, Path({mark!r}))):
    time.sleep(1000.0)
"""


def test_it_dies_with_the_process_that_it_works_for(tmp_path):
    mark = tmp_path / "mark"
    path = [str(Path(__file__).parent), *sys.path]
    with subprocess.Popen([sys.executable, "-c", KILLED.format(path=path, mark=str(mark))]) as loop:
        deadline = time.monotonic() + 100.0
        while not (mark.exists() and prepared_by(mark)):
            assert loop.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.01)
        loop.send_signal(signal.SIGKILL)
    (child,) = prepared_by(mark)
    while _lives(child):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def _lives(pid: int) -> bool:
    try:  # init may be slow to take it away: it is a zombie then
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
