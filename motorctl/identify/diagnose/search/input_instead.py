"""Effects of the input that do as well as a friction, where the search could not try them.

With the command on the left a function of the command would explain the command by itself, so none
is sought there; a friction that grows with the load, or the hysteresis of a drive, is then taken
for the friction that comes nearest. With the acceleration on the left both can be asked.
"""

from __future__ import annotations

from motorctl.identify.columns.pieces import shortened
from motorctl.identify.diagnose.search.acceptance import gain
from motorctl.identify.diagnose.search.forms import candidates
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.option_ranges import at_bound
from motorctl.identify.diagnose.search.ranking import ranked
from motorctl.identify.diagnose.search.search import (
    LONGEST_SEARCH_S,
    Found,
    InputInstead,
    physical_form,
    whitened,
)
from motorctl.model.sign_function import sign_of

NOTHING = 1e-9
"""Least gain of a force that a rival's is divided by. Larger hides rivals of forces that gain
little, smaller divides by zero. Convention: far below any gain that counts."""

TAKES = 0.1
"""Part of what is left without the friction that a rival takes at least, to be told of. Larger
hides rivals of weak frictions, smaller tells of effects for which nothing speaks. Chosen by hand:
those of a real arm, of which nothing was there, took a thousandth."""


def inputs_instead(found: Found) -> dict[str, InputInstead]:
    """Return, for frictions that were found, the effect of the input that leaves no more instead.

    Parameters
    ----------
    found
        The outcome of a search with the command on the left.

    Returns
    -------
    dict
        By the friction's name, where there is such an effect.
    """
    old, added = found.final.regressors, found.final.added
    frictions = [effect for effect in added if "friction" in effect.groups]
    if not frictions:
        return {}
    signals = shortened(old.signals, LONGEST_SEARCH_S)
    regressors, _ = whitened(signals, old.declared, added, "acceleration", old.catalogue)
    whole = Hypothesis(regressors, added).refreshed()
    sign, spans = sign_of(old.declared.effects), found.spans
    rivals = {}
    for effect in frictions:
        rest = whole.without(effect.name)
        classes = [cls for cls in candidates(rest, spans) if cls.kind == "input"]
        forms = ranked(rest, classes, spans, sign)
        most = min(whole.held_out, (1.0 - TAKES) * rest.held_out)
        near = (f for f in forms if f.held_out <= most and not at_bound(f.effect, spans))
        best = next((f for f in near if physical_form(rest, f) is not None), None)
        if best is not None:
            own = max(gain(rest, whole.held_out), NOTHING)
            rivals[effect.name] = InputInstead(
                name=best.effect.name,
                share=gain(rest, best.held_out) / own,
                leaves=best.held_out / whole.held_out,
            )
    return rivals
