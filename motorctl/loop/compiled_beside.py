"""What another process compiles of a machine while the loop's is on its way: starts wait less."""

from __future__ import annotations

from contextlib import suppress

from motorctl.config.machine import Machine
from motorctl.loop.tick import make_drivers
from motorctl.loop.warm_up import analyse_steps


def compile_beside(machine: Machine) -> None:
    """Leave in the cache of kernels what the loop needs last: the laws' part, and the drivers'.

    What fails is told by the process that needs it.
    """
    with suppress(Exception):
        analyse_steps(machine)
    for driver in make_drivers(machine).values():
        with suppress(Exception):
            driver.prepare()
