"""Whose addition an error that grew is put down to, and what of it is left out next."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from motorctl.close_loop.judge import AxisJudgement
from motorctl.identify.diagnose.result import AxisDiagnosis

MOST_REASONS = 2


def offenders(changed: Collection[str], judgements: Mapping[str, AxisJudgement]) -> dict[str, str]:
    """Return the changed axes that became worse; all changed ones where only others did."""
    against = {
        name: "; ".join(judgement.against[:MOST_REASONS])
        for name, judgement in judgements.items()
        if not judgement.accepted
    }
    own = {name: against[name] for name in changed if name in against}
    return own or dict.fromkeys(changed, "; ".join(f"{n}: {why}" for n, why in against.items()))


def weaker_half(found: AxisDiagnosis, added: Collection[str]) -> list[str]:
    """Name those of the added effects that explain less; none where there is only one."""
    scores = {effect.name: effect.score for effect in found.effects}
    # A spline that compensates what has no name goes first.
    strongest_first = sorted(added, key=lambda name: scores.get(name, -1.0), reverse=True)
    return strongest_first[-(-len(added) // 2) :]


def unnamed_spline(found: AxisDiagnosis, added: Collection[str]) -> str:
    """Name the spline that an axis gains for what has no name; empty where it gains none."""
    unknown = found.unknown
    spline = None if unknown is None or unknown.compensation is None else unknown.compensation.name
    return spline if spline is not None and spline in added else ""
