"""For each effect, the form of it that explains most: variable projection.

The linear parameters are fitted at every trial; the nonlinear ones are scanned over the forms that
the effect itself proposes, then refined by a simplex or by evolution. Effects that are periodic
start from the lines of a spectrum instead of a scan.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.evolution import evolved
from motorctl.identify.diagnose.search.held_out_blocks import residual
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import Form, by_simplex, measure
from motorctl.identify.diagnose.search.option_ranges import LONGEST_PITCH, at_bound
from motorctl.identify.diagnose.search.spectral_lines import (
    position_spectrum,
    strongest,
    time_spectrum,
)
from motorctl.model import Effect, Spans
from motorctl.model.pitch import PitchOptions
from motorctl.model.sign_function import Sign, with_sign

Array = NDArray[np.float64]

WAVES = frozenset({"wave_over_position", "wave_over_time"})
"""Groups whose effects start from the lines of a spectrum instead of a scan."""
LINES = 6
"""Lines of a spectrum that are tried. The strongest may be a chance one beside a strong rest: fewer
misses the right one, more takes time. Chosen by hand."""
MOST_ORDER = 12
"""Highest order of a pitch that its strongest line may be: motors and screws show these and lower
ones. Larger finds long pitches by chance, smaller misses fundamentals without a line. Chosen by
hand."""
ORDER_GAIN = 0.004
"""An order is kept where it takes this part of what the others of its effect take. Larger drops
weak orders, smaller keeps chance ones. Chosen by hand."""
SLOW_PART = 0.15
"""Pitches beyond this part of the travel are rather a slow variation over it. Smaller shortens true
pitches, larger keeps false long ones. Chosen by hand."""
SLOW_GAIN = 0.12
"""The most that such a variation may account for, of what an effect takes away. Larger drops true
orders, smaller keeps a pitch that is a multiple of the true one. Chosen by hand."""
FINER_PART = 0.05
"""A form is made richer, a spline finer, where that removes this part of what is left once other
effects are there too. Larger leaves it coarse, smaller fits noise. Chosen by hand."""
STRAY_GAIN = 0.03
"""The most that a single order which does not fit the others may account for. Larger drops true
orders, smaller keeps chance ones. Chosen by hand."""
RICHER_PART = 0.004
"""A simpler form that misses no more than this part of what the richest takes away is preferred.
Larger leaves orders or knots out, smaller adds ones that fit noise. Chosen by hand."""
RICHER_GAIN = 0.01
"""A richer form is taken where it removes this part of what the simpler one leaves. Larger leaves
orders or knots out, smaller adds ones that fit noise. Chosen by hand."""
RICHER_STEPS = 4
"""Times that a form is made richer, at most. Larger takes time, smaller leaves forms coarse. Chosen
by hand."""
BESIDE = 14
"""Forms of a scan with many valleys from which others evolve, beside the best. More leave less to
chance, fewer keep less of what the scan showed. Chosen by hand: a quarter of what evolves."""
NEAR = 3.0
"""A form is refined where its gain is at least the best one's over this. Larger takes time, smaller
misses forms with a coarse scan. Chosen by hand."""
AS_A_CORNER = 0.75
"""Part of what a friction takes away that its form at the corner of any friction takes as well,
from which it is that corner. Larger names effects for a friction that is dry or turns over
otherwise, smaller doubts true ones close to the corner. Chosen by hand on machines of other hands:
where friction is dry or only steeper than declared it is 0.57 to 0.999, where the effect is there
at most 0.54."""
ONE_LINE = 1.5
"""Width of a spectral line, in cycles over the travel, within which there is no second one. Larger
hides close orders, smaller finds a line's own shoulder. Chosen by hand: a line's first zero
is at 1, its first sidelobe's top just below 1.5."""
SAME_LINE = 0.5
"""Distance of a line from a multiple of a pitch's wave number, in cycles over the travel, up to
which it is that order. Larger takes chance lines for orders, smaller misses true ones whose top is
blurred. Chosen by hand: half of a line's half width."""
BETTER = 1e-3
"""Part of the held-out residual that another pitch must save to be taken instead. Larger keeps the
first pitch, smaller exchanges by chance. Chosen by hand."""
MOST_FUNDAMENTALS = 4
"""Pitches that are tried for a set of lines, those of the most orders first. More takes time, fewer
may miss the right one. Chosen by hand."""
ORDER_MATTERS = 0.05
"""Part of the held-out residual that an order must save to be kept, whatever the others of its
effect take. Larger leaves all to `ORDER_GAIN`, smaller keeps chance ones. Chosen by hand."""


