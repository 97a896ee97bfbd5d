"""The loops whose margins are told: the inertia over its bounds, a period late or not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from motorctl.config.analysis import (
    DelayedPlant,
    LoopGains,
    LoopMargins,
    loop_margins,
)
from motorctl.config.loop_rules import loop_gains, parameter_range
from motorctl.config.machine import Axis

USUAL_PHASE_DEG = 30.0
"""Phase margin that is usual at least [degrees]. Convention: below, an error of the model of a
sample's delay or of a third of the inertia makes the axis ring."""
USUAL_GAIN_DB = 6.0
"""Gain margin that is usual at least, up and down [dB]. Convention."""


@dataclass(frozen=True)
class MarginsAt(LoopMargins):
    """Margins of the loop at one inertia."""

    inertia_at: str
    """At its initial value, its lower bound or its upper bound."""
    inertia: float


@dataclass(frozen=True)
class LoopCase:
    """An axis' loop at one inertia and one delay."""

    inertia_at: str
    """Initial, lower bound or upper bound."""
    inertia: float
    """theta1 [V s^2/m]."""
    viscous: float
    """theta2 [V s/m]."""
    delay_s: float
    lag_s: float
    period_s: float
    gains: LoopGains

    @property
    def plant(self) -> DelayedPlant:
        """Command to position, sampled."""
        balance = (self.inertia, self.viscous, 0.0)
        return DelayedPlant(balance, self.period_s, self.delay_s, self.lag_s)

    @property
    def margins(self) -> MarginsAt:
        """How far the loop is from instability."""
        margins = loop_margins(
            self.inertia,
            self.viscous,
            **vars(self.gains),
            period_s=self.period_s,
            delay_s=self.delay_s,
            lag_s=self.lag_s,
        )
        return MarginsAt(**asdict(margins), inertia_at=self.inertia_at, inertia=self.inertia)


def loop_cases(axis: Axis, period_s: float) -> Iterator[LoopCase]:
    """Yield the loop at theta_hat(0) and at the ends of the inertia's bounds, each twice.

    Parameters
    ----------
    axis
        Of a checked machine.
    period_s
        Of its loop, Ts [s].

    Yields
    ------
    LoopCase
        With the known input delay and what the model declares, then with a period more.
    """
    inertia = parameter_range(axis.model, axis.estimates, "acceleration")
    viscous, _, _ = parameter_range(axis.model, axis.estimates, "velocity")
    known_s = axis.adaptation.input_delay_s + axis.model.delay_s
    gains = loop_gains(axis.gains, period_s)
    for where, theta1 in zip(("initial", "lower bound", "upper bound"), inertia, strict=True):
        for delay_s in (known_s, known_s + period_s):
            lag_s = axis.model.lag_s
            yield LoopCase(where, theta1, viscous, delay_s, lag_s, period_s, gains)


def remark_on_margins(rows: list[MarginsAt]) -> str | None:
    """Return in words the worst of margins that are less than is usual; None: none is.

    Parameters
    ----------
    rows
        Of one axis.

    Returns
    -------
    str or None
        Its numbers, and where. None, too, where a loop is unstable: that is told by itself.
    """
    if not all(row.stable for row in rows):
        return None
    phases = [(row.phase_margin_deg, row) for row in rows if row.phase_margin_deg is not None]
    gains = [
        (20.0 * math.log10(ratio), row)
        for row in rows
        for ratio in (row.gain_margin, 1.0 / row.gain_reduction if row.gain_reduction else None)
        if ratio is not None
    ]
    told: dict[str, list[str]] = {}
    for unit, usual, found in (("deg", USUAL_PHASE_DEG, phases), ("dB", USUAL_GAIN_DB, gains)):
        least, row = min(found, key=lambda pair: pair[0], default=(math.inf, None))
        if row is not None and least < usual:
            told.setdefault(_where(row), []).append(
                f"{least:.3g} deg" if unit == "deg" else f"{least:.1f} dB"
            )
    if not told:
        return None
    worst = "; ".join(f"{' and '.join(numbers)} {where}" for where, numbers in told.items())
    return f"thin margins: {worst} (usual: {USUAL_PHASE_DEG:g} deg, {USUAL_GAIN_DB:g} dB)"


def _where(row: MarginsAt) -> str:
    return (
        f"with inertia at its {row.inertia_at} ({row.inertia:g} V*s^2/m) and "
        f"{row.delay_s * 1e3:g} ms of delay"
    )
