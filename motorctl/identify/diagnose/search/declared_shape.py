"""The declared friction's own shape: it may turn over at zero speed otherwise than declared.

A friction that is declared a little too steep, too flat or of another form leaves a residual at low
speed that half a dozen effects would fit. So its shape is fitted anew before any of them is added.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import minimize_scalar

from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.model import EffectList, Spans
from motorctl.model.grids import log_grid
from motorctl.model.sign_function import SHAPES, Shape, Sign, sign_of, with_sign

WIDTHS_PER_DECADE = 3
"""Widths that are tried in each decade of speed. More takes time, fewer may miss the best. Chosen
by hand."""
NARROWEST, WIDEST = 2e-4, 0.3
"""Widths that are tried, as parts of the top speed. Further apart takes time for nothing, for a
narrower one is a step to any motion and a wider one is viscous; closer together misses true widths.
Chosen by hand."""
EXTREMES: tuple[Shape, ...] = ("arctan", "clip")
"""The shapes that differ most: one comes near to its end slowly, one is there at once."""
TOLERANCE = 0.01
"""Accuracy of the logarithm of friction's slope: 0.01 is a hundredth of the slope. Larger leaves
residual to be named, smaller takes time. Chosen by hand."""


def turning_over(hypothesis: Hypothesis, sign: Sign) -> Hypothesis:
    """Return a hypothesis whose frictions, declared and added, turn over so at rest."""
    old = hypothesis.regressors
    declared = EffectList([with_sign(effect, sign) for effect in old.declared.effects])
    added = tuple(with_sign(effect, sign) for effect in hypothesis.added)
    return Hypothesis(old.with_declared(declared), added, hypothesis.acceleration)


def reshaped(hypothesis: Hypothesis, spans: Spans, quick: bool = False) -> Hypothesis | None:
    """Return the hypothesis with the best shape of friction, None where none would brake.

    quick tries the two shapes that differ most, and their slopes roughly.
    """
    if sign_of(hypothesis.regressors.declared.effects) is None:
        return None
    tried = EXTREMES if quick else SHAPES
    shapes = [with_best_slope(hypothesis, shape, spans, quick) for shape in tried]
    return min(filter(_takes_energy, shapes), key=lambda h: h.solution.sse, default=None)


def _takes_energy(hypothesis: Hypothesis) -> bool:
    """Return whether friction, all of it together, brakes in each direction of motion."""
    signals = hypothesis.regressors.signals
    forces = (*hypothesis.of_kind("state"), *hypothesis.of_kind("input"))
    names = {effect.name for effect in forces if "friction" in effect.groups}
    of_friction = [i for i, name in enumerate(hypothesis.names) if name in names]
    force = (
        hypothesis.solution.b[of_friction] @ hypothesis.problem.joined(signals.rows)[of_friction]
    )
    if hypothesis.regressors.side == "command":  # there it is what the command has to overcome
        force = -force
    power = signals.picked(lambda s: s.v) * force
    forward = signals.picked(lambda s: s.v) > 0.0
    return float(power[forward].sum()) <= 0.0 and float(power[~forward].sum()) <= 0.0


def with_best_slope(
    hypothesis: Hypothesis, shape: Shape, spans: Spans, quick: bool = False
) -> Hypothesis:
    """Return the hypothesis with friction of this shape and the slope that leaves least.

    quick finds the slope roughly.
    """

    def at(log_slope: float) -> Hypothesis:
        return turning_over(hypothesis, Sign(math.exp(log_slope), shape))

    speed = spans.speed_m_s
    widths = log_grid(NARROWEST * speed, WIDEST * speed, WIDTHS_PER_DECADE)
    trials = np.sort(-np.log(widths))
    values = [at(float(trial)).solution.sse for trial in trials]
    best = int(np.argmin(values))
    if quick:
        return at(float(trials[best]))
    around = float(trials[max(best - 1, 0)]), float(trials[min(best + 1, len(trials) - 1)])
    fine = minimize_scalar(
        lambda place: at(float(place)).solution.sse,
        bounds=around,
        method="bounded",
        options={"xatol": TOLERANCE},
    )
    return at(float(fine.x) if fine.fun < values[best] else float(trials[best]))
