"""What is open, and which motion settles it soonest, as plain data."""

from __future__ import annotations

import math
from typing import Any

from motorctl.experiment.outlook import Outlook, what_it_settles
from motorctl.experiment.session import Experiment, Standing


def standing_document(standing: Standing, chosen: Experiment | None) -> dict[str, Any]:
    """Return the document of `experiment --json`; `chosen` is None where all is settled."""
    return {
        "settled": standing.settled,
        "axes": {name: _axis(look) for name, look in standing.outlooks.items()},
        "not_weighed": list(standing.unsure),
        "inseparable": [each.words for each in standing.inseparable],
        "chosen": None
        if chosen is None
        else {
            "motion": chosen.candidate.words,
            "axes": list(chosen.candidate.strokes),
            "duration_s": chosen.duration_s,
            "settles": list(chosen.settles),
        },
    }


def _axis(look: Outlook) -> dict[str, Any]:
    questions = look.open.questions
    return {
        "questions": [
            {
                "kind": question.kind,
                "effects": list(question.effects),
                "words": question.words,
                "known": question.known,
                "needed": question.needed,
                "inseparable": question.words in look.lost,
            }
            for question in questions
        ],
        "candidates": [
            {
                "motion": prospect.candidate.words,
                "duration_s": prospect.duration_s,
                "expected": [None if math.isnan(t) else t for t in prospect.told],
                "settled_per_s": prospect.rate,
                "settles": what_it_settles(prospect, questions),
            }
            for prospect in look.prospects
        ],
    }
