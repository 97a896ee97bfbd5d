"""From a search and its judgement to the diagnosis that people and scripts read."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.left_side import acceleration_form
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import low_pass_response
from motorctl.identify.diagnose.report.motion_advice import advise
from motorctl.identify.diagnose.result import (
    AxisDiagnosis,
    FoundEffect,
    MissingMotion,
    ModelError,
    Traces,
)
from motorctl.identify.diagnose.search.acceptance import LEAST_GAIN, forces_of_position, gain
from motorctl.identify.diagnose.search.held_out_blocks import BlockedRegression, residual, solve
from motorctl.identify.diagnose.search.option_ranges import ends_reached
from motorctl.identify.diagnose.search.parameters import (
    Compensation,
    FittedModel,
    column_index,
    option_errors,
    theta_of,
    values_of,
)
from motorctl.identify.diagnose.search.physics import is_physical
from motorctl.identify.diagnose.search.refutation import (
    led_at_its_end,
    without_refuted,
)
from motorctl.identify.diagnose.search.search import Found, declared_alone
from motorctl.identify.diagnose.search.whitening import spectrum
from motorctl.identify.diagnose.verdict.commanded_wave import without_commanded_waves
from motorctl.identify.diagnose.verdict.confidence import (
    Support,
    confidence,
    most_doubted,
    why_doubted,
    without_doubtful,
)
from motorctl.identify.diagnose.verdict.errors import (
    REPORT_HZ,
    Split,
    explained,
    held_out_rms,
    in_plain_band,
    model_error,
    own_shares,
    per_command,
    split_rows,
)
from motorctl.identify.diagnose.verdict.estimator import estimator_of
from motorctl.identify.diagnose.verdict.evidence import outside_family
from motorctl.identify.diagnose.verdict.gain_step import without_gain_step
from motorctl.identify.diagnose.verdict.instruments import with_instruments
from motorctl.identify.diagnose.verdict.mended import mended_terms, with_better_base
from motorctl.identify.diagnose.verdict.second_recording import error_on
from motorctl.identify.diagnose.verdict.sentence import is_poor, sentence_of
from motorctl.identify.diagnose.verdict.shown_without import without_shown
from motorctl.identify.diagnose.verdict.standing import standing
from motorctl.identify.diagnose.verdict.testable import UNEXPLAINED, ordinary, untestable
from motorctl.identify.diagnose.verdict.undetermined_model import over_command, why_undetermined
from motorctl.identify.diagnose.verdict.unknown import compensation, unknown_structure
from motorctl.identify.diagnose.verdict.verdict import Judged, low_hz
from motorctl.identify.diagnose.verdict.whole_physics import (
    whole_model,
    whole_told,
    without_impossible,
    wrong_sign_told,
)
from motorctl.identify.diagnose.verdict.yielding import without_rigid
from motorctl.model import Effect, EffectList
from motorctl.model.sign_function import sign_of

Array = NDArray[np.float64]

HELPS = 0.03
"""Part of the explainable held-out error that the named effects take away at least. Larger calls
helpful names unknown, smaller keeps useless ones. Chosen by hand."""


DRIVES_A_MOTOR = ("V", "A")
"""Units of a command that is a motor's voltage or current. Fewer add a note to motors, more leave
out what else may bend. Convention."""


def assemble(
    data: Measured,
    found: Found,
    declared: EffectList,
    dropped: Mapping[str, str],
    segments: dict[str, tuple[float, float]],
    test: Measured | None,
    began: float,
    too_plain: str | None = None,
) -> AxisDiagnosis:
    """Put the diagnosis of one axis together; `too_plain` is why the motion shows too little."""
    given, declared = declared, found.final.regressors.declared
    split = split_rows(found.final, segments)
    ended = led_at_its_end(found)
    found, refuted = without_refuted(found, split.held_out)
    found, shown = without_shown(found)
    found, rigid = without_rigid(found)
    found, commanded = without_commanded_waves(found)
    found, regained = without_gain_step(found)
    fitted = found.final.added
    found, doubted = without_doubtful(found)
    found = with_better_base(found, given)
    found, useless = _without_useless(found, split)
    found, unsure = without_impossible(found)
    stood = standing(found, split, too_plain is not None)
    found, judged, supports = stood.found, stood.judged, stood.supports
    refuted += (*unsure, *stood.refuted)
    doubted = {**doubted, **stood.doubted}
    extra, impossible = compensation(found, judged), None
    if extra is not None and not is_physical(found.final, extra):
        # where a place is passed at one acceleration, any function of it explains that
        extra, judged, impossible = None, replace(judged, rival=None), judged.rival
    if extra is not None and not _lowers(found, extra[1], found.final.problem, split):
        extra = None
    by_reference = None if extra is not None else with_instruments(found.final)
    values = values_of(by_reference or found.final, extra)
    problem = found.final.problem if extra is None else extra[1]
    own_error = error = model_error(found, split, problem, data.command_unit)
    tested: list[str] = []
    if test is not None:  # it is told, and decides nothing
        error, tested = error_on(test, found, own_error)
    effects = _effects(found, values, split, own_error, supports)
    sign = sign_of(declared.effects)
    catalogue = found.final.regressors.catalogue
    hidden = untestable(found, sign)
    missing = _missing(data, found, effects, hidden)
    doubted_most = most_doubted(fitted, {**doubted, **stood.unkept})
    drowned = why_undetermined(found, judged, own_error, doubted_most)
    if drowned:
        missing = (_missing_motion(ordinary(catalogue), drowned, data, found),)
    if too_plain:
        missing = (_missing_motion(ordinary(catalogue), too_plain, data, found),)
    verdict = judged.verdict
    if (verdict == "complete" and missing) or drowned:
        verdict = "insufficient_data"
    if verdict == "effect" and is_poor(effects, missing, catalogue):
        verdict = "insufficient_data"
    if verdict == "effect" and own_error.explained_fraction < HELPS:
        verdict = "insufficient_data"
        why = (
            "no effect that was tried lowers the error on held-out rows by "
            f"{100.0 * HELPS:.0f} % of what can be explained, though each explains a part of the "
            "rows it was fitted to"
        )
        missing = (_missing_motion([type(e.effect) for e in effects], why, data, found),)
    base = values_of(found.base)
    mended = mended_terms(found, given, split, data.command_unit)
    estimator = estimator_of(found.final, by_reference is not None)
    whole = whole_model(found, by_reference or found.final)
    kin = None if effects else doubted_most
    left = 100.0 * over_command(found, found.final.held_out)
    within = f" to within {left:.1f} % of the command" if judged.faint or judged.as_twin else ""
    unknown = None
    if verdict == "unknown_structure":
        unknown = unknown_structure(judged, found, extra, values, kin, impossible)
    diagnosis = AxisDiagnosis(
        data=data,
        declared=declared,
        dropped=dropped,
        verdict=verdict,
        sentence=(
            f"This motion cannot tell what the model lacks: {too_plain or drowned}."
            if too_plain or drowned
            else sentence_of(within, verdict, effects, unknown, missing, error, kin)
        ),
        declared_theta=base.theta,
        declared_std_error=base.std_error,
        effects=() if verdict == "insufficient_data" else effects,
        unknown=unknown,
        missing=missing,
        model=values.model,
        theta=values.theta,
        std_error=values.std_error,
        error=error,
        doubted={name: grounds.document() for name, grounds in doubted.items()},
        traces=_traces(found, values, extra, split, error),
        mended=mended,
        estimator=estimator,
        whole=whole,
        notes=(
            *(term.sentence for term in mended),
            *found.refuted,
            *refuted,
            *ended,
            *shown,
            *rigid,
            *commanded,
            *regained,
            *useless,
            *(why_doubted(name, grounds) for name, grounds in doubted.items()),
            *tested,
            *_notes(found, judged, split, effects),
            *whole_told(whole, effects),
            *(() if effects or verdict == "complete" else wrong_sign_told(base, data)),
            estimator.sentence,
        ),
    )
    return replace(diagnosis, seconds=time.monotonic() - began)


def _lowers(found: Found, new: BlockedRegression, old: BlockedRegression, split: Split) -> bool:
    """Return whether columns lower the error of rows that they were not fitted to."""
    return held_out_rms(found, new, split) < held_out_rms(found, old, split)


def _without_useless(found: Found, split: Split) -> tuple[Found, tuple[str, ...]]:
    """Take every name back where all together do not lower the held-out error."""
    final = found.final
    if not final.added or _lowers(found, final.problem, found.base.problem, split):
        return found, ()
    names = " and ".join(effect.name for effect in final.added)
    why = f"{names}: the error on held-out rows is no smaller with it than without"
    return declared_alone(found), (why,)


def _effects(
    found: Found,
    values: FittedModel,
    split: Split,
    error: ModelError,
    supports: Mapping[str, Support],
) -> tuple[FoundEffect, ...]:
    """Tell each effect's part, on rows of the recording that was fitted, as `error` is."""
    shares = own_shares(found, [e.name for e in found.final.added])
    effects = []
    for added in found.final.added:
        effect = next(e for e in values.model.effects if e.name == added.name)
        theta, std_error = theta_of(values, effect)
        rest = found.final.without(added.name)
        score = gain(rest, found.final.held_out)
        support = supports[added.name]
        strangers = outside_family(found, effect, list(support.twins))
        without = held_out_rms(found, rest.problem, split)
        own = explained(without, error.held_out_after_rms, error.noise_floor_rms)
        effects.append(
            FoundEffect(
                effect=effect,
                theta=theta,
                std_error=std_error,
                option_errors=option_errors(found.final, added, found.spans),
                confidence=support.sure,
                family_confidence=max(
                    support.sure, confidence(support.grounds, len(strangers), of_family=True)
                ),
                grounds=support.grounds.document(),
                explained_fraction=shares[added.name] if len(found.final.added) > 1 else own,
                score=score,
                evidence=tuple(_evidence(found, added, score, without, error)),
                indistinguishable_from=support.twins,
                alternatives=support.others,
            )
        )
    return tuple(sorted(effects, key=lambda e: -shares[e.name]))


