"""Errors before and after, as cells of tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

from motorctl.close_loop.attempts import Attempt
from motorctl.close_loop.judge import MOTION_WORDS, AxisJudgement
from motorctl.close_loop.matched_velocity import VelocityStep
from motorctl.close_loop.telling import Telling
from motorctl.identify.compare.measures import table_cells
from motorctl.identify.compare.runs import ratios

Rows = list[tuple[str, list[str]]]


def tracking_table(judgement: AxisJudgement) -> list[Rows]:
    """Return the rows before, after and their ratio for each motion: a name and its cells."""
    groups: list[Rows] = []
    for motion, (before, after) in judgement.tracking.items():
        ratio = [f"{r:.2f}" if math.isfinite(r) else "–" for r in ratios(before, after).values()]
        words = MOTION_WORDS[motion]
        groups.append(
            [
                (f"before, on {words}", table_cells(before)),
                (f"after, on {words}", table_cells(after)),
                ("before / after", ratio),
            ]
        )
    return groups


def telling_words(telling: Telling) -> list[str]:
    """Return in words which motions were run, what each was to settle, and what none can."""
    lines = [
        f"{each.duration_s:.1f} s of {each.candidate.words}: {'; '.join(each.settles)}"
        for each in telling.experiments
    ]
    lines += [each.words for each in telling.standing.inseparable]
    lines += [f"still open: {words}" for words in telling.standing.open_words]
    return [*lines, f"{telling.duration_s:.1f} s of motion: {telling.ended}"]


def attempt_words(attempt: Attempt) -> str:
    """Return in words what an attempt added to each axis, and which errors became larger."""
    changed = [name for name, axis in attempt.refinement.axes.items() if axis.changed]
    told = {n: f"{n} with {', '.join(attempt.added(n)) or 'new start values'}" for n in changed}
    with_what = "; ".join(told[name] for name in attempt.tried)
    kept = "; ".join(told[name] for name in changed if name not in attempt.tried)
    if kept:
        with_what += f" (beside {kept}, kept)"
    against = [
        f"{name}: {why}"
        for name, judgement in attempt.judgements.items()
        for why in judgement.against
    ]
    return f"{with_what}: {'; '.join(against) or 'no error became larger'}"


def share_words(added: Sequence[str], judgement: AxisJudgement) -> str:
    """Return in words what a round did to one axis."""
    motion, (before, after) = list(judgement.tracking.items())[-1]
    errors = judgement.units.words(f"eF {1e6 * before.eF_m:.3g} → {1e6 * after.eF_m:.3g} µm")
    return f"{', '.join(added) or 'no effect'} added: {errors} on {MOTION_WORDS[motion]}"


def velocity_words(step: VelocityStep) -> str:
    """Return in words what matching the velocity did to the error, axis by axis."""
    parts = []
    for name, judged in step.judgements.items():
        motion, (before, after) = next(iter(judged.tracking.items()))
        kept = "kept" if name in step.kept else "not kept: an error became larger"
        errors = judged.units.words(f"eF {1e6 * before.eF_m:.3g} → {1e6 * after.eF_m:.3g} µm")
        parts.append(f"{errors} on {name}, {MOTION_WORDS[motion]} ({kept})")
    return f"last, `gains: {{velocity: matched}}` by itself: {'; '.join(parts)}"


def error_row(judgement: AxisJudgement) -> str:
    """Return in words the model errors on the motion that was not used."""
    before, after = judgement.model_error_v
    if not (math.isfinite(before) and math.isfinite(after)):
        return "the model error could not be measured on the motion that was not used"
    return (
        f"model error on {MOTION_WORDS['unused']}: {before:.3g} → {after:.3g} V rms, "
        f"with the start values of each configuration"
    )
