"""How sure one can be of a name: of those given with 0.9, nine in ten should be right.

A logistic score of the `Evidence`, whose weights were learned on machines of several authors:
`tools/learn_confidence.py` rebuilds the table, and tells how well it holds on machines of an author
whom it has not seen. `motorctl bench machines` prints how many names were right.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from scipy.special import expit

from motorctl.identify.diagnose.result import Alternative
from motorctl.identify.diagnose.search.search import Found, with_final
from motorctl.identify.diagnose.verdict.errors import alternatives, ambiguous_with
from motorctl.identify.diagnose.verdict.evidence import Evidence, evidence_of, features
from motorctl.model import Effect
from motorctl.model.knowledge import Family

HIGHEST = 0.99
"""Highest confidence that is given. Larger claims more than simulated machines can show, smaller
hides sure names. Chosen by hand."""
LOWEST = 0.05
"""Lowest confidence that is given. Only the report's figures depend on it. Chosen by hand."""
TOLD = 0.33
"""Confidence from which an effect is named at all. Larger hides right names of machines that leave
much above their noise, smaller gives names that are wrong twice as often as right. Convention: one
in three."""
FAMILY_TOLD = 0.5
"""Confidence from which the family of an effect is told whose name is doubted. Larger hides
families that a recording shows, smaller gives wrong ones. Convention: rather right than wrong."""
TAKES_MOST = 0.5
"""Part of the squared error that such an effect must take. Larger hides families, smaller speaks of
small parts. Chosen by hand: more than all else."""
SHARED = 0.5
"""Factor on the confidence for each effect, up to three, that it cannot be told from: with one
other, each has half. Larger trusts such names more. Arithmetic for one."""
PLAINLY = 0.75
"""Least confidence in a plain effect (see `is_plain`). Larger claims more than was counted,
smaller doubts what nothing else explains. Chosen by hand: of 176 plain names on machines of five
authors 175 were right, and so were all six that the weights alone doubted; six are few, so it is
less than the 7/8 that they suggest."""
TAKES_FIVEFOLD = 5.0
"""Factor by which a plain effect lowers the squared error on held-out rows. Larger knows fewer
plain ones, smaller lets parts of a cause be plain. Chosen by hand; as many are right at 4 and
at 10."""
HALF_AS_GOOD = 2.0
"""Squared error that the best other effect leaves, over that of a plain one. Larger knows fewer
plain ones, smaller names one of two that do as well. Chosen by hand; as many are right at 3."""
PARTS_AGREE = 0.2
"""Part of a plain effect by which parts of the recording disagree on it, at most. Larger takes in
what is fitted to single events, smaller doubts short recordings. Chosen by hand; as many are right
at 0.1."""
PARTS_APART = 1.0
"""Rms by which parts of the recording disagree on what a small effect does, over its own, beyond
which it is not named. Larger names what only chance or another cause explains, smaller doubts
forces of many places that each part passes once. Arithmetic: they disagree by more than there
is."""
SMALL = 1.5
"""Rms that is left without an effect over that with it, below which it is small in that sense.
Larger drops true waves beside a line of an encoder's rounding, on which parts disagree, smaller
keeps chance. Chosen by hand: such a wave has 2.7, an asymmetry of friction that was none 1.2."""
REST_UNKNOWN = 0.2
"""Part of the explainable error that may be left beside a plain effect. Larger speaks of machines
that are not understood, smaller doubts joints that others load. Chosen by hand; as many are right
at 0.1."""
WEIGHTS = "confidence_weights.json"


@cache
def weights() -> dict[str, dict[str, float]]:
    """Return the learned weights by "name" and "family", of each feature and the intercept."""
    text = files("motorctl.identify.diagnose.verdict").joinpath(WEIGHTS).read_text()
    table: dict[str, dict[str, float]] = json.loads(text)["weights"]
    return table


def confidence(evidence: Evidence, alike: int = 0, of_family: bool = False) -> float:
    """Return the probability that a name is right, 0 to 1.

    Parameters
    ----------
    evidence
        What it rests on.
    alike
        How many other effects would do as well.
    of_family
        Whether the name's family is asked, not the name.
    """
    learned = weights()["family" if of_family else "name"]
    sure = sure_by(learned, features(evidence.document(), of_family), alike)
    if is_plain(evidence, of_family):
        sure = max(sure, PLAINLY * SHARED ** min(alike, 3))
    return LOWEST if is_torn(evidence) else sure


