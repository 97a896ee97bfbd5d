"""A family is an answer where only its member is unsure; a poor name without one is none."""

from __future__ import annotations

import numpy as np
import pytest

from motorctl.identify.diagnose.result import FoundEffect, MissingMotion, ModelError
from motorctl.identify.diagnose.verdict.sentence import is_poor, sentence_of
from motorctl.model import known_effects, make_effect

CATALOGUE = known_effects()
WHY = "input_delay and input_lag explain this recording equally well"
MISSING = (MissingMotion(("input_delay", "input_lag"), WHY, "faster starts", None),)


def delay(confidence: float, of_family: float, *alike: str) -> FoundEffect:
    return FoundEffect(
        effect=make_effect(CATALOGUE["input_delay"], {"time_s": 0.01}),
        theta=np.zeros(0),
        std_error=np.zeros(0),
        option_errors={},
        confidence=confidence,
        family_confidence=of_family,
        explained_fraction=0.8,
        score=100.0,
        evidence=(),
        indistinguishable_from=alike,
        alternatives=(),
    )


@pytest.mark.parametrize(
    ("found", "poor"),
    [
        (delay(0.2, 0.8, "input_lag"), False),
        (delay(0.2, 0.4, "input_lag"), True),  # its family is unsure as well
        (delay(0.2, 0.8, "input_lag", "flexible_mode"), True),  # as well another family
        (delay(0.2, 0.8), True),
        (delay(0.5, 0.5), False),
    ],
)
def test_a_poor_name_is_an_answer_by_its_sure_family_alone(found, poor):
    assert is_poor((found,), MISSING, CATALOGUE) == poor
    assert not is_poor((found,), (), CATALOGUE)


def test_the_sentence_tells_the_family_and_what_its_members_are():
    error = ModelError("V", 0.112, 0.0476, 0.0158, 0.8, 1.0)
    found = delay(0.2, 0.77, "input_lag")
    told = sentence_of("", "effect", (found,), None, MISSING, error, None)
    assert "of a known kind, command timing (confidence 0.77; input_delay and input_lag" in told
    sure = sentence_of("", "effect", (delay(0.9, 0.95),), None, (), error, None)
    assert sure.startswith("The model lacks input_delay: held-out error 0.112 to 0.0476 V rms")
