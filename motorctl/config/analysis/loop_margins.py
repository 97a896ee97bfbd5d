"""Margins of the sampled position loop: rigid mass, hold, delay, and the law's feedback part."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from motorctl.config.analysis.sampled_loop import (
    Array,
    DelayedPlant,
    LoopGains,
    is_stable,
    open_loop,
)
from motorctl.config.analysis.sign_changes import sign_changes
from motorctl.control import CommandFilter

GRID = 2000
CLOSER = 200
"""Frequencies looked at between two of the grid where the loop crosses. Larger takes time, smaller
is less exact. Arithmetic: two of the grid are 0.6 % apart, so these are 3e-5 apart, and a chord is
off by the square of that."""
SLOWEST = 1e-5
"""Lowest frequency looked at, as a fraction of the Nyquist frequency."""


@dataclass(frozen=True)
class LoopMargins:
    """How far the loop is from instability; None where the loop has no such crossing."""

    delay_s: float
    lag_s: float
    stable: bool
    crossover_rad_s: float | None
    phase_margin_deg: float | None
    """At the crossover that is nearest to -180 degrees."""
    gain_margin: float | None
    """The loop gain may grow by less than this factor."""
    gain_reduction: float | None
    """The loop gain may shrink to no less than this factor."""


def loop_margins(
    theta1: float,
    theta2: float,
    *,
    k1_1_s: float,
    ks_v_s_m: float,
    gamma_d: float,
    period_s: float,
    delay_s: float = 0.0,
    lag_s: float = 0.0,
    stiffness: float = 0.0,
    command_filter: CommandFilter | None = None,
) -> LoopMargins:
    """Return the margins of the loop around theta1 [V s^2/m], theta2 [V s/m], stiffness [V/m].

    The loop is `LoopGains.feedback` times `DelayedPlant`, which is what law and skew loop run.

    Parameters
    ----------
    theta1, theta2
        Inertia [V s^2/m] and viscous friction [V s/m].
    k1_1_s
        Gain k1 of the position error [1/s].
    ks_v_s_m
        Robust gain ks [V s/m].
    gamma_d
        Gain of the fast adaptation [V/m].
    period_s
        Period of the loop, Ts [s].
    delay_s, lag_s
        Dead time and time constant between the command and the force [s]; 0 is none.
    stiffness
        Spring between the plant and the ground [V/m]; 0 is none.
    command_filter
        Of the feedback's part of the command.

    Returns
    -------
    LoopMargins
        Whether the loop is stable, its crossover [rad/s], phase margin [degrees] and gain margins.
    """
    plant = DelayedPlant((theta1, theta2, stiffness), period_s, delay_s, lag_s)
    gains = LoopGains(k1_1_s, ks_v_s_m, gamma_d, command_filter)
    loop = functools.partial(open_loop, plant, gains)

    nyquist = math.pi / period_s
    w = np.geomspace(SLOWEST * nyquist, 0.9999 * nyquist, GRID)
    response = loop(w)

    def log_gain(x: Array) -> Array:
        return np.asarray(np.log(np.abs(loop(x))))

    crossovers = _zeros(w, np.log(np.abs(response)), log_gain)
    margins = [180.0 + math.degrees(np.angle(loop(np.array([x]))[0])) for x in crossovers]
    signed = [m - 360.0 if m > 180.0 else m for m in margins]
    worst = min(range(len(signed)), key=lambda i: abs(signed[i]), default=None)

    on_axis = _zeros(w, response.imag, lambda x: loop(x).imag)
    real = [float(loop(np.array([x]))[0].real) for x in on_axis]
    inside = [-1.0 / r for r in real if -1.0 < r < 0.0]
    outside = [-1.0 / r for r in real if r < -1.0]
    return LoopMargins(
        delay_s=delay_s,
        lag_s=lag_s,
        stable=is_stable(plant, gains),
        crossover_rad_s=None if worst is None else crossovers[worst],
        phase_margin_deg=None if worst is None else signed[worst],
        gain_margin=min(inside, default=None),
        gain_reduction=max(outside, default=None),
    )


def _zeros(x: Array, y: Array, function: Callable[[Array], Array]) -> list[float]:
    """Return where samples y(x) change their sign: by the chord of a closer look at each place.

    As close as that, a chord is exact to 1e-7 of x, and to 3e-5 at the peak of a spring without
    damping. A start need not load scipy's optimisers for it.
    """
    found = []
    for k, share in zip(*sign_changes(y), strict=True):
        between = np.linspace(x[k], x[k + 1], CLOSER)
        near, shares = sign_changes(function(between))
        if not len(near):  # the sign of an end is that of its rounding
            near, shares, between = np.array([0]), np.array([share]), x[k : k + 2]
        found += [float(z) for z in between[near] + shares * (between[near + 1] - between[near])]
    return found
