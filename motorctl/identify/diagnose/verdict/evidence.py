"""What a name rests on, in figures: from them its confidence is learned."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.result import Alternative
from motorctl.identify.diagnose.search.acceptance import LEAST_GAIN, gain
from motorctl.identify.diagnose.search.held_out_blocks import FOLDS, fit_of_fold, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import Found, explained_share
from motorctl.model import Effect, Spans

Array = NDArray[np.float64]

TINY = 1e-300
"""Sum of squares below which there is nothing left: keeps divisions whole. Any other would do that
is below every signal's and above zero. Convention."""
FAINT_RIVAL = 0.1
"""Share of the gain below which a rival counts as one of it: much smaller ones say no more. Larger
does not tell close rivals from far ones, smaller lets a lead alone make a name sure. Chosen by how
well the weights hold on authors left out, of 0.001, 0.01, 0.03 and 0.1."""
MOST_OVER_NOISE = 10.0
"""Rms of what is left over that of noise alone beyond which more says nothing: real machines have 5
to 200 beside a weight that is plainly there. Larger doubts these, smaller trusts what simulated
machines show to be only a part. Chosen by how well the weights hold on authors left out, of 3, 5,
8, 10, 15, 20 and none."""
MOST_UNSTEADY = 1.0
"""Disagreement beyond which parts of the recording say nothing of an effect at all, as where none
of its events falls into one of them. Larger doubts what acts in few places, smaller does not tell
chance from such. Arithmetic: as large as the effect itself."""
SMALL_STEP = 0.02
"""Part of a lag or delay by which it is changed to see what it does. Larger leaves the straight
line, smaller drowns in rounding. Chosen by hand."""
FAINTEST = 1e-3
"""Shares and parts below it count as it. Larger does not tell steady effects from very steady ones,
smaller lets their logarithms run away. Convention: a thousandth."""

FEWEST_REPEATS = 2.0
"""Times that a wave over position must fit into the travel to be known as one that repeats. Larger
doubts long pitches, smaller names as a wave what any smooth function of the place is. Arithmetic: a
second time is the first that can be compared with another."""


@dataclass(frozen=True)
class Evidence:
    """What a name rests on."""

    gain: float
    """Gain in held-out log-likelihood, over the least that a name needs."""
    rival_share: float
    """The best other effect's gain over this one's."""
    stranger_share: float
    """The same of effects of other families."""
    unexplained: float
    """Part of the explainable error that the whole model leaves, 0 to 1."""
    over_noise: float
    """Rms of what the whole model leaves over that of noise alone, at least 1."""
    reduction: float
    """Rms of what the model leaves of held-out rows without this effect, over that with it."""
    unsteady: float
    """Rms by which parts of the recording disagree on what the effect does, over its own rms."""
    of_friction: bool = False
    """It is a kind of friction: no figure, and not in the document."""

    def document(self) -> dict[str, float]:
        """Return its figures as plain data."""
        figures = asdict(self)
        del figures["of_friction"]
        return {name: float(value) for name, value in figures.items()}


def evidence_of(found: Found, effect: Effect, others: Sequence[Alternative]) -> Evidence:
    """Return what the name of an effect of the final model rests on, `others` being its rivals."""
    final = found.final
    rest = final.without(effect.name)
    strangers = outside_family(found, effect, [each.name for each in others])
    others = [each for each in others if not _contains(found, each.name, effect)]
    noise = max(final.noise_sse(found.force_noise), 1e-300)
    return Evidence(
        gain=gain(rest, final.held_out) / LEAST_GAIN,
        rival_share=max((each.share for each in others), default=0.0),
        stranger_share=max((e.share for e in others if e.name in strangers), default=0.0),
        unexplained=min(max(1.0 - explained_share(found), 0.0), 1.0),
        over_noise=math.sqrt(max(final.held_out / noise, 1.0)),
        reduction=math.sqrt(max(rest.held_out, TINY) / max(final.held_out, TINY)),
        unsteady=_unsteady(found, effect),
        of_friction="friction" in effect.groups,
    )


def _unsteady(found: Found, effect: Effect) -> float:
    """Return how far fits to each third of the blocks disagree on what an effect does there.

    Each third answers for its own rows: of an event in one of them the others know nothing.
    """
    final, problem = found.final, found.final.problem
    places = [i for i, name in enumerate(final.names) if name == effect.name]
    whole = final.solution.b[places]
    if not places and not effect.steps(found.spans):
        return 0.0
    if effect.kind == "command":  # no column is its own: asked is by how much its time would change
        name, value = _time_of(effect, found.spans)
        problem = with_columns(problem, _change_by(final, effect, name, value)[None])
        places, whole = [problem.size - 1], np.array([value])
    apart = 0.0
    for k in range(FOLDS):
        own = problem.gram[k::FOLDS].sum(axis=0)[np.ix_(places, places)]
        away = fit_of_fold(problem, k).b[places]
        away = away if effect.kind == "command" else away - whole
        apart += float(away @ own @ away)
    own = problem.total[np.ix_(places, places)]
    return math.sqrt(apart / max(float(whole @ own @ whole), TINY))


def _time_of(effect: Effect, spans: Spans) -> tuple[str, float]:
    """Return the one option of an effect on the command that is fitted, and its value."""
    name = next(iter(effect.steps(spans)))
    return name, float(getattr(effect.options, name))


def _change_by(final: Hypothesis, effect: Effect, name: str, value: float) -> Array:
    """Return by how much the fitted rows would change with an option, for each unit of it, (m,)."""
    step = SMALL_STEP * value
    moved = final.exchanged(effect.with_options(**{name: value + step}))
    rows, b = final.regressors.signals.rows, final.solution.b
    before, after = (each.problem.joined(rows)[:-1] for each in (final, moved))
    return np.asarray((b @ after - b @ before) / step)


def _contains(found: Found, other: str, effect: Effect) -> bool:
    """Return whether another effect is a spline of the same family: it can draw any form of it.

    Then it is no rival. It is one of a wave that the travel does not show to repeat.
    """
    cls = found.final.regressors.catalogue.get(other)
    if cls is None or effect.is_spline or cls.family() != effect.family():
        return False
    over_position = "wave_over_position" in effect.groups
    if over_position and FEWEST_REPEATS * effect.repeats_every > found.spans.travel_m:
        return False
    return any(form.is_spline for form in cls.trials(found.spans))


def outside_family(found: Found, effect: Effect, names: list[str]) -> set[str]:
    """Return which of the named effects belong to another family."""
    catalogue = found.final.regressors.catalogue
    return {n for n in names if n not in catalogue or catalogue[n].family() != effect.family()}


def features(figures: Mapping[str, float], of_family: bool = False) -> dict[str, float]:
    """Return what the logistic score is linear in, from the figures of an `Evidence`.

    Shares of the command or of what is explained, the reduction of what is left (also with a limit
    of 1.5 or 3), and how many other names are given, were tried too: they learn how many effects a
    machine has, which differs from author to author.
    """
    rival = figures["stranger_share" if of_family else "rival_share"]
    return {
        "lead": -math.log(min(max(rival, FAINT_RIVAL), 10.0)),
        "strength": math.log(max(figures["gain"], 1.0)),
        "unexplained": figures["unexplained"],
        "over_noise": math.log(min(figures["over_noise"], MOST_OVER_NOISE)),
        "unsteady": math.log(min(max(figures["unsteady"], FAINTEST), MOST_UNSTEADY)),
    }
