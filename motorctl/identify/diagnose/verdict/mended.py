"""Declared effects whose own form was a little wrong, and what mending them is worth."""

from __future__ import annotations

from dataclasses import replace

from motorctl.identify.diagnose.result import MendedTerm
from motorctl.identify.diagnose.search.declared_shape import turning_over
from motorctl.identify.diagnose.search.parameters import values_of
from motorctl.identify.diagnose.search.search import Found, declared_alone
from motorctl.identify.diagnose.verdict.errors import Split, held_out_rms
from motorctl.identify.diagnose.verdict.whole_physics import negative_damping
from motorctl.model import EffectList
from motorctl.model.option_units import option_unit
from motorctl.model.sign_function import sign_of

ALONE = 0.95
"""Held-out error with the mended form over that with the declared one, up to which the form alone
is said to matter. Larger credits forms with nothing, smaller hides what they are worth. Chosen by
hand."""


def with_better_base(found: Found, declared: EffectList) -> Found:
    """Return a search's outcome whose errors before are those of the better form of friction.

    A form that shows only beside missing effects may be worse without them than the declared one.
    """
    sign = sign_of(declared.effects)
    if sign is None or sign == sign_of(found.base.regressors.declared.effects):
        return found
    plain = turning_over(found.base, sign).refreshed()
    if plain.held_out >= found.base.held_out:
        return found
    better = replace(found, base=plain)
    return better if found.final.added else declared_alone(better)


def mended_terms(
    found: Found, declared: EffectList, split: Split, unit: str
) -> tuple[MendedTerm, ...]:
    """Return the effects of `declared` that the search took in another form."""
    final = found.final.regressors.declared.effects
    used = {effect.name: effect for effect in final}
    sign, taken = sign_of(declared.effects), sign_of(final)
    changed = [e for e in declared.effects if e.name in used and e.options != used[e.name].options]
    if not changed or sign is None or taken is None:
        return ()

    before = held_out_rms(found, turning_over(found.base, sign).problem, split)
    other = turning_over(found.base, taken)
    after = held_out_rms(found, other.problem, split)
    meaning = "this shows only beside the effects that are missing"
    if after < ALONE * before:
        data = found.base.regressors.signals.data
        drives = negative_damping(values_of(other.refreshed()), data)
        follows = (
            "no effect is missing for it"
            if drives is None
            else f"beside it {drives}, which no friction has: something else is missing, too"
        )
        meaning = (
            f"this alone takes the held-out error from {before:.3g} to {after:.3g} {unit} rms, and "
            + follows
        )
    terms = []
    for effect in changed:
        old, new = effect.options.model_dump(), used[effect.name].options.model_dump()
        different = [key for key in new if new[key] != old[key]]
        told = " and ".join(
            f"{key} {_told(key, new[key])} instead of {_told(key, old[key])}" for key in different
        )
        terms.append(
            MendedTerm(
                effect.name,
                {key: new[key] for key in different},
                {key: old[key] for key in different},
                f"the declared {effect.name} has {told}: {meaning}",
            )
        )
    return tuple(terms)


def _told(key: str, value: object) -> str:
    return f"{value:.4g} {option_unit(key)}" if isinstance(value, float) else str(value)
