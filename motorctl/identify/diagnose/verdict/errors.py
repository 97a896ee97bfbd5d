"""What a search means: the errors before and after, and how sure one can be of each effect."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.left_side import Side
from motorctl.identify.diagnose.result import Alternative, ModelError
from motorctl.identify.diagnose.search.acceptance import gain
from motorctl.identify.diagnose.search.held_out_blocks import (
    BlockedFit,
    BlockedRegression,
    held_out_sse,
    residual,
    solve,
    with_columns,
)
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.measured_forms import by_simplex, measure
from motorctl.identify.diagnose.search.search import Found
from motorctl.identify.diagnose.search.simulated_position import (
    judge_by_simulation,
    position_of_declared,
    simulated_position,
)
from motorctl.identify.diagnose.search.smooth_functions import SmoothFunctions
from motorctl.identify.diagnose.search.whole_model import known_inertias
from motorctl.model import Effect

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

HELD_OUT_EVERY = 3
"""One block in so many is held out where the recording does not say which. More fits with more and
judges with less. Chosen by hand; as many as there are folds."""
LEAST_HELD_OUT, MOST_HELD_OUT = 0.02, 0.9
"""Parts of the rows between which the recording's own choice is followed. Closer together ignores
what its author asked for, further apart judges with next to nothing, or fits to it. Chosen by
hand."""
REPORT_HZ = 100.0
"""Band of pictures, and of errors on another recording [Hz]: that in which `fit` works. Larger
shows noise, smaller hides effects. Arithmetic: `fit`'s widest band."""
RIVAL = 0.5
"""Part of the gain of the effect taken from which another may be told to be indistinguishable.
Larger overlooks rivals, smaller takes time. Chosen by hand."""
RIVAL_STEPS = 20
"""Steps of the simplex search for such a rival. More takes time, fewer leaves it short of its best,
which hides it. Chosen by hand."""
FAINT = 8.0
"""Squared residual without a lag or delay, over the noise's, below which the two cannot be told
apart. Larger doubts clear ones, smaller names one by chance. Chosen by hand."""
TOLD_APART = 0.05
"""Square of a lag times the band's end [rad^2], below which it cannot be told from a delay: the two
responses differ by half of it, (w T)^2 / 2. Larger doubts clear ones, smaller names one by chance.
Chosen by hand on the simulated campaign."""
SAME = 0.02
"""Forms whose squared residuals differ by less than this part of it cannot be told apart. Larger
doubts clear names, smaller gives one of two by chance. Chosen by hand."""
HALF_AS_GOOD = 2.0
"""Squared residual above the noise that a delay leaves over what a lag does, or the reverse, below
which the two cannot be told apart: what neither describes is no noise, and bends each its own way.
Larger doubts clear ones, smaller names the wrong one of the two. Chosen by hand on the simulated
campaign: wrong ones had 1.1 and 1.4, right ones beside no other effect 3 and more."""

MOST_AHEAD = 10.0
"""Gain of a rival over that of the effect named, beyond which more says nothing, as where the
effect gains nothing at all. Larger or smaller changes the report's figure alone: confidence counts
no more. Convention: a name ten times behind is no name."""

CLEARLY_BEATEN = 2.0
"""Squared error that a name leaves over what an effect of the input leaves, from which that one is
its rival. Larger overlooks rivals, smaller doubts what a tie says nothing against. Chosen by hand:
as a plain effect's lead; a payload named for a motor's heat has 3."""


@dataclass(frozen=True)
class Split:
    """Which rows are fitted and which are held out; (m,)."""

    held_out: Rows
    stated: bool
    """Whether the recording's description said so."""


def split_rows(hypothesis: Hypothesis, segments: dict[str, tuple[float, float]]) -> Split:
    """Choose the held-out rows: those of the recording's segment, or every third block."""
    time = hypothesis.regressors.signals.time_s
    if "held_out" in segments:
        begin, end = segments["held_out"]
        inside = (time >= begin) & (time < end)
        if LEAST_HELD_OUT < inside.mean() < MOST_HELD_OUT:
            return Split(inside, True)
    block = np.arange(len(time)) // hypothesis.regressors.blocks.length
    return Split(block % HELD_OUT_EVERY == HELD_OUT_EVERY - 1, False)


def fit_rows(problem: BlockedRegression, chosen: Rows) -> BlockedFit:
    """Fit some of the rows only."""
    weights = problem.blocks.split(chosen[None].astype(np.float64))
    columns = problem.columns * weights
    gram = columns @ columns.swapaxes(1, 2)
    part = BlockedRegression(problem.blocks, (columns,), gram, problem.soft, problem.tied)
    return solve(part, problem)