def candidates(hypothesis: Hypothesis, spans: Spans) -> list[type[Effect]]:
    """Return the effects that the hypothesis lacks and that could be tried.

    With the command on the left, functions of the command would explain it by itself.
    """
    present = {e.name for e in (*hypothesis.regressors.declared.effects, *hypothesis.added)}
    barred = "input" if hypothesis.regressors.side == "command" else None
    return [
        cls
        for name, cls in hypothesis.regressors.catalogue.items()
        if name not in present
        and cls.kind != barred
        and (cls.kind != "measurement" or cls.amplitudes)
    ]


def best_form(
    hypothesis: Hypothesis, cls: type[Effect], spans: Spans, sign: Sign | None
) -> Form | None:
    """Return the best form of an effect, roughly: not yet refined; None where there is none."""
    if cls.groups & WAVES:
        forms: Iterable[Effect] = _lines(hypothesis, cls, spans)
    else:
        forms = cls.trials(spans)
    if "wave_of_measurement" in cls.groups:
        forms = [*forms, *_lines(hypothesis, cls, spans)]
    scanned = [measure(hypothesis, with_sign(form, sign), scan=True) for form in forms]
    found = [form for form in scanned if form is not None]
    best = min(found, key=lambda form: form.sse, default=None)
    if best is not None and best is scanned[-1]:
        beyond = (measure(hypothesis, form, scan=True) for form in cls.trials_beyond(spans))
        found += [form for form in beyond if form is not None]
        best = min(found, key=lambda form: form.sse)
    if best is not None and not best.effect.steps(spans):
        best = _richest(hypothesis, best, spans)
    if best is not None and cls.valleys_along:
        rest = sorted((form for form in found if form is not best), key=lambda form: form.sse)
        best = replace(best, others=tuple(rest[:BESIDE]))
    return best


def _richest(hypothesis: Hypothesis, form: Form, spans: Spans) -> Form:
    """Take the simplest of the richer forms that is nearly as good as the best of them."""
    richer = [measure(hypothesis, effect) for effect in form.effect.richer(spans)]
    forms = sorted(
        [form, *(f for f in richer if f is not None)], key=lambda f: len(f.effect.parameters)
    )
    best = min(f.held_out for f in forms)
    gained = hypothesis.held_out - best
    enough = best + RICHER_PART * max(gained, 0.0)
    return next(f for f in forms if f.held_out <= enough)


def finer(hypothesis: Hypothesis, form: Form, spans: Spans) -> Form:
    """Take a richer form, where that removes a good part of what is left by now."""
    if form.effect.groups & WAVES:  # their orders are found together with their pitch
        return form
    best = form
    for effect in form.effect.richer(spans):
        found = measure(hypothesis, effect)
        if found is not None and found.held_out < best.held_out * (1.0 - FINER_PART):
            best = found
    return best


def refined(hypothesis: Hypothesis, form: Form, spans: Spans) -> Form:
    """Refine the nonlinear options of a form, then make it richer while that pays.

    By a simplex, or by evolution where an effect's residual has many valleys.
    """
    if form.effect.valleys_along and form.effect.steps(spans):
        form = evolved(hypothesis, (form, *form.others), spans)
    best = _lacking(hypothesis, by_simplex(hypothesis, form, spans), spans)
    if "wave_over_position" in best.effect.groups:
        best = with_orders(hypothesis, best, spans)
        return by_simplex(hypothesis, best, spans)
    rich = _richest(hypothesis, best, spans)
    return _lacking(hypothesis, by_simplex(hypothesis, rich, spans), spans)