def _evidence(
    found: Found, effect: Effect, score: float, without: float, error: ModelError
) -> list[str]:
    unit = error.unit
    lines = [
        f"without it the held-out error is {without:.3g} {unit} rms, with it "
        f"{error.held_out_after_rms:.3g} {unit}; the noise is {error.noise_floor_rms:.3g} {unit}",
        f"held-out log-likelihood rises by {score:.0f}; at least {LEAST_GAIN:.0f} is required",
    ]
    blocks = found.final.regressors.blocks.count
    lines.append(f"fitted and tested on {blocks} blocks in turn; {effect.identified}")
    data = found.final.regressors.signals.data
    lines += [
        f"{reached.told(data)}: the recording tells no more of it"
        for reached in ends_reached(effect, found.spans)
        if not reached.refutes
    ]
    return lines


def _missing(
    data: Measured,
    found: Found,
    effects: tuple[FoundEffect, ...],
    hidden: Mapping[str, float],
) -> tuple[MissingMotion, ...]:
    missing = []
    if hidden:
        catalogue = found.final.regressors.catalogue
        why = (
            f"this motion does not separate {', '.join(hidden)} from the declared effects, which "
            f"reproduce more than {100.0 * (1.0 - UNEXPLAINED):.0f} % of what they would add"
        )
        missing.append(_missing_motion([catalogue[name] for name in hidden], why, data, found))
    for effect in effects:
        if effect.indistinguishable_from:
            alike = effect.indistinguishable_from
            why = f"{effect.name} and {', '.join(alike)} explain this recording equally well"
            classes = [found.final.regressors.catalogue[name] for name in alike]
            missing.append(_missing_motion([type(effect.effect), *classes], why, data, found))
    return tuple(missing)


