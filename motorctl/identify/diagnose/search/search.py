"""Forward, backward and sideways: which effects, together, explain a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.left_side import Side
from motorctl.identify.columns.pieces import shortened
from motorctl.identify.columns.signals import Signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.search.acceptance import (
    AS_WELL,
    LEAST_GAIN,
    acceptable,
    forces_of_position,
    gain,
    in_step,
)
from motorctl.identify.diagnose.search.forms import candidates
from motorctl.identify.diagnose.search.held_out_blocks import (
    Blocks,
    held_out_sse,
    make_blocks,
    with_columns,
)
from motorctl.identify.diagnose.search.hypothesis import (
    Catalogue,
    Hypothesis,
    Regressors,
)
from motorctl.identify.diagnose.search.measured_forms import Form, measure
from motorctl.identify.diagnose.search.mending import (
    mended,
    without_unneeded,
)
from motorctl.identify.diagnose.search.noise_twins import largest_gain
from motorctl.identify.diagnose.search.one_wave import one_wave
from motorctl.identify.diagnose.search.option_ranges import at_bound
from motorctl.identify.diagnose.search.parting import parted
from motorctl.identify.diagnose.search.physics import physical
from motorctl.identify.diagnose.search.ranking import ranked
from motorctl.identify.diagnose.search.settling import settled
from motorctl.identify.diagnose.search.simpler import freedom, instead_of
from motorctl.identify.diagnose.search.smooth_functions import VARIABLES, SmoothFunctions
from motorctl.identify.diagnose.search.whitening import (
    force_noise_density,
    saturated_residual,
    whitening_response,
)
from motorctl.model import Effect, EffectList, Spans
from motorctl.model.sign_function import Sign, sign_of, slope_of

Array = NDArray[np.float64]
Progress = Callable[[str], None]

COMMAND_BAND_HZ = 100.0
"""Band with the command on the left [Hz]: the acceleration's noise must not count there. Larger
lets it count, smaller hides fast effects. Chosen by hand."""
LONGEST_SEARCH_S = 30.0
"""Length of the recording that is searched [s]; the outcome is then fitted to all of it. Larger
takes time, smaller may miss rare events. Chosen by hand."""
BLOCK_S: dict[Side, float] = {"acceleration": 2.0, "command": 0.5}
"""Blocks that are held out in turn [s], by the left side. A real machine passes each place but a
few times, and in long blocks a whole pass would be held out; shorter ones are correlated with their
neighbours. Chosen by hand."""
SAME_DIGITS = 4
"""Digits of what is left in which a search that has the same effects again is where it was. More
miss circles whose options settle a little elsewhere, fewer end a search that still gains. Chosen by
hand."""
MOST_ROUNDS = 8
"""Effects that are added, at most. Larger takes time and names small ones, smaller leaves real
machines unexplained. Chosen by hand."""
PLAIN_GAIN = 600.0
"""Beyond this gain no noise twin of any machine has come: below, the machine's own twins are asked.
Larger takes time, smaller lets false names pass unasked. Chosen by hand on the simulated
campaign."""
TWINS_GAIN = 1.5
"""Multiples of the most that chance gains on the twins which a name needs. Larger misses weak
effects, smaller names chance. Chosen by hand on the simulated campaign."""
DOWN_TO_NOISE = 1.2
"""Squared residual over that of noise alone, below which the search ends. Larger misses weak
effects, smaller looks for names in noise. Chosen by hand."""
AS_GOOD: dict[Side, float] = {"acceleration": 0.8, "command": 0.4}
"""Part of the best form's gain from which another is taken where the best is not acceptable, by the
left side. Larger ends the search too early, smaller takes poor substitutes. Chosen by hand."""
NEARLY = 0.05
"""Part of what two effects take that one of them may leave and still stand for both, where one move
is repeated. Larger drops true second effects, smaller keeps shadows. Chosen by hand on the
simulated campaign."""
TRIES = 2
"""Times that a rival may lose after another effect was added before it is tried no more. More takes
time, fewer keeps a first wrong choice. Chosen by hand on the simulated campaign."""
RIVAL_SHARE = 0.3
"""Part of the gain of the effect taken from which another is its rival. Larger overlooks rivals,
smaller takes time. Chosen by hand."""


@dataclass(frozen=True)
class Step:
    """One round: what was tried, and what was taken."""

    forms: tuple[Form, ...]
    """Best first."""
    before: Hypothesis
    taken: Form | None
    ended: Form | None = None
    """What led and was passed over, for an option of it stands at an end of its range."""


@dataclass(frozen=True)
class InputInstead:
    """An effect of the input that does as well as a force, with the acceleration on the left."""

    name: str
    share: float
    """Its gain over that of the force."""
    leaves: float
    """Squared error on held-out rows over that with the force."""


@dataclass(frozen=True)
class Found:
    """The outcome of a search."""

    base: Hypothesis
    """The declared model alone, behind the last filter."""
    final: Hypothesis
    steps: tuple[Step, ...]
    spans: Spans
    force_noise: float
    rival_gains: dict[str, float] = field(default_factory=dict)
    """What smooth functions take away of the squared residual that the final model leaves."""
    refuted: tuple[str, ...] = ()
    """Why effects were refuted that an earlier search found."""
    refuted_left: float = 1.0
    """Part of the squared residual that refuted effects left of what is left without them."""
    across: Step | None = None
    """The first round with the acceleration on the left, of a search with the command there: it
    tried effects of the input, too."""
    instead: Mapping[str, InputInstead] = field(default_factory=dict)
    """What of the input does as well as a force that was found with the command on the left."""


def declared_alone(found: Found) -> Found:
    """Return a search's outcome with nothing added to the declared model."""
    return with_final(found, found.base)


