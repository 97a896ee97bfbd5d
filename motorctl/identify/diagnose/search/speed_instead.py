"""Forces of place or time that a function of speed explains nearly as well.

Where each speed is passed at one place, or at one time, as in a staircase of commands, friction of
any shape looks like a force of that place, or like friction that changes with the time. Only a
motion that passes one speed at several of them tells which it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.held_out_blocks import (
    BlockedRegression,
    held_out_sse,
    with_columns,
)
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import on_pieces
from motorctl.identify.diagnose.search.smooth_functions import hats
from motorctl.model import Effect

Array = NDArray[np.float64]

KNOTS = 20
"""Speeds, at most, between which the function is a straight line, each with as many rows between.
More leaves speeds of which no rows are held out, fewer misses the shape of friction. Chosen by
hand."""
APART = (0.05, 0.1, 0.2)
"""How far apart such speeds are at least, of all that they span; of these the function that does
best on held-out rows is asked. Smaller follows each level of a command that comes again, as if the
speeds that it reaches warm and cold were of friction's shape; larger misses that shape. Chosen by
hand."""
AS_MUCH = 0.5
"""Part of what the effect takes of the squared error on held-out rows that it does not take beside
a function of speed. Larger names what friction of another shape does, smaller refutes forces in
motions that pass a place mostly at one speed. Chosen by hand: staircases of commands on real
wheels have 0.65 to 0.84, true ones of simulated machines of other hands at most 0.12, and a wheel
that warms up under a command of four levels has 0.33."""


def speed_instead(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a force of place or time that a function of speed makes superfluous, and what to say.

    Parameters
    ----------
    final
        The declared model and what was found.
    """
    asked = [e for e in final.added if e.told_by_other_speeds]
    if not asked:
        return None
    within = on_pieces(final)
    signals, d = within.regressors.signals, within.regressors.signals.decimation
    speeds = np.concatenate([s.v[::d] for s in signals.stretches])
    functions = [
        signals.rows_of(signals.spectra([hats(s.v[::d], knots) for s in signals.stretches], d))
        for knots in (_knots(speeds, apart) for apart in APART)
        if len(knots) > 2
    ]
    if not functions:
        return None
    for effect in asked:
        rest = within.without(effect.name).refreshed()
        takes = rest.held_out - within.held_out
        if takes <= 0.0:
            continue
        alone = [_left(rest.problem, function) for function in functions]
        best = int(np.argmin(alone))
        still = alone[best] - _left(within.problem, functions[best])
        part = 1.0 - still / takes
        if part > AS_MUCH:
            return effect, (
                f"{effect.name} is refuted: beside a function of speed alone it takes "
                f"{100.0 * min(part, 1.0):.0f} % less of the error than without one (limit "
                f"{100.0 * AS_MUCH:g} %): this motion passes each speed at one place or time, and "
                "friction of another shape would do the same. Record a motion that passes its "
                "speeds again, at other places and times"
            )
    return None


def _left(problem: BlockedRegression, function: Array) -> float:
    """Return the squared error on held-out rows beside a function of speed."""
    return float(held_out_sse(with_columns(problem, function, soft=True)).sum())


def _knots(speeds: Array, apart: float) -> Array:
    """Return rising speeds with as many rows between, no closer than a part of all they span."""
    some = np.quantile(speeds, np.linspace(0.0, 1.0, KNOTS))
    kept = [some[0]]
    for speed in some[1:]:
        if speed - kept[-1] > apart * (some[-1] - some[0]):
            kept.append(speed)
    return np.array(kept)
