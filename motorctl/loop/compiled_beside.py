"""What another process compiles of a machine while the loop's is on its way: starts wait less."""

from __future__ import annotations

import time
from contextlib import suppress
from functools import partial

from motorctl.config.machine import Machine
from motorctl.garbage import collecting_seldom
from motorctl.kernels import CompilingBeside
from motorctl.loop.tick import make_drivers
from motorctl.loop.warm_up import analyse_steps, warm_up


def compile_beside(machine: Machine) -> None:
    """Leave in the cache of kernels what the loop needs last: the laws' part, and the drivers'.

    What fails is told by the process that needs it.
    """
    with collecting_seldom():
        with suppress(Exception):
            analyse_steps(machine)
        for driver in make_drivers(machine).values():
            with suppress(Exception):
                driver.prepare()


def compile_machine(machine: Machine) -> float:
    """Leave in the cache of kernels all that a start of this machine takes from it.

    In two processes, as a start does. No device is opened.

    Returns
    -------
    float
        How long it took [s].
    """
    began_s = time.monotonic()
    beside = CompilingBeside(partial(compile_beside, machine))
    try:
        with collecting_seldom():
            warm_up(machine)
            for driver in make_drivers(machine).values():
                driver.prepare()
    finally:
        beside.end()
    return time.monotonic() - began_s
