"""The verdict: complete, effect, unknown structure, or insufficient data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.insight.diagnosis.basis import VARIABLES, Rivals
from motorctl.insight.diagnosis.hypothesis import Hypothesis
from motorctl.insight.diagnosis.result import Verdict
from motorctl.insight.diagnosis.score import held_out_sse, residual, with_columns
from motorctl.insight.diagnosis.search import NOISE_LIKE, Found
from motorctl.insight.diagnosis.whitening import spectrum
from motorctl.insight.fit_options import Side

Array = NDArray[np.float64]

STRUCTURE = 0.08
"""Part of the squared residual that a smooth function must take away to count."""
RIVAL_SHARE: dict[Side, float] = {"acceleration": 0.12, "command": 0.35}
"""Part of the explainable error that the named effects may leave to a smooth function: more where
a machine is not down to its noise anyway."""
SURE_BESIDE = 0.3
"""Part of it that named effects must take to be told beside unknown structure."""
NAMED_ENOUGH = 0.6
"""Part of the explainable error that named effects must take to be the answer."""
LEFT_OVER: dict[Side, float] = {"acceleration": 0.1, "command": 0.3}
"""Part of the explainable error that named effects may leave coloured in time: more where a
machine is not down to its noise anyway."""
KEPT = 0.3
"""An effect that loses more than the rest of its share to a smooth function was its shadow."""
COLOURED = 3.0
"""Low-frequency residual over the noise model."""
LOW_HZ = 20.0
CLEAR_LEAD = 1.15
"""A rival of more variables must gain this much more than one of fewer."""


@dataclass(frozen=True)
class Judged:
    """The verdict, and what it rests on."""

    verdict: Verdict
    kept: tuple[str, ...]
    """Names that stand."""
    rival: str | None
    """The smooth function that says what unknown structure depends on."""
    explainable: float
    """Squared residual of the declared model above the noise."""
    named_share: float
    rival_share: float
    coloured: float


def judge(found: Found) -> Judged:
    """Weigh the named effects against smooth functions that assume no physics."""
    noise = found.final.noise_sse(found.force_noise)
    base, final = found.base.held_out, found.final.held_out
    floor = min(noise, final)
    explainable = max(base - floor, 1e-300)
    rival, gain = _strongest(found)
    coloured = low_frequency_excess(found)
    names = tuple(effect.name for effect in found.final.added)
    named_share = (base - final) / explainable if names else 0.0
    rival_share = max(gain, 0.0) / explainable
    noisy = final <= NOISE_LIKE * noise
    structured = gain > STRUCTURE * final and not noisy

    def judged(verdict: Verdict, kept: tuple[str, ...], by: str | None) -> Judged:
        return Judged(verdict, kept, by, explainable, named_share, rival_share, coloured)

    if not names:
        if structured:
            return judged("unknown_structure", (), rival)
        if coloured > COLOURED and not noisy:
            return judged("unknown_structure", (), None)
        return judged("complete", (), None)
    if structured and rival_share > RIVAL_SHARE[found.final.bench.side]:
        kept = _standing(found, rival, names)
        share = _share_of(found, kept, explainable)
        if share < NAMED_ENOUGH:
            return judged("unknown_structure", kept if share > SURE_BESIDE else (), rival)
        return judged("effect", kept, rival)
    if named_share < NAMED_ENOUGH and not noisy:
        return judged("unknown_structure", (), rival if structured else None)
    left_over = LEFT_OVER[found.final.bench.side]
    if 1.0 - named_share > left_over and coloured > COLOURED and not noisy:
        return judged("unknown_structure", (), None)
    return judged("effect", names, None)


def low_frequency_excess(found: Found) -> float:
    """Give the residual's power at low frequencies over what the noise model expects."""
    hypothesis = found.final
    rows = residual(hypothesis.problem, hypothesis.solution.b)[: hypothesis.bench.frame.rows]
    frequency, density = spectrum(rows, hypothesis.bench.frame.row_period_s)
    low = (frequency > 0.0) & (frequency < LOW_HZ)
    if hypothesis.bench.side == "command":
        density = density * float(hypothesis.b[0]) ** 2
    return float(np.mean(density[low]) / found.force_noise)


def depends_on(rival: str | None) -> tuple[str, ...]:
    """Say which variables a smooth function is one of."""
    return () if rival is None else VARIABLES[rival]


def _strongest(found: Found) -> tuple[str | None, float]:
    """Give the rival that gains most; one of fewer variables where it gains nearly as much."""
    best: str | None = None
    for name in sorted(found.rival_gains, key=lambda n: len(VARIABLES[n])):
        gain = found.rival_gains[name]
        wider = best is not None and len(VARIABLES[name]) > len(VARIABLES[best])
        if best is None or gain > found.rival_gains[best] * (CLEAR_LEAD if wider else 1.0):
            best = name
    return best, 0.0 if best is None else found.rival_gains[best]


def _standing(found: Found, rival: str | None, names: tuple[str, ...]) -> tuple[str, ...]:
    """Keep the names that still explain what they explained once the smooth function is there."""
    if rival is None:
        return names
    columns = Rivals(found.final.bench.frame).columns(rival)

    def left(hypothesis: Hypothesis, beside: bool) -> float:
        if not beside:
            return hypothesis.held_out
        return float(held_out_sse(with_columns(hypothesis.problem, columns, soft=True)).sum())

    kept = []
    for name in names:
        rest = found.final.without(name)
        alone = left(rest, False) - left(found.final, False)
        beside = left(rest, True) - left(found.final, True)
        if beside > KEPT * alone:
            kept.append(name)
    return tuple(kept)


def _share_of(found: Found, kept: tuple[str, ...], explainable: float) -> float:
    hypothesis = found.final
    for effect in found.final.added:
        if effect.name not in kept:
            hypothesis = hypothesis.without(effect.name)
    return (found.base.held_out - hypothesis.held_out) / explainable
