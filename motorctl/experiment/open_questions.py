"""What a diagnosis leaves open: look-alikes of a name, effects unseen, wide errors."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.experiment.information import Products, Trace, products_of, products_with
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.result import AxisDiagnosis, FoundEffect
from motorctl.identify.diagnose.search.acceptance import LEAST_GAIN
from motorctl.identify.diagnose.search.forms import best_form, refined
from motorctl.identify.diagnose.search.hypothesis import Catalogue, Hypothesis
from motorctl.identify.diagnose.search.search import whitened
from motorctl.identify.diagnose.verdict.errors import FAINT, SAME, TOLD_APART
from motorctl.identify.diagnose.verdict.testable import ordinary
from motorctl.model import Spans, known_effects
from motorctl.model.sign_function import Sign, sign_of, slope_of, with_sign

Array = NDArray[np.float64]
Kind = Literal["which", "whether", "how much"]

SURE = 0.9
"""Confidence from which a name is settled. Larger asks for motion that tells little more, smaller
ends with names that are wrong more often than one in ten. By convention."""
NEAR_RIVAL = 0.4
"""Share of the gain of the effect named from which another is its rival while the name is not sure.
Larger overlooks rivals, smaller weighs motions by what is no question. By hand."""
MOST_RIVALS = 2
"""For each name. More take time, fewer may miss the true one. By hand."""
WIDE = 0.1
"""Standard error over the value from which a parameter is still wide. Larger leaves it so, smaller
moves on for digits that no tracking error shows. By hand."""
MATTERS = 0.01
"""Force of an effect that was not seen, over the command, both rms, in the question whether it is
there. Larger overlooks what matters, smaller asks for what does not. By hand."""
SEEN_GAIN = 2.0 * LEAST_GAIN
"""Log-likelihood by which an effect of that size would have shown, from which it is not asked about
any more. Larger takes motion, smaller calls models complete that are not. By hand: what a name
needs at least, and as much again for what else is left over."""


@dataclass(frozen=True)
class Question:
    """Something about an axis that the recordings so far leave open."""

    axis: str
    kind: Kind
    effects: tuple[str, ...]
    """What it is about: the name first, then its look-alike."""
    words: str
    truths: tuple[Hypothesis, ...]
    """Each in turn is taken for the truth, and the next for its rival; of "how much" only one."""
    known: float
    """Log-likelihood that the recordings have told; of "how much" the standard error in parts."""
    needed: float
    """What would settle it, in the same measure."""
    needed_per_row: float = 0.0
    """What each further row has to tell besides, where what is left over is the measure."""
    hopeless: str = ""
    """Why no motion settles it, whatever it is."""
    parameter: int = -1
    """Of "how much": which column."""
    trace: Trace | None = None
    """Of an effect that was not seen: what it would leave."""


@dataclass(frozen=True)
class Open:
    """What is open about one axis, and what is needed to weigh motions by it."""

    axis: str
    questions: tuple[Question, ...]
    best: Hypothesis
    spans: Spans
    variance: float
    """Of the rows' noise, with all that the best hypothesis leaves."""
    products: Mapping[int, Products]
    """Over what was recorded, by the id of a hypothesis."""


def is_sure(axis: AxisDiagnosis, inseparable: Collection[str] = ()) -> bool:
    """Return whether a diagnosis leaves no name open but those that no motion can settle."""
    if axis.verdict not in ("effect", "complete"):
        no_more = bool(inseparable) and _only(axis, inseparable)
        return axis.verdict == "insufficient_data" and no_more
    named = [e for e in axis.effects if e.name not in inseparable]
    return _only(axis, inseparable) and all(
        e.confidence >= SURE and not e.indistinguishable_from for e in named
    )


def _only(axis: AxisDiagnosis, inseparable: Collection[str]) -> bool:
    """Return whether the diagnosis misses a motion for nothing else."""
    return all(set(missing.effects) <= set(inseparable) for missing in axis.missing)


