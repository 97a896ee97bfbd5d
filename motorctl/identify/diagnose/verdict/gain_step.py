"""A command whose gain changes at once, which a change of the load would be named for.

Where an amplifier is set anew, or a scale of the log, in the middle of a recording, everything that
the command has to overcome grows by one factor. A change of the inertia describes a good part of
that, and one of friction the rest. One number does as well there: so it is asked.

A change of the load takes the acceleration for a column, with its noise, and a gain the command,
which has none. So that the gain does not win by that alone, a change of the load is asked as one,
too: all that is predicted of the acceleration changes by one factor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.acceptance import AS_WELL
from motorctl.identify.diagnose.search.held_out_blocks import held_out_sse, solve, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import Found, on_pieces, whitened, with_final
from motorctl.identify.diagnose.search.settling import acts_on_acceleration

Array = NDArray[np.float64]

TRIED = 100
"""Times at which a change is tried, and again between two of them. More takes time, fewer misses
when it was: each is a hundredth of the recording. Chosen by hand."""
OUTER = 0.05
"""Part of the recording at each end in which no change is sought. Smaller tells a gain from too
short a piece, larger misses early and late changes. Chosen by hand, as for a change of the load."""


@dataclass(frozen=True)
class _Step:
    time_s: float
    factor: float
    """Force for a command afterwards, over that before."""
    held_out: float


def without_gain_step(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without a change that is one of the command's gain, and why.

    All that was found of the clock is asked together: what one effect leaves of a step, another
    takes.
    """
    clocked = [e for e in found.final.added if "longer_run" in e.revealed_by]
    if not any(effect.sets_in for effect in clocked):
        return found, ()
    whole = _on_acceleration(found)
    rest = whole
    for effect in clocked:
        rest = rest.without(effect.name)
    rest = rest.refreshed()
    columns = rest.problem.joined(rest.regressors.signals.rows)
    step = _best_step(rest, columns[rest.regressors.command_column])
    left = whole.held_out
    # One number for several effects is simpler. Against one alone it has to be better: where
    # little but inertia needs force, a load and a gain are the same.
    limit = AS_WELL if len(clocked) > 1 else 1.0 / AS_WELL
    if len(clocked) == 1 and acts_on_acceleration(clocked[0]):
        predicted = np.asarray(rest.b @ columns[: len(rest.b)])
        left = min(left, _best_step(rest, predicted).held_out)
    if not step.factor > 0.0 or step.held_out > limit * left:
        return found, ()
    final = found.final
    for effect in clocked:
        final = final.without(effect.name)
    names = " and ".join(effect.name for effect in clocked)
    parted = "they are" if len(clocked) > 1 else "it is"
    return with_final(found, final.refreshed()), (
        f"{names}: {parted} refuted, for from {step.time_s:.4g} s on the same command gives "
        f"{step.factor:.3g} times the force, and this one number leaves "
        f"{step.held_out / max(left, 1e-300):.2g} times the squared error: was the "
        "amplifier, its supply or the column's scale changed there? Then cut the recording at this "
        "time",
    )


def _on_acceleration(found: Found) -> Hypothesis:
    """Return the final model with the acceleration on the left, where a gain is one column."""
    final = on_pieces(found.final)
    old = final.regressors
    if old.side == "acceleration":
        return final
    regressors, _ = whitened(old.signals, old.declared, final.added, "acceleration", old.catalogue)
    return Hypothesis(regressors, final.added).refreshed()


def _best_step(rest: Hypothesis, column: Array) -> _Step:
    """Return the step by which a column (m,) changes that leaves least on rows held out."""
    time_s, place = rest.regressors.signals.time_s, rest.regressors.command_column

    def at(begin_s: float) -> _Step:
        problem = with_columns(rest.problem, np.where(time_s >= begin_s, column, 0.0)[None])
        b = solve(problem).b
        return _Step(begin_s, 1.0 + b[-1] / b[place], float(held_out_sse(problem).sum()))

    low, high = np.quantile(time_s, (OUTER, 1.0 - OUTER))
    for _ in range(2):
        times = np.linspace(low, high, TRIED)
        best = min((at(float(time)) for time in times), key=lambda step: step.held_out)
        low, high = best.time_s - times[1] + times[0], best.time_s + times[1] - times[0]
    return best
