"""What a fault to order is, and what several of them have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from motorctl.hal import Status
from motorctl_benchmarks.safety.faulty_gantry import DeviceFault
from motorctl_benchmarks.safety.setting import Setting

Numbers = dict[str, float]
Draw = Callable[[np.random.Generator, Setting], Numbers]

EVERY = (
    "off",
    "hold",
    "accelerate",
    "cruise",
    "dwell",
    "ring",
    "homing",
    "stop",
    "reaction",
    "fault",
)
MOVING = ("accelerate", "cruise", "ring", "homing")
ENABLED = ("hold", "accelerate", "cruise", "dwell", "ring", "homing")
TWO = ("gantry", "serial", "modbus", "can")
"""Machines whose plant is known well enough for forces to be reckoned with, and have two axes."""
HOMED = ("stage", "dual")
"""Machines with one axis, which has to be homed."""
BOTH = ("disable", "quick_stop")


def nothing_drawn(_rng: np.random.Generator, _case: Setting) -> Numbers:
    """Return no amounts."""
    return {}


@dataclass(frozen=True)
class FaultKind:
    """One fault."""

    title: str
    states: tuple[str, ...]
    machines: tuple[str, ...] = (*TWO, *HOMED)
    guard: str = ""
    """Whose reaction may be chosen."""
    reactions: tuple[str, ...] = ("",)
    """Of that guard; empty: as it is by default."""
    clean: bool = False
    """On a plant without cogging, lag, delay and noise, so that its acceleration is known."""
    draw: Draw = nothing_drawn
    device: Callable[[Setting], DeviceFault] | None = None
    """What the device does; None: the fault is a force, or the computer's."""
    axis_keys: Callable[[Numbers], Mapping[str, Any]] | None = None
    top_keys: Mapping[str, Any] = field(default_factory=dict)
    pushes: bool = False
    """A force acts, of `push_m_s2` times the mass for `push_s`."""
    restarts: bool = True
    """A reset and a start bring the axis back."""
    one_end: bool = False
    """Of a beam with two motors: only one of its ends breaks, either of them."""


def reports(bits: Status, *, freezes: bool = False, off: bool = False, once: bool = False) -> Any:
    """Return a device that reports bits, and says so of itself."""
    return lambda _case: DeviceFault(bits=int(bits), freezes=freezes, output_off=off, once=once)


def jump(rng: np.random.Generator, case: Setting) -> Numbers:
    """Draw a jump that no motion makes: more than four times the top speed, and the motion."""
    limits = case.limits
    step = limits.top_speed_m_s * limits.period_s
    least = 4.0 * step + 8.0 * limits.count_m + step
    most = min(6.0 * least, 0.45 * 2.0**limits.counter_bits * limits.count_m)
    return {"jump_m": float(rng.uniform(least, most) * rng.choice((-1.0, 1.0)))}


def shift(case: Setting) -> int:
    """Return the jump in counts."""
    return round(case.drawn["jump_m"] / case.limits.count_m)


def ahead(case: Setting) -> DeviceFault:
    """Return a device whose limit switch ahead is pressed."""
    bit = Status.LIMIT_POSITIVE if case.direction > 0 else Status.LIMIT_NEGATIVE
    return DeviceFault(bits=int(bit))