def open_questions(axis: AxisDiagnosis, catalogue: Catalogue | None = None) -> Open:
    """Return what a diagnosis leaves open.

    Parameters
    ----------
    axis
        The diagnosis.
    catalogue
        The effects that were tried, by name; every known one by default.

    Raises
    ------
    DataError
        Where its recording cannot be prepared.
    """
    catalogue = known_effects() if catalogue is None else catalogue
    slope, sign = slope_of(axis.declared.effects), sign_of(axis.declared.effects)
    signals = make_signals(axis.data, slope_s_m=slope)
    added = tuple(found.effect for found in axis.effects)
    regressors, _ = whitened(signals, axis.declared, added, "acceleration", catalogue)
    best = Hypothesis(regressors, added).refreshed()
    spans = spans_of(signals)
    rows = regressors.signals.rows
    if not math.isfinite(best.solution.sse) or best.solution.sse <= 0.0:
        raise DataError(f"{axis.data.place}: its rows cannot be fitted")
    variance = best.solution.sse / max(rows - best.problem.size, 1)
    products = {id(best): products_of(best, spans)}
    found = [
        *_which(axis, best, spans, sign, variance, products, catalogue),
        *_whether(axis, best, variance),
        *_unseen(axis, best, spans, sign, variance, catalogue),
        *_how_much(axis, best, products[id(best)], variance),
    ]
    for question in found:
        for hypothesis in question.truths:
            if id(hypothesis) not in products:
                products[id(hypothesis)] = products_of(hypothesis, spans)
    return Open(axis.data.axis, tuple(found), best, spans, variance, products)


def _which(
    axis: AxisDiagnosis,
    best: Hypothesis,
    spans: Spans,
    sign: Sign | None,
    variance: float,
    products: dict[int, Products],
    catalogue: Catalogue,
) -> Iterator[Question]:
    """Yield a question for each name and each effect that could stand in its place."""
    for named in axis.effects:
        for other in _rivals(named):
            rest = best.without(named.name)
            if other not in catalogue or other in (e.name for e in rest.added):
                continue
            form = best_form(rest, catalogue[other], spans, sign)
            if form is None:
                continue
            rival = rest.plus(refined(rest, form, spans).effect).refreshed()
            products[id(rival)] = products_of(rival, spans)
            left = products[id(rival)].left_over - products[id(best)].left_over
            known = 0.5 * left / variance
            twin = other in named.indistinguishable_from
            rows = best.regressors.signals.rows
            needed = 0.5 * SAME * rows if twin else max(2.0 * known, LEAST_GAIN)
            timing = twin and named.effect.kind == "command"
            yield Question(
                axis=axis.data.axis,
                kind="which",
                effects=(named.name, other),
                words=f"{named.name} or {other}",
                truths=(best, rival),
                known=max(known, 0.0),
                needed=max(known, 0.0) + max(needed - known, LEAST_GAIN),
                needed_per_row=0.5 * SAME if twin else 0.0,
                hopeless=_too_alike(named, other, best) if timing else "",
            )
            if timing:
                yield _clear_enough(named, other, best, rest, variance)


def _clear_enough(
    named: FoundEffect, other: str, best: Hypothesis, rest: Hypothesis, variance: float
) -> Question:
    """Return the question whether a lag or delay stands out so far that its kind is told."""
    without = rest.refreshed()
    return Question(
        axis=best.regressors.signals.data.axis,
        kind="whether",
        effects=(named.name, other),
        words=f"whether {named.name} stands out enough to be told from {other}",
        truths=(best, without),
        known=max(0.5 * (without.solution.sse - best.solution.sse) / variance, 0.0),
        needed=0.5 * (FAINT - 1.0) * best.regressors.signals.rows,
        needed_per_row=0.5 * (FAINT - 1.0),
    )


def _too_alike(named: FoundEffect, other: str, best: Hypothesis) -> str:
    """Return why a lag cannot be told from a delay, whatever the motion; empty where it can."""
    time_s = named.effect.lag_s + named.effect.delay_s
    band_hz = best.regressors.signals.band_hz
    apart = (2.0 * math.pi * band_hz * time_s) ** 2
    if apart >= TOLD_APART:
        return ""
    return (
        f"of {1e3 * time_s:.3g} ms their responses differ by {50.0 * apart:.2g} % at the end of "
        f"the band, {band_hz:.3g} Hz, and {50.0 * TOLD_APART:.2g} % are needed"
    )


