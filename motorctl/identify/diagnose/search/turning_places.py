"""Friction over the place where the axis turns round: is it the place, or that it turned?

Friction that bends before it slides is low after each reversal. An axis that always turns at the
same two places shows it there and nowhere else, and a force of the place beside a friction of the
place describes that to the last digit: of what depends on place and direction, two functions of the
place leave nothing. So friction that depends on the place has to show away from where it turned.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.reversals import turning_points
from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.model import Effect

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

OF_PLACE = "friction_of_position"
"""The group of effects that are asked."""
TURNED = 0.02
"""Part of the travel that an axis goes back by, for it to have turned round. Larger misses small
reversals, smaller takes the position's noise for them. Chosen by hand."""
AWAY = 0.15
"""Part of the travel that an axis has gone since it turned, from which it is away from there.
Larger leaves too few rows to judge by, smaller counts friction that bends over a tenth of the
travel, as that of a brake on cables does. Chosen by hand."""
FEWEST = 0.3
"""Part of the rows that must be away. Larger asks only long moves, smaller judges by the rest of
short ones. Chosen by hand."""
THERE = 0.2
"""Squared error that an effect takes of a row there, over that which it takes of any row. Larger
doubts friction that varies near the ends of the travel alone, smaller names what turning round
does. Chosen by hand: a surgical instrument's drive has 0.01, Dahl's friction over a sixteenth of
the travel 0.11, friction that grows along the travel between the same two places 0.26."""


def shown_by_turning(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a friction of the place that shows only after reversals, and why it is refuted."""
    asked = [effect for effect in final.added if OF_PLACE in effect.groups]
    if not asked:
        return None
    away = _away(final.regressors.signals)
    if np.mean(away) < FEWEST:
        return None
    for effect in asked:
        rest = final.without(effect.name).refreshed()
        whole = _gain(rest, final, np.ones_like(away))
        part = _gain(rest, final, away) / whole if whole > 0.0 else 1.0
        if part < THERE:
            return effect, (
                f"{effect.name} is refuted: once the axis is {100.0 * AWAY:g} % of its travel away "
                f"from where it turned round, it takes {100.0 * max(part, 0.0):.0f} % of the "
                f"squared error that it takes elsewhere (at least {100.0 * THERE:g} % are needed): "
                "it describes friction that has just turned round; record moves that turn at many "
                "places"
            )
    return None


def _gain(rest: Hypothesis, final: Hypothesis, rows: Rows) -> float:
    """Return the squared error that one model takes of each of some rows beside another."""
    return (_left(rest, rows) - _left(final, rows)) / np.count_nonzero(rows)


def _left(hypothesis: Hypothesis, rows: Rows) -> float:
    *columns, left = hypothesis.problem.joined(len(rows))[:, rows]
    kept = np.stack(columns)
    b = np.linalg.lstsq(kept.T, left, rcond=None)[0]
    return float(np.sum((left - b @ kept) ** 2))


def _away(signals: Signals) -> Rows:
    """Return which rows are far from where the axis turned round last."""
    places = [s.x[:: signals.decimation] for s in signals.stretches]
    travel = max(float(np.ptp(np.concatenate(places))), 1e-300)
    far = [_gone(place, TURNED * travel) > AWAY * travel for place in places]
    return np.concatenate([f[kept] for f, kept in zip(far, signals.kept, strict=True)])


def _gone(place: Array, back: float) -> Array:
    """Return how far the axis is from where it turned round last, or began."""
    turns = np.concatenate([[0], turning_points(place, back)])
    last = np.searchsorted(turns, np.arange(len(place)), side="right") - 1
    gone: Array = np.abs(place - place[turns[last]])
    return gone
