"""Another process compiles while this one goes on; its fate is nobody's."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from numba.core.bytecode import FunctionIdentity

from motorctl.kernels import CompilingBeside

PATIENCE_S = 100.0


def wait_until(met):
    deadline = time.monotonic() + PATIENCE_S
    while not met():
        assert time.monotonic() < deadline
        time.sleep(0.01)


class Work:
    """Writes down which process does it, and then fails or hangs if it is told to."""

    def __init__(self, mark: Path, then=lambda: None):
        self.mark = mark
        self._then = then

    def __call__(self):
        with self.mark.open("a") as marks:
            marks.write(f"{os.getpid()}\n")
        self._then()

    def done_by(self) -> int:
        """Return the process that has begun it, once one has."""
        wait_until(lambda: self.mark.exists() and self.mark.read_text().endswith("\n"))
        (pid,) = self.mark.read_text().split()
        return int(pid)


def hang():
    time.sleep(1000.0)


def fail():
    raise OSError("no")


@pytest.fixture
def mark(tmp_path):
    return tmp_path / "mark"


@pytest.mark.parametrize("then", [lambda: None, fail])
def test_another_process_does_the_work_and_is_gone_at_the_end(then, mark):
    work = Work(mark, then)
    beside = CompilingBeside(work)
    child = work.done_by()
    assert child != os.getpid()
    beside.end()
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


def test_one_that_hangs_is_ended_and_may_be_ended_again(mark):
    work = Work(mark, hang)
    beside = CompilingBeside(work)
    child = work.done_by()
    beside.end()
    beside.end()
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


def test_where_no_process_can_be_made_nothing_is_done_beside(monkeypatch, mark):
    def refuse() -> int:
        raise OSError("too many processes")

    monkeypatch.setattr(os, "fork", refuse)
    CompilingBeside(Work(mark)).end()
    assert not mark.exists()


def test_its_functions_have_other_numbers_than_those_of_this_process(mark):
    """Where names of compiled functions agree, one is linked for the other."""

    def number() -> int:
        return FunctionIdentity.from_function(hang).unique_id

    def write() -> None:
        mark.write_text(str(number()))

    beside = CompilingBeside(write)
    wait_until(lambda: mark.exists() and mark.read_text())
    beside.end()
    assert abs(int(mark.read_text()) - number()) > 1000


def test_on_one_cpu_nothing_is_done_beside(monkeypatch, mark):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    CompilingBeside(Work(mark)).end()
    time.sleep(0.1)
    assert not mark.exists()


def test_it_gets_as_much_of_a_busy_computers_time_as_the_process_that_it_works_for(mark):
    beside = CompilingBeside(
        lambda: mark.write_text(f"{os.getpriority(os.PRIO_PROCESS, 0)}\n") and None
    )
    wait_until(lambda: mark.exists() and mark.read_text().endswith("\n"))
    beside.end()
    assert int(mark.read_text()) == os.getpriority(os.PRIO_PROCESS, 0)


def test_one_that_has_ended_where_nobody_minds_children_ends_nobody_else(monkeypatch, mark):
    ended = []
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        beside = CompilingBeside(Work(mark))
        child = Work(mark).done_by()
        wait_until(lambda: not Path(f"/proc/{child}").exists())
        monkeypatch.setattr(os, "kill", lambda *told: ended.append(told))
        beside.end()
    finally:
        signal.signal(signal.SIGCHLD, before)
    assert ended == []


KILLED = """
import sys, time
sys.path[:] = {path!r}
from pathlib import Path
from test_kernels_beside import Work, hang
from motorctl.kernels import CompilingBeside
CompilingBeside(Work(Path({mark!r}), hang))
time.sleep(1000.0)
"""


def test_it_dies_with_the_process_that_it_works_for(mark):
    path = [str(Path(__file__).parent), *sys.path]
    with subprocess.Popen([sys.executable, "-c", KILLED.format(path=path, mark=str(mark))]) as one:
        child = Work(mark).done_by()
        one.send_signal(signal.SIGKILL)
    wait_until(lambda: not _lives(child))


def _lives(pid: int) -> bool:
    with suppress(OSError):  # init may be slow to take it away: it is a zombie then
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False