def is_torn(evidence: Evidence) -> bool:
    """Return whether parts of the recording disagree on a small effect by more than it does."""
    return evidence.unsteady > PARTS_APART and evidence.reduction < SMALL


def why_doubted(name: str, grounds: Evidence) -> str:
    """Return why an effect that was fitted is not named, as a sentence.

    Parameters
    ----------
    name
        Of the effect.
    grounds
        What its name rests on.
    """
    if is_torn(grounds):
        return (
            f"{name} lowers the error, but is not named: parts of the recording disagree on it by "
            f"{grounds.unsteady:.2g} times what it does, limit {PARTS_APART:g}"
        )
    sure = confidence(grounds)
    return (
        f"{name} lowers the error, but is not named: its confidence is {sure:.2f}, below {TOLD:g}"
    )


def is_plain(evidence: Evidence, of_family: bool = False) -> bool:
    """Return whether an effect takes nearly all, each part agrees, and nothing else comes near.

    The weights count what is left in multiples of the noise, and rivals by their gain, which is a
    logarithm: of a real machine, far above its noise, they doubt what leaves a rival far behind.
    A kind of friction is never plain: friction that was declared a little wrong looks like it.

    Parameters
    ----------
    evidence
        What its name rests on.
    of_family
        Whether only effects of other families count as others.
    """
    rival = evidence.stranger_share if of_family else evidence.rival_share
    ahead = 2.0 * (1.0 - rival) * math.log(max(evidence.reduction, 1.0))
    return bool(
        not evidence.of_friction
        and evidence.reduction**2 >= TAKES_FIVEFOLD
        and ahead >= math.log(HALF_AS_GOOD)
        and evidence.unsteady <= PARTS_AGREE
        and evidence.unexplained <= REST_UNKNOWN
    )


def sure_by(learned: Mapping[str, float], shown: Mapping[str, float], alike: int) -> float:
    """Return the confidence that weights give to features; `alike` effects would do as well."""
    score = learned["intercept"] + sum(learned[name] * value for name, value in shown.items())
    return float(np.clip(expit(score) * SHARED ** min(alike, 3), LOWEST, HIGHEST))


@dataclass(frozen=True)
class Support:
    """What the name of an effect rests on, and what else would do."""

    others: tuple[Alternative, ...]
    twins: tuple[str, ...]
    """Effects that it cannot be told from."""
    grounds: Evidence

    @property
    def sure(self) -> float:
        """The confidence in the name."""
        return confidence(self.grounds, len(self.twins))


def support_of(found: Found, added: Effect) -> Support:
    """Return what the name of an effect of the final model rests on."""
    others = alternatives(found, added.name)
    twins = tuple(ambiguous_with(found, added))
    return Support(others, twins, evidence_of(found, added, others))


@dataclass(frozen=True)
class DoubtedMember:
    """An effect that takes most of the error away and is too unsure to be named."""

    family: Family | None
    """Its kind of physics, where that is sure."""
    member: str
    """The effect that was fitted."""
    sure: float
    """The confidence in the family, 0 to 1."""
    share: float
    """Part of the squared error on held-out rows that the member takes away, 0 to 1."""


def most_doubted(added: Sequence[Effect], doubted: Mapping[str, Evidence]) -> DoubtedMember | None:
    """Return the effect of the surest family that takes most of the error and is not named.

    Parameters
    ----------
    added
        Every effect that was fitted.
    doubted
        Those that are not named, with what they rest on.
    """
    found = []
    for effect in added:
        if effect.name not in doubted:
            continue
        sure = confidence(doubted[effect.name], of_family=True)
        share = 1.0 - 1.0 / max(doubted[effect.name].reduction, 1.0) ** 2
        family = effect.family() if sure >= FAMILY_TOLD else None
        found.append(DoubtedMember(family, effect.name, sure, share))
    told = [each for each in found if each.share > TAKES_MOST]
    return max(told, key=lambda each: each.sure, default=None)


def without_doubtful(found: Found) -> tuple[Found, dict[str, Evidence]]:
    """Return a search's outcome without names that are hardly ever right, and these.

    All are judged in the whole model: what is left without one would speak against the others.
    """
    each = {e.name: evidence_of(found, e, alternatives(found, e.name)) for e in found.final.added}
    doubted = {name: grounds for name, grounds in each.items() if confidence(grounds) < TOLD}
    if not doubted:
        return found, {}
    final = found.final
    for name in doubted:
        final = final.without(name)
    final = final.refreshed()
    return with_final(found, final), doubted
