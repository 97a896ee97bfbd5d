"""What a fault has to lead to, and what every reckoning of it starts from.

It imports nothing of motorctl, as all that is expected is reckoned apart from the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from motorctl_benchmarks.safety.setting import Setting


@dataclass(frozen=True)
class Expected:
    """What has to happen."""

    guards: tuple[str, ...]
    """The cause has to be one of these; none: nothing may trip."""
    least: int = 0
    most: int = 0
    """Ticks from the fault to its detection."""


NOTHING = Expected(())
ERROR_BEFORE = 0.1
"""Following error of an axis in order, as a part of its limit: what a fault may find. The same of
the skew of a beam."""
RAMP_UP_S = 0.02
"""Homing comes to its speed within this: 0.05 m/s at 10 m/s^2 and 2000 m/s^3 are 0.01 s."""


def at_once(guard: str) -> Callable[[Setting], Expected]:
    """Expect a guard in the tick of the fault."""
    return lambda _case: Expected((guard,))


def nothing(_case: Setting) -> Expected:
    """Expect that nothing trips."""
    return NOTHING


def no_new_sample(case: Setting) -> Expected:
    """One tick more than may be held: the first without a sample is the first of them."""
    held = case.limits.hold_ticks
    return Expected(("no_new_sample",), held, held)


def limit_switch(case: Setting) -> Expected:
    """At once where the axis moves towards it; homing tells that it has found no switch."""
    return Expected(("homing_failed" if case.state == "homing" else "limit_switch",))