def with_final(found: Found, final: Hypothesis) -> Found:
    """Return a search's outcome with another final model, and what is left beside that."""
    return replace(found, final=final, rival_gains=rival_gains(final))


def whitened(
    signals: Signals,
    declared: EffectList,
    added: tuple[Effect, ...],
    side: Side = "acceleration",
    catalogue: Catalogue | None = None,
) -> tuple[Regressors, float]:
    """Return regressors whose rows have nearly white noise, and the noise's density.

    With the command on the left nothing is whitened: it is for machines whose unexplained forces
    drown any noise of the measurement. The noise is that of pieces, where a recording is long.
    """
    plain = plain_model(signals, declared, added, side)
    pieces = plain.regressors.signals
    if any(effect.kind == "state" for effect in added):
        plain = plain.refreshed()
    noise = force_noise_density(pieces, saturated_residual(plain, SmoothFunctions(pieces)))
    blocks = _blocks(signals, side)
    if side == "command":
        return Regressors(signals.plain(COMMAND_BAND_HZ), declared, blocks, side, catalogue), noise
    white = signals.with_response(whitening_response(signals, noise))
    return Regressors(white, declared, blocks, side, catalogue), noise


def plain_model(
    signals: Signals,
    declared: EffectList,
    added: tuple[Effect, ...] = (),
    side: Side = "acceleration",
) -> Hypothesis:
    """Return a model on signals that are not whitened: on pieces, where a recording is long."""
    pieces = shortened(signals, LONGEST_SEARCH_S)
    return Hypothesis(Regressors(pieces, declared, _blocks(pieces, side)), added)


def on_pieces(hypothesis: Hypothesis) -> Hypothesis:
    """Return the hypothesis on pieces that stand for a long recording; itself where it is short."""
    old = hypothesis.regressors
    signals = shortened(old.signals, LONGEST_SEARCH_S)
    if signals is old.signals:
        return hypothesis
    blocks = _blocks(signals, old.side)
    regressors = Regressors(signals, old.declared, blocks, old.side, old.catalogue)
    return Hypothesis(regressors, hypothesis.added).refreshed()


def _blocks(signals: Signals, side: Side) -> Blocks:
    return make_blocks(signals.rows, signals.row_period_s, BLOCK_S[side])


