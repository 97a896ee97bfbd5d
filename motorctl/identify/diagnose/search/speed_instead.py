"""Forces of place or time that a function of speed explains nearly as well.

Where each speed is passed at one place, or at one time, as in a staircase of commands, friction of
any shape looks like a force of that place, or like friction that changes with the time. Only a
motion that passes one speed at several of them tells which it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.held_out_blocks import held_out_sse, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import on_pieces
from motorctl.identify.diagnose.search.smooth_functions import hats
from motorctl.model import Effect

Array = NDArray[np.float64]

KNOTS = 20
"""Speeds between which the function is a straight line, each with as many rows between. More leaves
speeds of which no rows are held out, fewer misses the shape of friction. Chosen by hand."""
AS_MUCH = 0.85
"""Part of what the effect takes of the squared error on held-out rows that a function of speed may
take instead. Larger names what friction of another shape does, smaller refutes forces in motions
that pass a place mostly at one speed. Chosen by hand: a staircase of commands has 0.92 to 1.0, true
ones of simulated machines of other hands at most 0.41."""


def speed_instead(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a force of place or time that a function of speed does the work of, and what to say.

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
    knots = np.unique(np.quantile(speeds, np.linspace(0.0, 1.0, KNOTS)))
    if len(knots) < 3:
        return None
    columns = signals.rows_of(
        signals.spectra([hats(s.v[::d], knots) for s in signals.stretches], d)
    )
    for effect in asked:
        rest = within.without(effect.name).refreshed()
        takes = rest.held_out - within.held_out
        with_function = float(held_out_sse(with_columns(rest.problem, columns)).sum())
        part = (rest.held_out - with_function) / takes if takes > 0.0 else 0.0
        if part > AS_MUCH:
            return effect, (
                f"{effect.name} is refuted: a function of speed alone takes "
                f"{100.0 * part:.0f} % of the error that it takes (limit {100.0 * AS_MUCH:g} %): "
                "this motion passes each speed at one place or time, and friction of another shape "
                "would do the same. Record a motion that passes its speeds again, at other places "
                "and times"
            )
    return None
