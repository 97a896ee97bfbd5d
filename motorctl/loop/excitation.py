"""An excitation beside the law's command: it comes and goes without a step, and ends by itself.

Whatever takes an axis out of holding or following, a stop, a guard or homing, takes the excitation
with it in the same tick: it is asked for by the state, once the tick knows it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.axis_keys import Limits
from motorctl.kernels import inner_kernel
from motorctl.loop.states import State
from motorctl.loop.vocabulary import Reply

EXCITATION_TICKS = 16384
"""Longest period of an excitation, in ticks of its axis: the slot in shared memory is so long."""
LEAST_FADE_TICKS = 100
"""Ticks in which an excitation comes, at least, and goes. In 75 the largest that a configuration
allows changes by 1 % of the axis' voltage from tick to tick, so fewer are a step."""
LONGEST_S = 1800.0
"""How long an axis may be excited at once [s]. Longer warms a motor for a response that is known by
then, shorter cuts those of slow axes off. By hand."""

EXCITATION = np.dtype(
    [
        ("ticks", "i8"),  # in a period
        ("fade", "i8"),  # ticks in which it comes, and goes
        ("total", "i8"),  # ticks that it lasts, coming and going included
        ("volts", "f8", (EXCITATION_TICKS,)),  # one period
    ],
    align=True,
)
"""What is added to an axis' command."""


@dataclass(frozen=True)
class Excitation:
    """One period of an excitation, how often it is repeated, and how gently it comes and goes."""

    volts: NDArray[np.float64]
    """One period, (ticks,), a value a tick of the axis [V]."""
    periods: int
    """At its full size."""
    fade_periods: int
    """In which it comes, and as many in which it goes."""

    @property
    def ticks(self) -> int:
        """Ticks of the axis in a period."""
        return len(self.volts)

    @property
    def fade_ticks(self) -> int:
        """Ticks in which it comes, and as many in which it goes."""
        return self.fade_periods * self.ticks

    @property
    def total_ticks(self) -> int:
        """Ticks from its begin to its end."""
        return (self.periods + 2 * self.fade_periods) * self.ticks

    def problem(self, limits: Limits, period_s: float) -> str | None:
        """Return what an axis cannot do of it, or None.

        Parameters
        ----------
        limits
            The axis' own.
        period_s
            Its period [s].
        """
        share = limits.max_excitation_share
        largest_v = float(np.max(np.abs(self.volts), initial=0.0))
        lasts_s = self.total_ticks * period_s
        if not 2 <= self.ticks <= EXCITATION_TICKS:
            return f"an excitation of {self.ticks} ticks: should have 2 to {EXCITATION_TICKS}"
        if self.periods < 1 or self.fade_periods < 1:
            return (
                f"an excitation of {self.periods} periods that comes in {self.fade_periods}: "
                "should be 1 or more of each"
            )
        if self.fade_ticks < LEAST_FADE_TICKS:
            return (
                f"an excitation that comes in {self.fade_ticks} ticks: should be at least "
                f"{LEAST_FADE_TICKS}, or it is a step"
            )
        if share == 0.0:
            return "no excitation is allowed: limits.max_excitation_share is 0"
        if not math.isfinite(largest_v) or largest_v > limits.max_excitation_v:
            return (
                f"an excitation of {largest_v:.4g} V: limit {limits.max_excitation_v:.4g} V "
                f"(limits.max_excitation_share {share:g} of {limits.max_voltage_v:g} V)"
            )
        if lasts_s > LONGEST_S:
            return f"an excitation of {lasts_s:.0f} s: limit {LONGEST_S:.0f} s; use fewer periods"
        return None


@inner_kernel
def _is_led(axis: Any) -> bool:
    return axis.state in (State.HOLDING, State.FOLLOWING)


@inner_kernel
def begin_excitation(axis: Any, excitation: Any) -> Reply:
    """Begin to excite an axis that holds or follows; the supervisor has checked the excitation."""
    if not _is_led(axis):
        return Reply.WRONG_STATE
    if not axis.homed:
        return Reply.NOT_HOMED
    if axis.excitation_ticks:
        return Reply.EXCITED
    ticks, fade, total = excitation.ticks, excitation.fade, excitation.total
    whole = 0 < ticks <= excitation.volts.size
    if not (whole and fade >= LEAST_FADE_TICKS and 2 * fade <= total):
        return Reply.WRONG_STATE
    # Copied: what the supervisor writes later changes no length.
    axis.excitation_ticks, axis.excitation_fade, axis.excitation_total = ticks, fade, total
    axis.excitation_passed = 0
    return Reply.OK


@inner_kernel
def excitation_voltage(settings: Any, axis: Any, excitation: Any, elapsed: int) -> float:
    """Return what is added to the command in this tick [V], within its own limit."""
    if axis.excitation_ticks == 0:
        return 0.0
    axis.excitation_passed += elapsed
    passed, left = axis.excitation_passed, axis.excitation_total - axis.excitation_passed
    if left <= 0 or not _is_led(axis):
        axis.excitation_ticks = 0
        return 0.0
    limit = settings.max_excitation_v
    value: float = excitation.volts[passed % axis.excitation_ticks]
    value = min(max(value, -limit), limit)
    edge = min(passed, left)
    if edge < axis.excitation_fade:
        part = edge / axis.excitation_fade
        value *= part * part * (3.0 - 2.0 * part)
    return value
