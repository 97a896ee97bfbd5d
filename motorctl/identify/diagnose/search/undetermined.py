"""Which declared effects a recording can carry: the others would fit nothing but noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.held_out_blocks import NOTHING, RIDGE, rests_of_folds
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import plain_model, whitened
from motorctl.model import Effect, EffectList, basic_effects

Array = NDArray[np.float64]

UNSURE = 0.02
"""Standard error of the input map at the largest command, in parts of the command, beyond which an
electromagnetic term is left out. Larger keeps terms that bend other estimates, smaller drops useful
ones. Chosen by hand."""
HIDDEN = 3.0
"""How far below that limit the standard error has to come beside the effects that were found, for a
term that was left out to be taken back. Larger leaves out what a missing effect hid, smaller takes
back what an effect of chance lets pass. Chosen by hand: a coupling that was found brings it 180
times below, a swing that was found in noise 1.2 times."""
ONE_WAY = 1e-4
"""How much of the direction's column is no constant, up to which the motion is one-way. Larger
drops an offset that a few reversals show, smaller keeps two parameters of which only the sum is
known. Chosen by hand."""
LEAST_SHARE = 0.01
"""Part of what the recording tells of a constant force beside friction that is left where a fold is
held out. Larger drops an offset that short recordings show, smaller lets a fold's blow up. Chosen
by hand: real axes that move both ways have 0.3 to 0.7, single moves of an arm 1e-5."""


def without_undetermined(
    signals: Signals, declared: EffectList
) -> tuple[EffectList, dict[str, str]]:
    """Return the declared list without what the recording cannot carry, and why that was dropped.

    The electromagnetic effects bend the input map: where the commands are too small to determine
    the bend, its parameters take whatever noise and missing effects make of them.
    """
    moved = {axis for s in signals.stretches for axis in s.others}
    alone = {
        effect.name: f"axis {', '.join(a for a in effect.other_axes if a not in moved)} did not "
        "move, or is not in this recording"
        for effect in declared.effects
        if not moved.issuperset(effect.other_axes)
    }
    if alone:
        declared = EffectList([e for e in declared.effects if e.name not in alone])
    declared, dropped = _with_bend(signals, declared)
    declared, mimicked = without_one_way_offset(signals, declared)
    return declared, alone | dropped | mimicked


def without_one_way_offset(
    signals: Signals, declared: EffectList
) -> tuple[EffectList, dict[str, str]]:
    """Return the list without a constant force where the motion is one-way, and why.

    Friction by direction is a constant force there. Also where all that tells them apart lies in
    one fold: fitted without it, the two may be as large as they like against each other, and every
    model is judged by what they make of it.

    Parameters
    ----------
    signals
        What is searched: the rows of a narrow band are fewer, and may have lost the other way.
    declared
        The effects that the model has.
    """
    names = [basic_effects()[signal].name for signal in ("direction", "one")]
    if not set(names) <= set(declared.names):
        return declared, {}
    hypothesis = plain_model(signals, declared)
    direction, constant = (hypothesis.names.index(name) for name in names)
    whole = hypothesis.problem.total
    lengths = float(np.sqrt(whole[direction, direction] * whole[constant, constant]))
    shares = [_known(rest, constant) for rest in rests_of_folds(hypothesis.problem)]
    if lengths <= 0.0:
        return declared, {}
    if 1.0 - abs(float(whole[direction, constant])) / lengths <= ONE_WAY:
        how = "the axis moves one way only"
    elif min(shares) < LEAST_SHARE * _known(whole, constant):
        how = "the axis moves one way only but for a part that is too short to hold another out"
    else:
        return declared, {}
    why = (
        f"{how}, which does not separate it from {names[0]}: that one holds the sum of both. A "
        "recording that moves both ways tells them apart"
    )
    return EffectList([e for e in declared.effects if e.name != names[1]]), {names[1]: why}


def _known(gram: Array, column: int) -> float:
    """Return one over the variance of a column's coefficient beside all others."""
    X = gram[:-1, :-1]
    lengths = np.sqrt(np.maximum(np.diag(X), NOTHING))
    inverse = np.linalg.inv(X / np.outer(lengths, lengths) + RIDGE * np.eye(len(X)))
    return float(lengths[column] ** 2 / inverse[column, column])


def with_determined(
    signals: Signals, kept: EffectList, declared: EffectList, added: Sequence[Effect]
) -> EffectList:
    """Return what was kept of the declared list with the bend that was dropped, where it shows now.

    What the model lacked hid it: beside the effects that were found the same commands may determine
    it, and what was declared is then no other effect of the input.

    Parameters
    ----------
    signals
        What was searched.
    kept
        What `without_undetermined` returned.
    declared
        What it was given.
    added
        The effects that were found.

    Returns
    -------
    EffectList
        `kept` itself where nothing came back: what was searched with it stands.
    """
    whole = EffectList([e for e in declared.effects if e.name in kept.names or e.electromagnetic])
    beside = tuple(effect for effect in added if effect.kind != "input")
    if not beside or len(whole.effects) == len(kept.effects):
        return kept
    restored, dropped = _with_bend(signals, whole, beside, UNSURE / HIDDEN)
    return kept if dropped else restored


def _with_bend(
    signals: Signals,
    declared: EffectList,
    added: tuple[Effect, ...] = (),
    unsure: float = UNSURE,
) -> tuple[EffectList, dict[str, str]]:
    """Drop the electromagnetic effects where the recording does not determine them."""
    curved = [effect.name for effect in declared.effects if effect.electromagnetic]
    if not curved:
        return declared, {}
    largest = signals.largest_command
    if signals.data.command_unit != "V":
        why = f"the command is in {signals.data.command_unit}, not the voltage that saturates"
        return declared.without_electromagnetic(), dict.fromkeys(curved, why)
    error = _bend_error_v(signals, declared, added)
    if error > unsure * largest:
        why = (
            f"commands of up to {largest:.3g} V do not determine the bend of the input map: its "
            f"standard error there would be {error:.2g} V, the limit is {unsure * largest:.2g} V"
        )
        return declared.without_electromagnetic(), dict.fromkeys(curved, why)
    return declared, {}


def _bend_error_v(signals: Signals, declared: EffectList, added: tuple[Effect, ...]) -> float:
    """Return the standard error of the input map at the largest command [V].

    That which noise alone would make: missing effects may be yet to be found.
    """
    regressors, noise = whitened(signals, declared, added)
    hypothesis = Hypothesis(regressors, added)
    starts = dict(zip(declared.names, _starts(declared), strict=True))
    largest = signals.largest_command
    variance = hypothesis.solution.covariance * regressors.signals.row_variance(noise)
    bend = np.zeros(len(hypothesis.names))
    for i, (effect, j) in enumerate(hypothesis.places, 1):
        if effect.electromagnetic:
            unit = np.zeros(len(declared))
            unit[starts[effect.name] + j] = 1.0
            bend[i] = declared.input_over(np.array([largest]), unit)[0][0] - largest
    return float(np.sqrt(bend @ variance @ bend)) / abs(float(hypothesis.b[0]))


def _starts(model: EffectList) -> list[int]:
    """Return the place in theta of each effect's first parameter."""
    counts = [len(effect.parameters) for effect in model.effects]
    return [sum(counts[:k]) for k in range(len(counts))]