def _lacking(hypothesis: Hypothesis, form: Form, spans: Spans) -> Form:
    """Take what the effect may lack away from a form, unless it pays or cannot be."""
    for name in form.effect.may_lack:
        if getattr(form.effect.options, name) == 0.0:
            continue
        plain = measure(hypothesis, form.effect.with_options(**{name: 0.0}))
        if plain is None:
            continue
        plain = by_simplex(hypothesis, plain, spans, fixed={name})
        pays = form.held_out < plain.held_out * (1.0 - FINER_PART)
        if not pays or at_bound(form.effect, spans):
            form = plain
    return form


def is_corner(hypothesis: Hypothesis, form: Form) -> bool:
    """Return whether an effect explains hardly more than the corner that any friction has."""
    return corner_takes(hypothesis, form) > AS_A_CORNER


def corner_takes(hypothesis: Hypothesis, form: Form) -> float:
    """Return what its corner takes away, over what the effect does; 0 where it has none."""
    corner = form.effect.corner()
    found = None if corner is None else measure(hypothesis, corner)
    taken = hypothesis.held_out - form.held_out
    if found is None or not taken > 0.0:
        return 0.0
    return (hypothesis.held_out - found.held_out) / taken


def with_orders(hypothesis: Hypothesis, form: Form, spans: Spans) -> Form:
    """Find the other orders of a periodic effect, and from all of them its pitch."""
    cls = type(form.effect)
    waves = [1.0 / form.effect.repeats_every]
    current = hypothesis.plus(form.effect)
    for _ in range(LINES - 1):
        kappa, gain = _spectrum(current, cls)
        near = np.min(np.abs(kappa[:, None] - np.array(waves)[None]), axis=1)
        gain = np.where(near < ONE_LINE / spans.travel_m, 0.0, gain)
        place = strongest(kappa, gain, 1)
        if not place:
            break
        waves.append(place[0])
        sines = [cls.at_line(k) for k in waves]
        current = _beside(hypothesis, sines)
    best = form
    for pitch, orders in _fundamentals(waves, spans):
        effect = form.effect.with_options(pitch_m=pitch, orders=orders)
        found = measure(hypothesis, effect)
        if found is None:
            continue
        found = by_simplex(hypothesis, found, spans)
        found = pruned(hypothesis, found)
        if found.held_out < best.held_out * (1.0 - BETTER):
            best = found
    for _ in range(RICHER_STEPS):
        richer = [measure(hypothesis, effect) for effect in best.effect.richer(spans)]
        found_ = min((f for f in richer if f is not None), key=lambda f: f.held_out, default=None)
        if found_ is None or found_.held_out > best.held_out * (1.0 - RICHER_GAIN):
            break
        best = found_
    return fundamental(hypothesis, pruned(hypothesis, by_simplex(hypothesis, best, spans)), spans)


def _beside(hypothesis: Hypothesis, sines: Sequence[Effect]) -> Hypothesis:
    return Hypothesis(hypothesis.regressors, (*hypothesis.added, *sines), hypothesis.acceleration)


def all_lines(hypothesis: Hypothesis, cls: type[Effect], spans: Spans) -> float:
    """Return the squared held-out residual that all the strongest lines leave together.

    One line of a wave of many orders is but a small part of it.
    """
    sines = _lines(hypothesis, cls, spans)
    return _beside(hypothesis, sines).held_out if sines else hypothesis.held_out


def _lines(hypothesis: Hypothesis, cls: type[Effect], spans: Spans) -> list[Effect]:
    over_time = "wave_over_time" in cls.groups
    found = _time_lines(hypothesis) if over_time else _spectrum(hypothesis, cls)
    return [cls.at_line(line) for line in strongest(*found, LINES)]