def _rivals(named: FoundEffect) -> Sequence[str]:
    alike = list(named.indistinguishable_from)
    if named.confidence < SURE:
        near = sorted(named.alternatives, key=lambda each: -each.share)
        alike += [each.name for each in near if each.share >= NEAR_RIVAL and each.name not in alike]
    return alike[:MOST_RIVALS]


def _whether(axis: AxisDiagnosis, best: Hypothesis, variance: float) -> Iterator[Question]:
    """Yield a question for each name that is not sure, though no other comes near."""
    for named in axis.effects:
        if named.confidence >= SURE or _rivals(named):
            continue
        rest = best.without(named.name).refreshed()
        told = 0.5 * (rest.solution.sse - best.solution.sse) / variance
        yield Question(
            axis=axis.data.axis,
            kind="whether",
            effects=(named.name,),
            words=f"{named.name} or not",
            truths=(best, rest),
            known=max(told, 0.0),
            needed=max(2.0 * told, LEAST_GAIN),
        )


def _unseen(
    axis: AxisDiagnosis,
    best: Hypothesis,
    spans: Spans,
    sign: Sign | None,
    variance: float,
    catalogue: Catalogue,
) -> Iterator[Question]:
    """Yield a question for each effect that could be there and not have shown.

    Asked are those without which no model is called complete, and what the diagnosis says that
    this motion does not show: each in a form of middling options, at the least size that matters.
    """
    present = {e.name for e in (*axis.declared.effects, *best.added)}
    alike = {name for e in axis.effects for name in e.indistinguishable_from}
    asked = {cls.name for cls in ordinary(catalogue)}
    asked |= {name for missing in axis.missing for name in missing.effects} | set(axis.doubted)
    command = best.problem.columns[:, best.regressors.command_column]
    size = MATTERS * math.sqrt(float(np.mean(command**2)))
    for name in sorted(asked - present - alike):
        form = catalogue[name].typical(spans) if name in catalogue else None
        if form is None or form.kind not in ("state", "input") or not form.parameters:
            continue
        form = with_sign(form, sign)
        peak = max(float(np.abs(s.columns(form)).max()) for s in best.regressors.signals.stretches)
        trace = Trace(form, abs(float(best.solution.b[0])) * size / (peak or 1.0))
        told = trace.shown(products_with(best, form), variance)
        if told < SEEN_GAIN:
            yield Question(
                axis=axis.data.axis,
                kind="whether",
                effects=(name,),
                words=f"{name} or not",
                truths=(best,),
                known=told,
                needed=SEEN_GAIN,
                trace=trace,
            )


def _how_much(
    axis: AxisDiagnosis, best: Hypothesis, products: Products, variance: float
) -> Iterator[Question]:
    """Yield a question for the widest parameter of each effect that was found."""
    errors = math.sqrt(variance) * products.errors
    values = [*np.abs(best.solution.b)]
    names = list(best.names)
    options = {e.name: e for e in best.added}
    for effect, option in products.options:
        values.append(abs(float(getattr(options[effect].options, option))))
        names.append(effect)
    found = {named.name for named in axis.effects}
    size = float(np.abs(best.solution.b[0]))
    for name in dict.fromkeys(n for n in names if n in found):
        own = [i for i, each in enumerate(names) if each == name]
        linear = [i for i in own if i < len(best.names)]
        # of many amplitudes the largest says how well the effect is known
        wanted = [max(linear, key=lambda i: values[i])] if linear else []
        wanted += [i for i in own if i >= len(best.names)]
        parts = {i: errors[i] / max(values[i], 1e-12 * size) for i in wanted}
        worst = max(parts, key=lambda i: parts[i])
        if parts[worst] > WIDE:
            yield Question(
                axis=axis.data.axis,
                kind="how much",
                effects=(name,),
                words=f"how large {name} is, known to {100.0 * parts[worst]:.2g} %",
                truths=(best,),
                known=float(parts[worst]),
                needed=WIDE,
                parameter=worst,
            )