def search(
    signals: Signals,
    declared: EffectList,
    sign: Sign | None,
    progress: Progress | None = None,
    side: Side = "acceleration",
    catalogue: Catalogue | None = None,
) -> Found:
    """Find the effects that the declared model lacks, one after the other.

    Parameters
    ----------
    signals
        The axis' motion and command.
    declared
        The effects that its model has.
    sign
        How its friction turns over at rest, None where none is declared.
    progress
        Called with what is being done.
    side
        What stands on the left of the regression.
    catalogue
        The effects that are tried, by name; every known one by default.

    Returns
    -------
    Found
        The declared model alone, the model with what was found, and each step between.
    """
    spans = spans_of(signals)
    tell = progress or (lambda _: None)
    added: tuple[Effect, ...] = ()
    steps: list[Step] = []
    regressors, noise = whitened(signals, declared, added, side, catalogue)
    hypothesis = Hypothesis(regressors).refreshed()
    rivals: dict[str, list[type[Effect]]] = {}
    been: dict[tuple[str, ...], Hypothesis] = {}
    for _ in range(MOST_ROUNDS):
        state = (f"{hypothesis.held_out:.{SAME_DIGITS}g}", *(effect.name for effect in added))
        if state in been:  # one gives way to the other, and has done so before
            circle = list(been.values())[list(been).index(state) :]
            if side == "command":  # the other left side is whitened anew each time
                hypothesis = min(circle, key=lambda h: h.held_out)
            break
        been[state] = hypothesis
        if added and hypothesis.solution.sse < DOWN_TO_NOISE * hypothesis.noise_sse(noise):
            break
        tell(f"effect {len(added) + 1}: trying what the model lacks")
        forms = ranked(hypothesis, candidates(hypothesis, spans), spans, sign)
        ended = _led_at_its_end(hypothesis, forms, spans)
        if side == "command":  # real machines have more than one thing without a name
            forms = [f for f in forms if not at_bound(f.effect, spans)] or forms
        best = gain(hypothesis, forms[0].held_out) if forms else 0.0
        least = LEAST_GAIN
        if LEAST_GAIN < best < PLAIN_GAIN:
            least = max(least, TWINS_GAIN * largest_gain(hypothesis, spans, sign))
        better = mended(hypothesis, forms, noise, spans, least)
        if better is not None:
            if better.taken is not None:
                steps.append(Step(better.tried, better.shape, better.taken))
            whole = without_unneeded(settled(better.whole, spans), spans)
            added, declared = whole.added, whole.regressors.declared
            sign = sign_of(declared.effects)
            signals = whole.regressors.signals
            regressors, noise = whitened(signals, declared, added, side, catalogue)
            hypothesis = settled(Hypothesis(regressors, added).refreshed(), spans)
            newest = "" if better.taken is None else better.taken.effect.name
            hypothesis = sideways(hypothesis, rivals, spans, sign, newest, steps)
            added = hypothesis.added
            continue
        near = [form for form in forms if gain(hypothesis, form.held_out) >= AS_GOOD[side] * best]
        fit = (f for f in near if acceptable(hypothesis, f, noise, spans, least))
        taken = next(filter(None, (physical_form(hypothesis, f) for f in fit)), None)
        steps.append(Step(tuple(forms), hypothesis, taken, ended))
        if taken is None:
            break
        added = (*added, taken.effect)
        best = gain(hypothesis, taken.held_out)
        near = [f for f in forms if gain(hypothesis, f.held_out) > RIVAL_SHARE * best]
        others = [type(f.effect) for f in near if f.effect.name != taken.effect.name]
        rivals[taken.effect.name] = others * TRIES
        if side == "acceleration":
            regressors, noise = whitened(signals, declared, added, side, catalogue)
        hypothesis = settled(Hypothesis(regressors, added).refreshed(), spans)
        hypothesis = sideways(hypothesis, rivals, spans, sign, taken.effect.name, steps)
        hypothesis = merged(hypothesis, spans, sign)
        joined = one_wave(hypothesis, spans)
        hypothesis = joined or hypothesis
        hypothesis = told_apart(hypothesis, spans, sign, steps)
        hypothesis = backward(hypothesis, noise, spans)
        before = {effect.name for effect in added if effect is not taken.effect}
        if joined is None and {effect.name for effect in hypothesis.added} == before:
            break  # what was just taken was dropped again, and would be for ever
        added = hypothesis.added
    base = Hypothesis(hypothesis.regressors).refreshed()
    return Found(base, hypothesis, tuple(steps), spans, noise, rival_gains(hypothesis))


def nothing_sought(signals: Signals, declared: EffectList) -> Found:
    """Fit the declared model alone, for a motion that tells no effects apart."""
    regressors, noise = whitened(signals, declared, ())
    base = Hypothesis(regressors).refreshed()
    return Found(base, base, (), spans_of(signals), noise, {})


def explained_share(found: Found) -> float:
    """Return the part of what is above the noise that the found effects take away."""
    floor = min(found.final.noise_sse(found.force_noise), found.final.held_out)
    above = max(found.base.held_out - floor, 1e-300)
    return (found.base.held_out - found.final.held_out) / above


def over_all(found: Found, signals: Signals, catalogue: Catalogue | None) -> Found:
    """Fit what was found in the pieces of a long recording to the whole of it."""
    if signals.rows == found.final.regressors.signals.rows:
        return found
    added, old = found.final.added, found.final.regressors
    signals = signals.turning_over(slope_of(old.declared.effects))
    regressors, noise = whitened(signals, old.declared, added, old.side, catalogue)
    final = Hypothesis(regressors, added).refreshed()
    base = Hypothesis(regressors).refreshed()
    return replace(found, base=base, final=final, force_noise=noise, rival_gains=rival_gains(final))


def _led_at_its_end(hypothesis: Hypothesis, forms: Sequence[Form], spans: Spans) -> Form | None:
    """Return the best form where it gains enough for a name and has come to an end of its range."""
    best = next(iter(forms), None)
    if best is None or gain(hypothesis, best.held_out) < LEAST_GAIN:
        return None
    return best if at_bound(best.effect, spans) else None


