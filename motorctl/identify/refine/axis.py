"""The model that an axis should have after a diagnosis, and what is to be said of it."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.freeze import decode
from motorctl.config.machine import MOST_PARAMETERS, Axis, Estimate, Machine
from motorctl.control import input_indices
from motorctl.errors import DataError
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis
from motorctl.identify.refine.admissible import admissible
from motorctl.identify.refine.carry_over import CarriedModel, carry_over
from motorctl.identify.refine.header import found_words
from motorctl.identify.refine.model_error import force_error_rms, made_up_for
from motorctl.identify.refine.model_text import WantedEffect
from motorctl.identify.refine.start_values import (
    estimates_of,
    sizes_of,
    with_rounded_options,
)
from motorctl.model import Effect, EffectList, known_effects
from motorctl.motion import Program

Array = NDArray[np.float64]

COMMENT_WIDTH = 90
"""Width of a comment in the written file [characters]. Only looks depend on it. Convention."""
IMPROVEMENT = 0.98
"""Error that new start values of a complete model leave, over that of the old ones, from which they
are written. Nearer to 1 rewrites a configuration for nothing that a machine shows, smaller keeps
values that a recording has bettered. Chosen by hand."""


@dataclass(frozen=True)
class AxisRefinement:
    """What becomes of one axis."""

    axis: str
    verdict: str
    changed: bool
    added: tuple[str, ...]
    """Names of the effects that the configuration did not have."""
    wanted: tuple[WantedEffect, ...]
    """The whole model as the configuration should have it; as it is where nothing changes."""
    done: tuple[str, ...]
    """What was done and why, in sentences."""
    old_delay_s: float
    """adaptation.input_delay_s where an effect that was found takes its place, else 0."""
    start_error_v: float
    """What the model leaves of this recording's command with the old start values, rms."""
    refined_error_v: float
    """The same with the new ones."""

    def estimates(self) -> dict[str, Estimate]:
        """Return every parameter's estimate by its full name."""
        return {
            part.effect.full_name(parameter): estimate
            for part in self.wanted
            for parameter, estimate in zip(part.effect.parameters, part.estimates, strict=True)
        }


def keep_axis(
    diagnosis: RecordingDiagnosis, machine: Machine, name: str, *why: str
) -> AxisRefinement:
    """Leave the model of an axis as it is, and say why."""
    found, current = diagnosis.axes[name], current_model(machine, name)
    error = _error_of(current, found)
    return AxisRefinement(name, found.verdict, False, (), current, why, 0.0, error, error)


def refine_axis(
    diagnosis: RecordingDiagnosis, machine: Machine, name: str, without: Collection[str] = ()
) -> AxisRefinement:
    """Decide on the model of one axis; effects in `without` are left out."""
    found, axis = diagnosis.axes[name], machine.axes[name]
    current = current_model(machine, name)
    before = _error_of(current, found)

    def unchanged(*done: str) -> AxisRefinement:
        return AxisRefinement(name, found.verdict, False, (), current, done, 0.0, before, before)

    if found.verdict == "insufficient_data" and not found.mended:
        return unchanged(f"unchanged, for this recording shows too little: {found.sentence}")
    crowded = _too_many(axis, found, without)
    signals = make_signals(found.data)
    carried = carry_over(found, spans_of(signals), {*without, *crowded})
    # rounded before bounds are made: the range of a parameter may depend on an option
    as_declared = {*axis.declared.names} - {term.name for term in found.mended}
    model = EffectList(
        [e if e.name in as_declared else with_rounded_options(e) for e in carried.model.effects]
    )
    new = [effect for effect in model.effects if effect.name not in axis.declared.names]
    nothing_new = not new and not carried.left_behind and not found.mended
    if nothing_new and found.verdict != "complete":
        return unchanged(f"unchanged: {found.sentence}")
    fitted = estimates_of(model, carried.theta, carried.std_error, sizes_of(model, signals))
    wanted = _wanted(axis, current, found, model, fitted)
    programs = [p for p in machine.programs.values() if name in p.axes]
    wanted, notes = _sound(axis, found, current, wanted, programs)
    if not new and [part.data() for part in wanted] == [part.data() for part in current]:
        return unchanged(*carried.notes, "unchanged: the configuration has these values already")
    after = _error_of(wanted, found)
    if not new and not carried.left_behind and not after < IMPROVEMENT * before:
        return unchanged(
            "unchanged: the model lacks no effect, and parameters fitted to this recording would "
            f"leave {after:.3g} V rms instead of {before:.3g}, less than "
            f"{100 * (1 - IMPROVEMENT):.0f} % better"
        )
    added = tuple(effect.name for effect in new)
    notes += [
        f"{spline} is left out: the model would have more than {MOST_PARAMETERS} parameters"
        for spline in crowded
    ]
    delay_s = axis.adaptation.input_delay_s if any(e.kind == "command" for e in new) else 0.0
    if delay_s:
        notes.append(
            "adaptation.input_delay_s is 0 now, because the effect that was found contains it"
        )
    done = (*_done(found, added, carried, before, after), *notes)
    return AxisRefinement(name, found.verdict, True, added, wanted, done, delay_s, before, after)