def columns_of(hypothesis: Hypothesis, extra: Effect | None = None) -> BlockedRegression:
    """Return the columns of a hypothesis, with one more effect where it is given."""
    return hypothesis.problem if extra is None else hypothesis.extended(extra)


def in_plain_band(
    hypothesis: Hypothesis, extra: Effect | None = None, side: Side | None = None
) -> BlockedRegression:
    """Return the same behind a plain low pass, for pictures; `side` is what stands on the left."""
    old = hypothesis.regressors
    signals = old.signals.plain(REPORT_HZ)
    regressors = Regressors(signals, old.declared, old.blocks, side or old.side)
    return columns_of(Hypothesis(regressors, hypothesis.added, hypothesis.acceleration), extra)


def per_command(found: Found) -> float:
    """Return what one unit of command is in what stands on the left.

    One for all hypotheses of a search: a model with a smaller inertia must not measure itself, and
    the declared model, with units of its own.
    """
    final = found.final
    return 1.0 if final.regressors.side == "command" else abs(float(final.b[0]))


def floor_of(found: Found) -> float:
    """Return the rms that noise alone would leave, in units of the command."""
    signals = found.final.regressors.signals
    if found.final.regressors.side == "acceleration":
        return math.sqrt(signals.row_variance(found.force_noise)) / per_command(found)
    return math.sqrt(signals.noise_variance(found.force_noise)) / abs(float(found.final.b[0]))


def held_out_rms(found: Found, problem: BlockedRegression, split: Split) -> float:
    """Return the rms that a fit to the other rows leaves of those held out, in units of command."""
    r = residual(problem, fit_rows(problem, ~split.held_out).b)[: len(split.held_out)]
    return float(np.sqrt(np.mean(r[split.held_out] ** 2))) / per_command(found)


def model_error(found: Found, split: Split, final: BlockedRegression, unit: str) -> ModelError:
    """Compare the declared model with the whole one on rows that neither was fitted to.

    `final` are the columns of the whole one. Both errors are of the same quantity in the same
    units: of the acceleration or of the recorded command, whichever the search had on the left.
    """
    held = split.held_out
    before = held_out_rms(found, found.base.problem, split)
    after = held_out_rms(found, final, split)
    floor = min(floor_of(found), after, before)
    regressors = found.final.regressors
    command = final.columns[:, regressors.command_column].ravel()[: regressors.signals.rows][held]
    known = known_inertias(found.base) if found.final.added else ()
    declared = position_of_declared(found.base, held, known)
    missed = simulated_position(found.final, held)
    simulated = judge_by_simulation(regressors.signals, declared, missed)
    return ModelError(
        unit=unit,
        held_out_before_rms=before,
        held_out_after_rms=after,
        noise_floor_rms=floor,
        explained_fraction=explained(before, after, floor),
        command_rms=float(np.sqrt(np.mean(command**2))),
        simulated_position_before_rms=None if simulated is None else simulated.before_rms,
        simulated_position_after_rms=None if simulated is None else simulated.after_rms,
        window_s=None if simulated is None else simulated.window_s,
    )


def explained(before: float, after: float, floor: float) -> float:
    """Return the part of the explainable error that is gone, 0 to 1."""
    explainable = before**2 - floor**2
    if explainable <= 0.0:
        return 0.0
    return float(np.clip((before**2 - after**2) / explainable, 0.0, 1.0))


def ambiguous_with(found: Found, effect: Effect) -> list[str]:
    """Return the effects that could stand in an effect's place as well, the others being there."""
    same = []
    noise = found.final.noise_sse(found.force_noise)
    for step in reversed(found.steps):
        if step.taken is None or step.taken.effect.name != effect.name:
            continue
        best = max(gain(step.before, step.taken.held_out), 1e-9)
        present = {e.name for e in found.final.added}
        rest = found.final.without(effect.name)
        for form in step.forms:
            name = form.effect.name
            if name in present or gain(step.before, form.held_out) < RIVAL * best:
                continue
            other = measure(rest, form.effect)
            if other is None:
                continue
            other = by_simplex(rest, other, found.spans, RIVAL_STEPS)
            if draws_any_form(other.effect, effect):
                continue
            most = found.final.held_out * (1.0 + SAME)
            if other.effect.groups & effect.groups and effect.kind == "command":
                floor = min(noise, found.final.held_out)
                most = max(most, floor + HALF_AS_GOOD * (found.final.held_out - floor))
            if other.held_out <= most:
                same.append(name)
        if effect.kind == "command":
            # what the feedback makes of the encoder's noise looks like either
            faint = rest.held_out < FAINT * noise
            # and below this a lag takes too little off the gain to be told from a delay
            time_s = effect.lag_s + effect.delay_s
            top = 2.0 * math.pi * found.final.regressors.signals.band_hz
            faint = faint or (top * time_s) ** 2 < TOLD_APART
            alike = [
                name
                for name, cls in found.final.regressors.catalogue.items()
                if faint and cls.groups & effect.groups and name not in (*same, *present)
            ]
            same += alike
        break
    if as_powers_of_place(found, effect):
        same += [name for name in splines_of_family(found, effect) if name not in same]
    return same