def _time_lines(hypothesis: Hypothesis) -> tuple[Array, Array]:
    return time_spectrum(hypothesis.regressors.signals, _left_over(hypothesis))


def _spectrum(hypothesis: Hypothesis, cls: type[Effect]) -> tuple[Array, Array]:
    signals = hypothesis.regressors.signals
    weight = None
    if cls.kind == "input":
        weight = signals.picked(lambda s: s.command)
    elif cls.kind == "measurement":  # its apparent acceleration grows with the speed's square
        weight = signals.picked(lambda s: s.v**2)
        kappa, gain = position_spectrum(signals, _left_over(hypothesis), weight)
        # fast motion shows it, so a wave that passes the band in slow motion alone is none
        fast = float(np.sqrt(np.mean(weight)))
        return kappa, np.where(kappa * fast < signals.band_hz, gain, 0.0)
    return position_spectrum(signals, _left_over(hypothesis), weight)


def _left_over(hypothesis: Hypothesis) -> Array:
    problem = hypothesis.problem
    return residual(problem, hypothesis.solution.b)[: hypothesis.regressors.signals.rows]


def _fundamentals(waves: list[float], spans: Spans) -> list[tuple[float, tuple[int, ...]]]:
    """Return pitches of which the lines are whole orders, with these orders."""
    found: dict[tuple[float, tuple[int, ...]], float] = {}
    tolerance = SAME_LINE / spans.travel_m
    first = waves[0]
    for k in range(1, MOST_ORDER + 1):
        base = first / k
        if base * LONGEST_PITCH * spans.travel_m < 1.0:
            break
        orders = {k}
        for wave in waves[1:]:
            order = round(wave / base)
            if 1 <= order <= 2 * MOST_ORDER and abs(wave - order * base) < tolerance:
                orders.add(order)
        if k > 1 and len(orders) == 1:
            continue
        if np.gcd.reduce(list(orders)) > 1:
            continue
        found[(1.0 / base, tuple(sorted(orders)))] = len(orders)
    ordered = sorted(found, key=lambda item: (-found[item], -1.0 / item[0]))
    return ordered[:MOST_FUNDAMENTALS]


def fundamental(hypothesis: Hypothesis, form: Form, spans: Spans) -> Form:
    """Shorten a pitch of which only multiples are left, or that a slow variation made so long."""
    orders, pitch = _orders(form.effect), form.effect.repeats_every
    for divisor in range(max(orders), 1, -1):
        multiples = tuple(k // divisor for k in orders if k % divisor == 0)
        if not multiples:
            continue
        shorter = form.effect.with_options(pitch_m=pitch / divisor, orders=multiples)
        found = measure(hypothesis, shorter)
        if found is None:
            continue
        lost = found.sse - form.sse
        slow = pitch >= SLOW_PART * spans.travel_m
        most = SLOW_GAIN if slow or len(multiples) == len(orders) else STRAY_GAIN
        if lost < most * (hypothesis.solution.sse - form.sse):
            return found
    return form


def pruned(hypothesis: Hypothesis, form: Form) -> Form:
    """Drop orders that hardly take anything away."""
    orders = _orders(form.effect)
    without = hypothesis.solution.sse
    best = form
    for order in orders:
        left = _orders(best.effect)
        if len(left) == 1:
            break
        fewer = best.effect.with_options(orders=tuple(k for k in left if k != order))
        found = measure(hypothesis, fewer)
        if found is None:
            continue
        lost = found.held_out - best.held_out
        least = min(ORDER_GAIN * max(without - best.sse, 0.0), ORDER_MATTERS * best.held_out)
        if lost < least:
            best = found
    return best


def _orders(effect: Effect) -> tuple[int, ...]:
    """Return the orders of a wave over position."""
    assert isinstance(effect.options, PitchOptions)
    return effect.options.orders
