"""How sure one can be of a name: of those given with 0.9, nine in ten should be right.

`motorctl bench diagnosis` prints how many were.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

HIGHEST = 0.99
"""Highest confidence that is given. Larger claims more than simulated machines can show, smaller
hides sure names. Chosen by hand."""
LOWEST = 0.05
"""Lowest confidence that is given. Only the report's figures depend on it. Chosen by hand."""
# A logistic score of the `Evidence`; its weights were chosen by hand on simulated machines.
INTERCEPT = 1.0
"""Logistic score of a name without a lead, of the least gain, that leaves nothing: 1 is a
confidence of 0.73. Larger trusts all names more. Chosen by hand on simulated machines."""
PER_LEAD = 1.2
"""Score per natural logarithm of its gain over the best rival's. Larger trusts names with a lead
more. Chosen by hand on simulated machines."""
PER_GAIN = 0.45
"""Score per natural logarithm of its gain over the gain needed. Larger trusts strong effects more.
Chosen by hand on simulated machines."""
PER_UNEXPLAINED = -3.0
"""Score for the part of the explainable error that the whole model leaves, 0 to 1. Further from
zero doubts all names beside unknown structure. Chosen by hand on simulated machines."""
SHARED = 0.5
"""Factor on the confidence for each effect, up to three, that it cannot be told from: with one
other, each has half. Larger trusts such names more. Arithmetic for one."""


@dataclass(frozen=True)
class Evidence:
    """What a name rests on."""

    gain: float
    """In held-out log-likelihood."""
    needed: float
    """The gain below which nothing is named."""
    rival_share: float
    """The best other effect's gain over this one's."""
    unexplained: float
    """Part of the explainable error that the whole model leaves, 0 to 1."""
    indistinguishable: int
    """How many other effects would do as well."""


def confidence(evidence: Evidence) -> float:
    """Return the probability that the name is right, 0 to 1."""
    lead = math.log(1.0 / max(evidence.rival_share, 1e-3))
    strength = math.log(max(evidence.gain / evidence.needed, 1.0))
    score = INTERCEPT + PER_LEAD * lead + PER_GAIN * strength
    score += PER_UNEXPLAINED * max(evidence.unexplained, 0.0)
    sure = 1.0 / (1.0 + math.exp(-score))
    if evidence.indistinguishable:
        sure *= SHARED ** min(evidence.indistinguishable, 3)
    return float(min(max(sure, LOWEST), HIGHEST))