def splines_of_family(found: Found, effect: Effect) -> list[str]:
    """Return the effects that can draw any function of what an effect depends on."""
    return [
        name
        for name, cls in found.final.regressors.catalogue.items()
        if name != effect.name
        and cls.family() == effect.family()
        and any(form.is_spline for form in cls.trials(found.spans))
    ]


def as_powers_of_place(found: Found, effect: Effect) -> bool:
    """Return whether as many powers of the position do as well as a formula of it.

    Over a small part of a turn the sine of an angle is a parabola, and so is many a spring. A wave
    is asked how often it repeats instead.
    """
    waves = "wave_over_position" in effect.groups
    if "force_of_position" not in effect.groups or waves or effect.is_spline:
        return False
    rest = found.final.without(effect.name)
    powers = SmoothFunctions(rest.regressors.signals).powers_of_position(len(effect.parameters))
    left = float(held_out_sse(with_columns(rest.problem, powers)).sum())
    return left <= found.final.held_out * (1.0 + SAME)


def draws_any_form(other: Effect, effect: Effect) -> bool:
    """Return whether another effect is a spline of the same family: no rival of a formula."""
    return other.is_spline and not effect.is_spline and other.family() == effect.family()


def alternatives(found: Found, name: str, most: int = 4) -> tuple[Alternative, ...]:
    """Return what else was tried in an effect's place, and why it was not taken."""
    return (*_of_input(found, name), *_in_its_place(found, name, most))


def _of_input(found: Found, name: str) -> tuple[Alternative, ...]:
    """Return the effect of the input that beats another where both can be tried, if any does.

    With the command on the left none is: what it asks for would be explained by itself. There the
    next best stands without the rival that it has. Of what was taken first the round across tells,
    which knew of no other effect; of each the whole model, with that effect in its place.
    """
    if (instead := found.instead.get(name)) is not None:
        why = (
            "cannot be tried with the command on the left; with the acceleration there and the "
            f"other effects beside it, it leaves {instead.leaves:.2g} times the squared error "
            f"that {name} leaves"
        )
        return (Alternative(instead.name, why, float(min(instead.share, MOST_AHEAD))),)
    first = {s.taken.effect.name for s in found.steps if s.taken and not s.before.added}
    if found.across is None or name not in first:
        return ()
    before, forms = found.across.before, found.across.forms
    own = next((form for form in forms if form.effect.name == name), None)
    best = min(
        (form for form in forms if form.effect.kind == "input"),
        key=lambda form: form.held_out,
        default=None,
    )
    if own is None or best is None or CLEARLY_BEATEN * best.held_out >= own.held_out:
        return ()
    share = gain(before, best.held_out) / max(gain(before, own.held_out), 1e-9)
    why = (
        "cannot be tried with the command on the left; with the acceleration there it leaves "
        f"{100.0 * best.held_out / before.held_out:.2g} % of the squared error where {name} "
        f"leaves {100.0 * own.held_out / before.held_out:.2g} %"
    )
    return (Alternative(best.effect.name, why, float(min(share, MOST_AHEAD))),)


def _in_its_place(found: Found, name: str, most: int) -> tuple[Alternative, ...]:
    """Return what came behind an effect in the round in which it was taken."""
    for step in reversed(found.steps):
        if step.taken is None or step.taken.effect.name != name:
            continue
        best = max(gain(step.before, step.taken.held_out), 1e-9)
        rows: list[Alternative] = []
        for form in step.forms:
            if form.effect.name == name:
                continue
            share = gain(step.before, form.held_out) / best
            if share < 0.01 or len(rows) == most:
                continue
            left = form.held_out / step.before.held_out
            taken = step.taken.held_out / step.before.held_out
            why = (
                f"leaves {100 * left:.2g} % of the squared error where {name} leaves "
                f"{100 * taken:.2g} %"
            )
            if left < taken:
                why += ", but explains less beside the other effects that were found"
            rows.append(Alternative(form.effect.name, why, float(share)))
        return tuple(rows)
    return ()


def own_shares(found: Found, names: Sequence[str]) -> dict[str, float]:
    """Return the squared residual that comes back without each effect, over all explained."""
    whole = max(found.base.solution.sse - found.final.solution.sse, 1e-300)
    shares = {}
    for name in names:
        lost = found.final.without(name).solution.sse - found.final.solution.sse
        shares[name] = float(np.clip(lost / whole, 0.0, 1.0))
    return shares
