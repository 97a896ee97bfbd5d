"""What the machine does not give of real time is told, and refused where that is asked for."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from motorctl.errors import RunError
from motorctl.hal import Claim
from motorctl.loop import Degraded, isolated_cpus, reasons
from motorctl.loop.realtime import NEEDED

ENTER = """
import gc, os, resource, sys
from motorctl.config.keys import LoopSettings
from motorctl.loop.realtime import enter_realtime

if sys.argv[1] == "unprivileged":
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
    if os.geteuid() == 0:
        os.setgroups([])
        os.setgid(65534)
        os.setuid(65534)
cpu = int(sys.argv[2]) if len(sys.argv) > 2 else None
settings = LoopSettings(cpu=cpu, priority=10)
degraded = enter_realtime(settings)
policy, cpus = os.sched_getscheduler(0), len(os.sched_getaffinity(0))
locked = next(int(l.split()[1]) for l in open("/proc/self/status") if l.startswith("VmLck"))
print(int(degraded), policy == os.SCHED_FIFO, cpus, locked, gc.isenabled())
"""


def enter(*arguments: str) -> tuple[Degraded, bool, int, int, bool]:
    done = subprocess.run(
        [sys.executable, "-c", ENTER, *arguments], capture_output=True, text=True, check=True
    )
    degraded, fifo, cpus, locked, collecting = done.stdout.split()
    return Degraded(int(degraded)), fifo == "True", int(cpus), int(locked), collecting == "True"


def test_an_unprivileged_process_is_told_what_it_does_without():
    degraded, fifo, _, locked, collecting = enter("unprivileged")
    assert degraded & Degraded.NO_FIFO
    assert degraded & Degraded.NO_LOCKED_MEMORY
    assert not fifo
    assert locked == 0
    assert not collecting


def test_what_is_reported_is_what_the_process_has():
    degraded, fifo, cpus, locked, collecting = enter("as it is")
    assert fifo is not bool(degraded & Degraded.NO_FIFO)
    assert (cpus == 1) is not bool(degraded & Degraded.NO_PINNING)
    assert (locked > 0) is not bool(degraded & Degraded.NO_LOCKED_MEMORY)
    assert not collecting


def test_a_cpu_that_there_is_not_cannot_be_pinned_to():
    degraded, *_ = enter("as it is", "4095")
    assert degraded & Degraded.NO_PINNING


TAKE_TURNS = """
import os, sys
from motorctl.config.keys import LoopSettings
from motorctl.hal import Claim
from motorctl.loop import realtime
from motorctl.loop.realtime import enter_realtime

# loops of tests beside this one take no seat among these
realtime.Claim = lambda device, outputs: Claim(f"{device} of {sys.argv[1]}", outputs)

os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-2:])
degraded = enter_realtime(LoopSettings(priority=10))
os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
print(int(degraded), *os.sched_getaffinity(0), flush=True)
sys.stdin.read()
"""


@pytest.mark.slow
def test_loops_beside_each_other_take_cpus_of_their_own_and_tell_where_there_are_too_few():
    loops, told = [], []
    cpus = max(2, len(isolated_cpus()))
    for _ in range(2 * cpus):
        loop = subprocess.Popen(
            [sys.executable, "-c", TAKE_TURNS, str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        loops.append(loop)
        degraded, cpu = map(int, loop.stdout.readline().split())
        told.append((cpu, bool(degraded & Degraded.CPU_SHARED)))
    for loop in loops:
        loop.communicate("")
    alone = [cpu for cpu, shared in told if not shared]
    assert len(set(alone)) == len(alone)
    assert all(shared for _, shared in told[cpus:])
    # the second ones are spread as the first ones are
    assert len({cpu for cpu, _ in told[cpus:]}) == cpus


@pytest.mark.slow
def test_a_cpu_that_is_configured_is_taken_though_another_loop_has_it():
    cpu = min(os.sched_getaffinity(0))
    with contextlib.ExitStack() as held:
        with contextlib.suppress(RunError):  # another loop of this computer has it already
            held.callback(Claim(f"CPU {cpu}", ["loop 0"]).release)
        degraded, _, cpus, *_ = enter("as it is", str(cpu))
    assert cpus == 1
    assert degraded & Degraded.CPU_SHARED


@pytest.mark.parametrize("bit", list(Degraded))
def test_every_shortcoming_has_its_words(bit):
    (text,) = reasons(bit)
    assert text
    assert "\n" not in text


def test_several_shortcomings_are_all_told():
    assert len(reasons(NEEDED)) == 3
    assert reasons(0) == []


BEGIN = """
import os, threading
from loop_bench import gantry, with_sim
from motorctl.loop import process
from motorctl.loop.shared import LoopMemory
from motorctl.loop.tick import Tick

policies = {}

def noting(name, act):
    def noted(*arguments, **options):
        policies[name] = os.sched_getscheduler(0)
        return act(*arguments, **options)
    return noted

machine = with_sim(gantry())
memory = LoopMemory.create(list(machine.axes), 32, machine.rate_hz)
Tick.open = noting("open", Tick.open)
threading.Thread.start = noting("thread", threading.Thread.start)
process.run_wall = noting("ticks", lambda *_: None)
models_fd, _ = os.pipe()
process._run(process.Orders(machine, memory.fd, {}, os.eventfd(0), None, models_fd), memory)
print(*(policies[name] == os.SCHED_FIFO for name in ("open", "thread", "ticks")))
"""


@pytest.mark.slow
def test_what_takes_long_is_done_before_the_loop_has_its_priority():
    if enter("as it is")[0] & Degraded.NO_FIFO:
        pytest.skip("this user may not take a real-time priority")
    support = Path(__file__).parents[1] / "support"
    done = subprocess.run(
        [sys.executable, "-c", BEGIN],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(support)},
    )
    assert done.stdout.split() == ["False", "False", "True"], done.stderr
