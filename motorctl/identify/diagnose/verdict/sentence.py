"""The verdict in one sentence, and where a name is too poor for one."""

from __future__ import annotations

from collections.abc import Sequence

from motorctl.identify.diagnose.result import (
    FoundEffect,
    MissingMotion,
    ModelError,
    UnknownStructure,
)
from motorctl.identify.diagnose.search.hypothesis import Catalogue
from motorctl.identify.diagnose.verdict.confidence import FAMILY_TOLD, DoubtedMember

UNNAMED = 0.3
"""Confidence below which the most important name is no answer. Larger refuses more names, smaller
gives poor ones. Chosen by hand."""
ABOVE_NOISE = 1.3
"""Rms of what is left over that of noise alone, from which the sentence says so. Larger keeps
silent about structure, smaller speaks of chance. Chosen by hand: NOISE_LIKE = 1.7 in squares is 1.3
in rms."""


def is_poor(
    effects: Sequence[FoundEffect], missing: Sequence[MissingMotion], catalogue: Catalogue
) -> bool:
    """Return whether the most important name is too poor for an answer, and its family as well.

    Parameters
    ----------
    effects
        What was found, the most important first.
    missing
        The motions that would tell more.
    catalogue
        The effects that were tried, by name.
    """
    if not (effects and missing) or effects[0].confidence >= UNNAMED:
        return False
    first = effects[0]
    alike = {catalogue[name].family() for name in first.indistinguishable_from}
    return first.family_confidence < FAMILY_TOLD or alike != {first.effect.family()}


def sentence_of(
    within: str,
    verdict: str,
    effects: tuple[FoundEffect, ...],
    unknown: UnknownStructure | None,
    missing: tuple[MissingMotion, ...],
    error: ModelError,
    kin: DoubtedMember | None,
) -> str:
    """Return what was found in one sentence.

    Parameters
    ----------
    within
        How far a complete model is from the command, in words; empty where noise alone is left.
    verdict
        complete, effect, unknown_structure or insufficient_data.
    effects
        What is named, the most important first.
    unknown
        What the residual depends on, where no effect explains it.
    missing
        The motions that would tell more.
    error
        Of the declared model and of the one that was found.
    kin
        What takes most and is too unsure to be named, where there is such.
    """
    unit = error.unit
    change = (
        f"held-out error {error.held_out_before_rms:.3g} to {error.held_out_after_rms:.3g} {unit} "
        f"rms, noise {error.noise_floor_rms:.3g} {unit}"
    )
    if verdict == "complete":
        return (
            f"The declared model is complete{within}: its held-out error is "
            f"{error.held_out_before_rms:.3g} {unit} rms, and noise alone "
            f"would give {error.noise_floor_rms:.3g} {unit}."
        )
    names = " and ".join(effect.name for effect in effects)
    if verdict == "effect":
        over = error.held_out_after_rms / max(error.noise_floor_rms, 1e-300)
        left = f"; what is left is {over:.2g} times the noise" if over > ABOVE_NOISE else ""
        if effects[0].confidence < UNNAMED:  # its family is what is known
            kind = effects[0].effect.family().replace("_", " ")
            names = (
                f"something of a known kind, {kind} (confidence "
                f"{effects[0].family_confidence:.2f}; {missing[0].why})"
            )
        return f"The model lacks {names}: {change}{left}."
    if verdict == "unknown_structure":
        assert unknown is not None
        beside = f" Beside it, {names} was found." if effects else ""
        if unknown.family is not None and unknown.compensation is None:
            return f"The model lacks something of a known kind, {unknown.sentence}.{beside}"
        if kin is not None:
            return f"The model lacks something that cannot be named: {unknown.sentence}."
        return (
            f"The model lacks something that no known effect explains: {unknown.sentence}.{beside}"
        )
    if effects:
        return (
            f"The model lacks something ({change}), but this motion cannot tell what: "
            f"{missing[0].why if missing else names}."
        )
    only_noise = error.held_out_after_rms <= ABOVE_NOISE * error.noise_floor_rms
    left = "The residual is only noise" if only_noise else f"The residual names nothing ({change})"
    return f"{left}, but this motion could not have shown {', '.join(missing[0].effects)}."
