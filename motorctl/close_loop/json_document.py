"""The rounds as the JSON document of ``close-loop --json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple
from typing import Any

from motorctl.close_loop.attempts import Attempt
from motorctl.close_loop.judge import AxisJudgement
from motorctl.close_loop.matched_velocity import VelocityStep
from motorctl.close_loop.rounds import ClosedLoop, Round
from motorctl.close_loop.telling import Telling
from motorctl.identify.compare.measures import SYMBOLS, Measures
from motorctl.identify.compare.runs import ratios
from motorctl.identify.diagnose.report.json_document import axis_document
from motorctl.json_values import finite


def closed_loop_document(loop: ClosedLoop) -> dict[str, Any]:
    """Return the document: what came out, and every round."""
    return {
        "config": str(loop.config),
        "out": str(loop.folder),
        "refined": str(loop.refined),
        "ended": loop.ended,
        "axes": {
            name: {"effects": list(effects_added(loop, name)), **_judgement(judgement)}
            for name, judgement in loop.overall.items()
        },
        "velocity": None if loop.velocity is None else _velocity(loop.velocity),
        "rounds": [_round(part) for part in loop.rounds],
    }


def effects_added(loop: ClosedLoop, axis: str) -> tuple[str, ...]:
    """Name the effects that the axis has gained."""
    before = loop.first.machine.axes[axis].declared.names
    return tuple(n for n in loop.last.machine.axes[axis].declared.names if n not in before)


def _velocity(step: VelocityStep) -> dict[str, Any]:
    return {
        "kept": sorted(step.kept),
        "axes": {name: _judgement(judged) for name, judged in step.judgements.items()},
    }


def _round(part: Round) -> dict[str, Any]:
    accepted = part.accepted
    return {
        "round": part.number,
        "folder": str(part.folder),
        "motion": part.motion,
        "recording": part.diagnosis.source,
        "axes": {name: axis_document(axis) for name, axis in part.diagnosis.axes.items()},
        "refused": dict(part.diagnosis.refused),
        "attempts": [_attempt(attempt) for attempt in part.attempts.tried],
        "accepted": None if accepted is None else str(accepted.refinement.out),
        "shares": {
            name: {"added": list(part.added(name)), **_judgement(judgement)}
            for name, judgement in part.attempts.shares.items()
        },
        "experiments": [] if part.telling is None else _experiments(part.telling),
        "inseparable": [] if part.telling is None else _inseparable(part.telling),
        "left_out": {name: list(words) for name, words in part.attempts.dropped.items()},
    }


def _experiments(telling: Telling) -> list[dict[str, Any]]:
    return [
        {
            "motion": each.candidate.words,
            "duration_s": each.duration_s,
            "settles": list(each.settles),
        }
        for each in telling.experiments
    ]


def _inseparable(telling: Telling) -> list[str]:
    return [each.words for each in telling.standing.inseparable]


def _attempt(attempt: Attempt) -> dict[str, Any]:
    return {
        "config": str(attempt.refinement.out),
        "beside": None if attempt.beside is None else str(attempt.beside),
        "tried": list(attempt.tried),
        "accepted": attempt.accepted,
        "axes": {
            name: {
                "added": list(attempt.added(name)),
                "changed": name in attempt.refinement.axes
                and attempt.refinement.axes[name].changed,
                **_judgement(judgement),
            }
            for name, judgement in attempt.judgements.items()
        },
    }


def _judgement(judgement: AxisJudgement) -> dict[str, Any]:
    before, after = judgement.model_error_v
    return {
        "accepted": judgement.accepted,
        "against": list(judgement.against),
        "model_error": {"unit": "V", "before_rms": finite(before), "after_rms": finite(after)},
        "tracking": {
            motion: {
                "before": _measures(first),
                "after": _measures(second),
                "ratio": {k: finite(v) for k, v in ratios(first, second).items()},
            }
            for motion, (first, second) in judgement.tracking.items()
        },
    }


def _measures(measures: Measures) -> Mapping[str, float]:
    return dict(zip(SYMBOLS, astuple(measures), strict=True))