def _sound(
    axis: Axis,
    found: AxisDiagnosis,
    current: Sequence[WantedEffect],
    wanted: tuple[WantedEffect, ...],
    programs: Sequence[Program],
) -> tuple[tuple[WantedEffect, ...], list[str]]:
    """Return the model with an input map that the axis can run with, and what had to be changed."""
    model = EffectList([part.effect for part in wanted])
    declared = {part.effect.name: part.estimates for part in current}
    before = [
        e for part in wanted for e in declared.get(part.effect.name, [None] * len(part.estimates))
    ]
    names = [part.effect.name for part in wanted for _ in part.estimates]
    own = input_indices(model)
    free = [i for i, n in enumerate(names) if i not in own and n in found.model.names]

    def made_up(change: Array) -> Array:
        return made_up_for(found.data, model, change, free, found.declared.names)

    estimates = [e for part in wanted for e in part.estimates]
    sound, notes = admissible(axis, model, estimates, before, programs, made_up)
    return _with_estimates(wanted, sound), notes


def _too_many(axis: Axis, found: AxisDiagnosis, without: Collection[str]) -> list[str]:
    """Name the splines that leave no room for the rest of the model, what explains least first."""
    effects = {effect.name: effect for effect in (*axis.declared.effects, *found.model.effects)}
    counts = {name: len(e.parameters) for name, e in effects.items() if name not in without}
    scores = {effect.name: effect.score for effect in found.effects}
    new = [name for name in counts if name not in axis.declared.names and effects[name].is_spline]
    crowded: list[str] = []
    # of equals, what was found last goes first
    for name in sorted(new, key=lambda name: (scores.get(name, -1.0), -new.index(name))):
        if sum(counts.values()) <= MOST_PARAMETERS:
            break
        del counts[name]
        crowded.append(name)
    return crowded


def _done(
    found: AxisDiagnosis, added: tuple[str, ...], carried: CarriedModel, before: float, after: float
) -> Iterator[str]:
    yield from carried.notes
    yield from (term.sentence for term in found.mended)
    if added:
        yield f"added {', '.join(added)}; all parameters were fitted together"
        for effect in found.effects:
            if effect.name in added:
                yield found_words(effect)
        if found.unknown is not None and found.unknown.compensation is not None:
            yield found.unknown.sentence
    elif not carried.left_behind:
        yield (
            "the model lacks no effect; parameters fitted to this recording reduce its error from "
            f"{before:.3g} to {after:.3g} V rms"
        )
    for name, why in found.dropped.items():
        if name not in found.model.names:
            yield f"{name} starts at 0: {why}"


def current_model(machine: Machine, axis: str) -> tuple[WantedEffect, ...]:
    """Return the model of an axis as its configuration has it."""
    resolved: Mapping[str, Any] = decode(machine.resolved)["axes"][axis]["model"]
    return tuple(
        WantedEffect(effect, _estimates_in(effect, resolved[effect.name]), _type(resolved, effect))
        for effect in machine.axes[axis].declared.effects
    )


def _wanted(
    axis: Axis,
    current: tuple[WantedEffect, ...],
    found: AxisDiagnosis,
    model: EffectList,
    fitted: list[Estimate],
) -> tuple[WantedEffect, ...]:
    """Put the fitted values into the configuration's own order, and what is new behind."""
    known: dict[str, tuple[Effect, tuple[Estimate, ...]]] = {}
    first = 0
    for effect in model.effects:
        last = first + len(effect.parameters)
        known[effect.name] = effect, tuple(fitted[first:last])
        first = last
    told = {effect.name: effect for effect in found.effects}
    wanted = []
    for part in current:
        name = part.effect.name
        effect, estimates = known.pop(name, (part.effect, ()))
        if len(estimates) < len(effect.parameters):  # not fitted: as if it were not there
            estimates = tuple(_absent(e) for e in part.estimates)
        wanted.append(WantedEffect(effect, estimates, part.type))
    for name, (effect, estimates) in known.items():
        if name in told:
            above, errors = found_words(told[name]), told[name].option_errors
        elif found.unknown is not None and name not in found.declared.names:
            above, errors = found.unknown.sentence, {}
        else:
            above, errors = effect.title, {}
        lines = tuple(textwrap.wrap(above, COMMENT_WIDTH))
        where = type(effect)
        type_name = None if name in known_effects() else f"{where.__module__}:{where.__qualname__}"
        wanted.append(
            WantedEffect(with_rounded_options(effect), estimates, type_name, lines, errors)
        )
    return tuple(replace(part, position_unit=axis.units.position) for part in wanted)


def _with_estimates(
    wanted: tuple[WantedEffect, ...], estimates: list[Estimate]
) -> tuple[WantedEffect, ...]:
    left = iter(estimates)
    return tuple(
        replace(part, estimates=tuple(next(left) for _ in part.estimates)) for part in wanted
    )


def _absent(estimate: Estimate) -> Estimate:
    """Let a parameter start at zero, or as near to it as its bounds allow."""
    return replace(estimate, initial=min(max(0.0, estimate.lower), estimate.upper))


def _error_of(wanted: tuple[WantedEffect, ...], found: AxisDiagnosis) -> float:
    """Return the error of a model's start values on the recording; NaN where there is none."""
    model = EffectList([part.effect for part in wanted])
    theta = np.array([e.initial for part in wanted for e in part.estimates])
    try:
        return force_error_rms(found.data, model, theta, found.declared.names)
    except DataError:
        return float("nan")


def _estimates_in(effect: Effect, keys: Mapping[str, Any]) -> tuple[Estimate, ...]:
    parts = [
        keys["parameters"][parameter.name] if parameter.name else keys
        for parameter in effect.parameters
    ]
    return tuple(
        Estimate(p["initial"], p["bounds"][0], p["bounds"][1], p["covariance"]) for p in parts
    )


def _type(resolved: Mapping[str, Any], effect: Effect) -> str | None:
    name: str | None = resolved[effect.name].get("type")
    return name
