"""Waves over the position that act in one direction of motion alone.

What magnets and teeth do to an axis, they do on the way there and on the way back. A pawl on its
teeth does not, and half of it looks like a wave of the place. Forces of a place that are no waves
are not asked: on a real screw a friction of the same place makes them differ as much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from motorctl.identify.diagnose.search.held_out_blocks import solve, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.model import Effect
from motorctl.model.knowledge import WAVE_OF_FORCE

ONE_WAY = 0.5
"""Part of what a wave does in one direction that it does in the other one, below which it is none
of the place. Larger refutes waves beside a friction of the same place, smaller names pawls. Chosen
by hand: three true waves on machines of other hands have 0.98 to 1, two pawls 0.01 and 0.02."""
LEAST_WAY = 0.2
"""Part of all the way that is made in the shorter direction, at least. Larger asks few recordings,
smaller judges by swinging back at a stop. Chosen by hand."""
SURELY = 5.0
"""Standard errors by which it must be less. Larger passes what few rows show, smaller refutes by
chance. Chosen by hand: what is left over is no white noise."""


@dataclass(frozen=True)
class Strengths:
    """What an effect does in each direction, over what it does in both, and the standard error."""

    forwards: float
    backwards: float
    error: float

    @property
    def is_one_way(self) -> bool:
        """Whether it surely does far less in one of them."""
        weaker, stronger = sorted((self.forwards, self.backwards), key=abs)
        # against the stronger one it is less than none
        weaker = math.copysign(weaker, weaker * stronger)
        return weaker + SURELY * self.error < ONE_WAY * abs(stronger)


def acts_one_way(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a wave over the position that acts in one direction alone, and what to say."""
    for effect in final.added:
        if effect.kind != "state" or not effect.groups >= WAVE_OF_FORCE:
            continue
        found = strengths(final, effect)
        if found is not None and found.is_one_way:
            return effect, (
                f"{effect.name} is refuted: forwards it is {found.forwards:.2g} times as strong as "
                f"in both directions together, backwards {found.backwards:.2g} times (limit: one "
                f"{ONE_WAY:g} times the other), and what depends on the place alone is as strong "
                "on the way back. Something acts in one direction only, as a pawl does"
            )
    return None


def strengths(final: Hypothesis, effect: Effect) -> Strengths | None:
    """Fit an effect apart in each direction of motion, its form as it was found.

    Beside all others: a friction of the same place may make what it does differ by direction.

    Parameters
    ----------
    final
        A model that has the effect.
    effect
        The wave.

    Returns
    -------
    Strengths | None
        None where the axis hardly moves in one of the directions.
    """
    signals = final.regressors.signals
    v = signals.picked(lambda s: s.v)
    if min(v[v > 0.0].sum(), -v[v < 0.0].sum()) < LEAST_WAY * np.abs(v).sum():
        return None
    own = [i for i, name in enumerate(final.names) if name == effect.name]
    columns = []
    for s in signals.stretches:
        force = final.solution.b[own] @ s.columns(effect)
        columns.append(np.stack([np.where(s.v > 0.0, force, 0.0), np.where(s.v < 0.0, force, 0.0)]))
    apart = signals.rows_of(signals.spectra(columns), final.undone)
    if not np.all(np.any(apart, axis=1)):
        return None
    rest = final.without(effect.name).refreshed()
    fit = solve(with_columns(rest.problem, apart))
    variance = fit.sse / signals.rows * fit.covariance.diagonal()[-2:]
    return Strengths(float(fit.b[-2]), float(fit.b[-1]), math.sqrt(float(variance.max())))