def sideways(
    hypothesis: Hypothesis,
    rivals: dict[str, list[type[Effect]]],
    spans: Spans,
    sign: Sign | None,
    newest: str,
    steps: list[Step],
) -> Hypothesis:
    """Exchange an added effect for one that came near where that now explains more.

    Not the newest, which has just won. Effects that lose twice are tried no more.
    """
    for effect in hypothesis.added:
        present = {e.name for e in hypothesis.added}
        classes = [cls for cls in rivals.get(effect.name, []) if cls.name not in present]
        if not classes or effect.name == newest:
            continue
        rest = hypothesis.without(effect.name)
        forms = ranked(rest, list(dict.fromkeys(classes)), spans, sign)
        # what moves in step with the move has no place to take from a force of position
        fit = (f for f in forms if not at_bound(f.effect, spans) and not in_step(rest, f.effect))
        forms = list(fit)
        old = Form(effect, hypothesis.solution.sse, hypothesis.held_out)
        better = bool(forms) and instead_of(rest, old, forms[0], spans)
        new = physical_form(rest, forms[0]) if better else None
        if new is not None:
            steps.append(Step((*forms, old), rest, new))
            hypothesis = settled(rest.plus(new.effect), spans)
            rivals[new.effect.name] = [type(effect), *classes]
        else:
            # each stands in the list as often as it may still be tried
            rivals[effect.name] = [cls for k, cls in enumerate(classes) if cls in classes[:k]]
    return hypothesis


def physical_form(hypothesis: Hypothesis, form: Form) -> Form | None:
    """Return a form that physics allows beside the hypothesis, or None."""
    name = form.effect.name
    fit = physical(hypothesis.plus(form.effect), name)
    if fit is None or fit.added[-1].held == form.effect.held:
        return None if fit is None else form
    return measure(hypothesis, fit.added[-1])


def merged(hypothesis: Hypothesis, spans: Spans, sign: Sign | None) -> Hypothesis:
    """Take a periodic force alone for one beside a spline over position, where it does as well.

    The spline may have come first and taken the periodic force's long waves.
    """
    forces = forces_of_position(hypothesis.added)
    waves = [effect for effect in forces if "wave_over_position" in effect.groups]
    others = [effect for effect in forces if effect not in waves]
    if not waves or not others or not all(effect.is_spline for effect in others):
        return hypothesis
    rest = hypothesis
    for effect in forces:
        rest = rest.without(effect.name)
    forms = ranked(rest, [type(waves[0])], spans, sign)
    enough = hypothesis.held_out * AS_WELL
    if hypothesis.regressors.signals.repeats_s:
        enough = max(enough, hypothesis.held_out + NEARLY * (rest.held_out - hypothesis.held_out))
    if not forms or forms[0].held_out > enough:
        return hypothesis
    if freedom(forms[0].effect, spans) > sum(freedom(effect, spans) for effect in forces):
        return hypothesis  # with orders enough a wave draws anything
    return settled(rest.plus(forms[0].effect), spans)


def told_apart(
    hypothesis: Hypothesis, spans: Spans, sign: Sign | None, steps: list[Step]
) -> Hypothesis:
    """Take a shorter wave and a slow force for a wave too long for the travel, where these do."""
    both = parted(hypothesis, spans, sign)
    if both is None:
        return hypothesis
    forms = ranked(both.before, candidates(both.before, spans), spans, sign)
    steps.append(Step(tuple(forms), both.before, both.slow))
    return settled(both.before.plus(both.slow.effect), spans)


def backward(hypothesis: Hypothesis, noise: float, spans: Spans) -> Hypothesis:
    """Drop added effects that the others have made superfluous."""
    for effect in hypothesis.added:
        if len(hypothesis.added) == 1:
            break
        rest = hypothesis.without(effect.name)
        form = Form(effect, hypothesis.solution.sse, hypothesis.held_out)
        if not acceptable(rest, form, noise, spans):
            hypothesis = rest
    return hypothesis


def rival_gains(hypothesis: Hypothesis) -> dict[str, float]:
    """Return what each smooth function takes away of the held-out squared residual.

    Of a long recording pieces are asked which part of theirs that is.
    """
    whole, hypothesis = hypothesis, on_pieces(hypothesis)
    scale = whole.held_out / max(hypothesis.held_out, 1e-300)
    rivals = SmoothFunctions(hypothesis.regressors.signals)
    gains = {}
    for name, variables in VARIABLES.items():
        if hypothesis.regressors.side == "command" and {"command", "history"} & set(variables):
            continue
        problem = with_columns(hypothesis.problem, rivals.columns(name), soft=True)
        gains[name] = scale * (hypothesis.held_out - float(held_out_sse(problem).sum()))
    return gains
