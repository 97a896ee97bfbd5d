"""Which signal stands on the left, and a second search where what was found cannot be."""

from __future__ import annotations

import math
from dataclasses import replace

from motorctl.identify.columns.pieces import shortened
from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.hypothesis import Catalogue
from motorctl.identify.diagnose.search.input_instead import inputs_instead
from motorctl.identify.diagnose.search.refutation import without_refuted
from motorctl.identify.diagnose.search.search import (
    LONGEST_SEARCH_S,
    Found,
    Progress,
    explained_share,
    over_all,
    search,
)
from motorctl.model import EffectList
from motorctl.model.sign_function import Sign

UNEXPLAINED = 0.01
"""Rms that is left over the command's: what real machines leave unexplained, and clean simulations
do not. Larger puts the command on the left too seldom, smaller too often. Chosen by hand."""
MUCH_UNEXPLAINED = 0.1
"""The same, from which the command is tried on the left even where the rest looks like the noise of
the acceleration: a joint's weight may hide in it. Larger misses weights, smaller searches twice for
nothing. Chosen by hand."""
UNEXPLAINED_NOISE = 4.0
"""Squared residual over that of noise alone, below which the acceleration stays on the left. Larger
biases real machines, smaller searches twice for nothing. Chosen by hand."""
LOSES = 0.1
"""Part of the explainable error by which another search may explain less and still count: that with
the command on the left, or one without effects that were refuted. Larger takes poor searches,
smaller drops good ones. Chosen by hand."""


def searched(
    signals: Signals,
    declared: EffectList,
    sign: Sign | None,
    progress: Progress | None = None,
    catalogue: Catalogue | None = None,
) -> Found:
    """Search both ways, and once more without effects that are refuted.

    What is refuted may have taken the place of what is there, and that is asked only where the
    refuted one is barred. The second search counts where it explains nearly as much.

    Parameters
    ----------
    signals
        The axis' motion and command.
    declared
        The effects that its model has.
    sign
        How its friction turns over at rest, None where none is declared.
    progress
        Called with what is being done.
    catalogue
        The effects that are tried, by name; every known one by default.

    Returns
    -------
    Found
        The search that explains more, fitted to the whole recording.
    """
    found = both_ways(signals, declared, sign, progress, catalogue)
    stands, why = without_refuted(found)
    names = {effect.name for effect in stands.final.added}
    refuted = {effect.name for effect in found.final.added} - names
    lost = explained_share(found) - explained_share(stands)
    if not refuted or lost < LOSES:
        return found
    if progress is not None:
        progress(f"{' and '.join(sorted(refuted))} refuted: searching again without")
    every = found.final.regressors.catalogue
    others = {name: cls for name, cls in every.items() if name not in refuted}
    again = both_ways(signals, declared, sign, progress, others)
    explained = explained_share(without_refuted(again)[0])
    if explained < explained_share(found) - LOSES:
        return found
    return replace(again, refuted=why, refuted_left=stands.refuted_left)


def both_ways(
    signals: Signals,
    declared: EffectList,
    sign: Sign | None,
    progress: Progress | None = None,
    catalogue: Catalogue | None = None,
) -> Found:
    """Search with the acceleration on the left, and again with the command where that fits better.

    The acceleration carries the measurement's noise, so it belongs on the left as long as that
    noise is what is left over. Where unexplained forces are, which the feedback answers to, the
    command carries them, and would be scaled down as a regressor; so where these outweigh the
    inertia that the declared model has. Parameters and return as of
    `searched`.
    """
    short = shortened(signals, LONGEST_SEARCH_S)
    found = search(short, declared, sign, progress, catalogue=catalogue)
    left = found.final.regressors
    command = found.final.problem.columns[:, 0].ravel()[: left.signals.rows]
    relative = math.sqrt(found.final.solution.sse / float(command @ command))
    relative /= abs(float(found.final.b[0]))
    noisy = found.final.solution.sse < UNEXPLAINED_NOISE * found.final.noise_sse(found.force_noise)
    moves = float(found.base.b[0]) > 0.0
    if relative < UNEXPLAINED or (noisy and moves and relative < MUCH_UNEXPLAINED):
        return over_all(found, signals, catalogue)
    if progress is not None:
        progress("unexplained forces outweigh the noise: searching with the command on the left")
    other = search(short, declared, sign, progress, "command", catalogue)
    other = replace(other, across=next(iter(found.steps), None))
    found, other = (over_all(each, signals, catalogue) for each in (found, other))
    explained = explained_share(without_refuted(found)[0])
    stands, why = without_refuted(other)
    # effects of the input cannot be sought there
    if explained_share(stands) >= explained - LOSES:
        return replace(other, instead=inputs_instead(other))
    more = explained_share(other)
    if more < explained + LOSES:
        return found
    given_up = f"with the command on the left, {100.0 * more:.0f} % could be explained, but "
    return replace(found, refuted=(*found.refuted, *(given_up + reason for reason in why)))
