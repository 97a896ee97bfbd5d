"""Effects that a machine without them shows as well, measured as this one was.

Near rest a coarse encoder hides when exactly an axis turns round: its velocity is late and rounded
off there, and an effect of friction may then describe the measurement. So for such effects, and for
errors of the measurement itself, the model without the effect is given the machine's motion and
encoder (its clean twin), and the effect is tried there.
"""

from __future__ import annotations

import math
from dataclasses import replace

from motorctl.identify.diagnose.search.declared_shape import reshaped
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import Found, rival_gains
from motorctl.identify.diagnose.search.settling import settled
from motorctl.identify.diagnose.verdict.clean_twin import clean_twin
from motorctl.model import Effect, Spans

SHOWN = 0.5
"""Part of an effect's gain that the twin without it may show. Larger names traces of the
measurement, smaller doubts true effects. Chosen by hand: on machines of other hands true effects
have less than 0.3, false ones 0.75."""


def without_shown(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without effects that show on their clean twin, and why for each."""
    notes = []
    for effect in found.final.added:
        if "slow_reversals" not in effect.revealed_by and effect.kind != "measurement":
            continue
        rest = _shaped(found.final.without(effect.name), found.spans).refreshed()
        share = shown_without(found, rest, effect)
        if share < SHOWN:
            continue
        base = Hypothesis(rest.regressors).refreshed()
        found = replace(found, base=base, final=rest, rival_gains=rival_gains(rest))
        notes.append(
            f"{effect.name} is refuted: a machine without it, moved and measured as this one, "
            f"shows {100.0 * share:.0f} % of what it explains"
        )
    return found, tuple(notes)


def shown_without(found: Found, rest: Hypothesis, effect: Effect) -> float:
    """Return the part of an effect's gain that it has on a machine without it.

    Parameters
    ----------
    found
        The outcome of a search that has the effect.
    rest
        Its final model without the effect; of this the twin is made.
    effect
        In the form in which it was found.

    Returns
    -------
    float
        Log of held-out error without it over that with it, on the twin over the same on the
        machine; 0 where no twin can be made.
    """
    real = math.log(rest.held_out / found.final.held_out)
    twin = clean_twin(replace(found, final=rest))
    if twin is None or real <= 0.0:
        return 0.0
    alone = _shaped(twin.final, found.spans)
    both = settled(_shaped(twin.final.plus(effect), found.spans), found.spans)
    return math.log(alone.held_out / both.held_out) / real


def _shaped(hypothesis: Hypothesis, spans: Spans) -> Hypothesis:
    """Return the hypothesis with friction of its best shape."""
    shaped = reshaped(hypothesis, spans)
    if shaped is None or shaped.held_out > hypothesis.held_out:
        return hypothesis
    return shaped
