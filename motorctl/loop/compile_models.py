"""Compile what other models need in a process of its own, before they are sent.

It reads two machines from its standard input, the one that runs and the one that shall, and writes
what the running loop then takes over to its standard output. It tries the change before, on a
machine that is not connected to anything.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Collection

from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.errors import MotorctlError, RunError
from motorctl.loop.other_models import OtherModels, other_models
from motorctl.loop.runner import VirtualRun
from motorctl.loop.shared import LoopMemory
from motorctl.loop.succession import Succession
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import Verb
from motorctl.loop.warm_up import Unconnected

NICENESS = 10
"""It has time: the machine runs meanwhile. By hand."""
TRIED_TICKS = 400
"""Before and after the change. More cost time, fewer leave less of a tick tried. By hand."""


BEGIN = f"""import os, sys
others = os.sched_getaffinity(0) - set(map(int, sys.argv[1:]))
os.sched_setaffinity(0, others or os.sched_getaffinity(0))
os.nice({NICENESS})
from {__name__} import main
sys.exit(main())"""
"""What the process is started with: it leaves CPUs to the loop before it imports anything."""


def compile_models(before: Machine, after: Machine, keep_off: Collection[int] = ()) -> OtherModels:
    """Make in a process of its own what the loop of `before` needs for the models of `after`.

    Parameters
    ----------
    before, after
        Two machines that differ in models alone.
    keep_off
        The loop's CPUs: where the kernel works for this process, as at its end, the loop waits.

    Raises
    ------
    RunError
        Where that fails, with the reason.
    """
    sent = pickle.dumps(sys.path) + pickle.dumps((before, after))
    done = subprocess.run(
        [sys.executable, "-P", "-c", BEGIN, *map(str, keep_off)],
        input=sent,
        capture_output=True,
        check=False,
    )
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise RunError(
            f"the models could not be compiled: {said[-1] if said else 'no reason told'}"
        )
    made: OtherModels = pickle.loads(done.stdout)
    return made


def try_models(before: Machine, models: OtherModels) -> None:
    """Let the axes of a machine without devices hold under one model, then under the other."""
    memory = LoopMemory.create(list(before.axes), MOST_PARAMETERS, before.rate_hz)
    run = VirtualRun(Tick(before, memory, virtual=True, driver_class=Unconnected))
    for i in range(len(before.axes)):
        memory.post(Verb.START, i)
    run.advance(TRIED_TICKS)
    succession = Succession(run.tick, models)
    run.tick.successor = succession
    run.advance(TRIED_TICKS)
    memory.post(Verb.SHUTDOWN)
    run.advance(TRIED_TICKS)
    memory.close()
    if succession.outcome.refused:
        raise RunError(succession.outcome.refused)


def main() -> int:
    """Return the exit status; a failure is told in the last line of the standard error."""
    sys.path[:] = pickle.load(sys.stdin.buffer)
    before, after = pickle.load(sys.stdin.buffer)
    try:
        models = other_models(before, after)
        made = pickle.dumps(models, pickle.HIGHEST_PROTOCOL)
        try_models(before, models)
    except MotorctlError as error:
        sys.stderr.write(f"{' '.join(str(error).split())}\n")
        return 1
    sys.stdout.buffer.write(made)
    return 0