def _missing_motion(
    classes: Sequence[type[Effect]], why: str, data: Measured, found: Found
) -> MissingMotion:
    """Return the motion that would show some effects."""
    return MissingMotion(
        effects=tuple(cls.name for cls in classes),
        why=why,
        motion="; ".join(f"{cls.name}: {cls.visible_in}" for cls in classes),
        program=dict(advise(classes, data, found.spans)) or None,
    )


def _notes(
    found: Found, judged: Judged, split: Split, effects: tuple[FoundEffect, ...]
) -> list[str]:
    notes = []
    if not split.stated:
        notes.append("every third block of rows was held out of the fit to measure the errors")
    if judged.faint:
        notes.append(
            "what is left is more than the measurement's noise; it depends on nothing that was "
            "measured, and counts as the machine's own noise"
        )
    if judged.as_twin:
        notes.append(
            "the residual is more than white noise, but a simulated machine of this model, with "
            "the same motion and the same encoder, leaves as much: it is put down to the "
            "measurement"
        )
    if judged.verdict == "effect" and judged.coloured > 3.0:
        notes.append(
            f"below {low_hz(found):.3g} Hz the residual still has {judged.coloured:.1f} times the "
            "power of the noise"
        )
    for each in effects:
        if each.effect.remark:
            notes.append(f"{each.effect.name}: {each.effect.remark}")
    for name, rival in found.instead.items():
        notes.append(
            f"with the acceleration in the place of the command, {rival.name} leaves "
            f"{rival.leaves:.2g} times the squared error that {name} leaves there: the recording "
            f"may show {rival.name}"
        )
    unit = found.final.regressors.signals.data.command_unit
    curved = [each.effect.name for each in effects if each.effect.electromagnetic]
    if curved and unit not in DRIVES_A_MOTOR:
        notes.append(
            f"{' and '.join(curved)}: a command in {unit} need not drive a motor; a propeller, a "
            "pump or a valve bends its force over the command as magnetic saturation does"
        )
    forces = forces_of_position(effect.effect for effect in effects)
    if len(forces) > 1:
        names = " and ".join(effect.name for effect in forces)
        notes.append(
            f"{names} are both forces of position: this recording cannot tell a wave that does not "
            "repeat exactly from a force that does not repeat, so either may be a part of the other"
        )
    return notes


