"""A bench for tests of dual drives: the shipped beam, changed as a test needs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from loop_bench import Rig, Still, with_axes

from motorctl.config import load
from motorctl.config.axis_keys import Homing
from motorctl.config.keys import LateSamples
from motorctl.config.machine import DriverSetup, Machine
from motorctl.hal import DriverOptions
from motorctl.log.sample import AxisState
from motorctl.loop import Verb
from motorctl_sim import SimDriver, SimOptions

RESOLUTION_M = 0.5e-6


@cache
def beam() -> Machine:
    """Return the machine as it is shipped: one axis with two motors, to be homed."""
    return load("dual_gantry")


def merged(base: Any, change: Any) -> Any:
    """Return nested tables with what differs."""
    if not isinstance(base, Mapping) or not isinstance(change, Mapping):
        return change
    return {**base, **{key: merged(base.get(key), value) for key, value in change.items()}}


def on_plant(machine: Machine, **options: Any) -> Machine:
    """Change options of the simulated beam, nested ones as tables: ``plants={1: {...}}``."""
    told = machine.drivers["gantry"].options.model_dump()
    setup = DriverSetup(
        "gantry", "sim", SimDriver, SimOptions.model_validate(merged(told, options))
    )
    return dataclasses.replace(machine, drivers={"gantry": setup})


def absolute(machine: Machine, apart_m: float = 0.0) -> Machine:
    """Return the beam absolute encoders, and let it stand at 0.1 m, its first end so far ahead."""
    ends = {
        0: {"encoder": {"absolute": True}, "initial_position_m": 0.1 + 0.5 * apart_m},
        1: {"encoder": {"absolute": True}, "initial_position_m": 0.1 - 0.5 * apart_m},
    }
    return with_axes(on_plant(machine, plants=ends), homing=Homing(method="absolute"))


def with_dual(machine: Machine, **changes: Any) -> Machine:
    """Change keys of the axis' dual drive, nested ones as tables."""
    return with_axes(machine, ["x"], dual_drive=changes)


class Held(Rig):
    """The beam on a device whose counts the test sets, enabled at 0; absolute encoders."""

    def __init__(self, *, predict: bool = False, **changes: Any) -> None:
        machine = with_axes(beam(), ["x"], homing=Homing(method="absolute"), **changes)
        late = LateSamples(predict=predict)
        setup = DriverSetup("gantry", "own", Still, DriverOptions(), late)
        super().__init__(dataclasses.replace(machine, drivers={"gantry": setup}))
        self.tick.open(virtual=True)
        self.order(Verb.START, "x")

    def put(self, first_m: float, second_m: float) -> None:
        """Let both encoders count these places."""
        self.driver.counts[:] = np.round(np.array([first_m, second_m]) / RESOLUTION_M)


def home(rig: Rig) -> None:
    """Home the axis, and wait until that is over."""
    rig.order(Verb.HOME, "x")
    rig.wait_until(lambda: rig.state_of("x") is not AxisState.HOMING)