def _traces(
    found: Found,
    values: FittedModel,
    extra: Compensation | None,
    split: Split,
    error: ModelError,
) -> Traces:
    signals = found.final.regressors.signals.plain(REPORT_HZ)
    rows = signals.rows
    added = None if extra is None else extra[0]
    coefficients = solve(found.final.problem if extra is None else extra[1]).b
    b = acceleration_form(coefficients, found.final.regressors.side)
    # what a command gives is positive in the command's own residual, negative in acceleration's
    unit_left = per_command(found)
    if found.final.regressors.side == "acceleration":
        unit_left = -unit_left
    r_before = residual(in_plain_band(found.base), found.base.solution.b)[:rows] / unit_left
    r_after = residual(in_plain_band(found.final, added), coefficients)[:rows] / unit_left
    problem = in_plain_band(found.final, added, "acceleration")
    every = problem.joined(rows)
    columns, left = every[:-1], every[-1]
    contributions: dict[str, Array] = {}
    # u = (a - sum b_i psi_i) / b_u: what an effect adds to the command
    names = list(found.final.names) + ([extra[0].name] * len(extra[0].parameters) if extra else [])
    for effect in found.final.added:
        index = [i for i, name in enumerate(names) if name == effect.name]
        if effect.kind == "measurement":
            contributions[effect.name] = (b[index] @ columns[index]) / b[0]
        elif index:
            contributions[effect.name] = -(b[index] @ columns[index]) / b[0]
        else:
            rest = in_plain_band(found.final.without(effect.name), None, "acceleration")
            other = rest.columns[:, 0].ravel()[:rows]
            contributions[effect.name] = other - columns[0]
    if extra is not None:
        index = [i for i, name in enumerate(names) if name == extra[0].name]
        contributions[extra[0].name] = -(b[index] @ columns[index]) / b[0]
    acted = np.zeros(rows)
    for effect in found.final.added:
        if effect.kind == "command":  # the command as it was given, not as it acts
            acted = acted + contributions[effect.name]
    declared = found.final.regressors.declared.effects
    friction = column_index(found.final, [e.name for e in declared if "friction" in e.groups])
    frequency, spectrum_before = spectrum(r_before, signals.row_period_s)
    _, spectrum_after = spectrum(r_after, signals.row_period_s)
    density = found.force_noise + (2.0 * np.pi * frequency) ** 4 * signals.position_noise
    noise = density * low_pass_response(signals.band_hz)(frequency) ** 2 / b[0] ** 2
    return Traces(
        time_s=signals.time_s,
        position=signals.picked(lambda s: s.x),
        velocity=signals.picked(lambda s: s.v),
        acceleration=left,
        command=columns[0] + acted,
        residual_before=r_before,
        residual_after=r_after,
        contributions=contributions,
        friction=-(b[friction] @ columns[friction]) / b[0] if friction else np.zeros(rows),
        held_out=split.held_out,
        band_hz=signals.band_hz,
        noise_floor_rms=error.noise_floor_rms,
        frequency_hz=frequency,
        spectrum_before=spectrum_before,
        spectrum_after=spectrum_after,
        spectrum_noise=noise,
    )
