"""What of a fitted model belongs into a configuration that starts anew at every start."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import UsageError
from motorctl.identify.diagnose.result import AxisDiagnosis
from motorctl.model import CarriedOver, Effect, EffectList, Spans, basic_effects

Array = NDArray[np.float64]

DECLARED_EVENT = (
    "{} stands in the configuration and happens again after every start of the daemon, at the same "
    "time: take it out, if it was found in a recording, and refine from one made since"
)


@dataclass(frozen=True)
class CarriedModel:
    """A model as a configuration can have it; n parameters."""

    model: EffectList
    theta: Array
    """(n,) in units of the command."""
    std_error: Array
    """(n,)"""
    left_behind: tuple[str, ...]
    """Names of effects of which only what they left behind is kept."""
    notes: tuple[str, ...]
    """What the reader of the configuration has to know of these."""


def carry_over(found: AxisDiagnosis, spans: Spans, without: Collection[str] = ()) -> CarriedModel:
    """Return the diagnosed model as a configuration can have it.

    What happened at a time of the recording, such as a change of load, is no effect of a
    configuration: each effect that was found says what it left behind (`Effect.carry_over`).
    Declared effects stay, for the configuration's author wanted them.

    Parameters
    ----------
    found
        The diagnosis of the axis.
    spans
        What its recording spans.
    without
        Names of found effects that are left out altogether; declared ones stay.
    """
    declared = set(found.declared.names)
    left_out = set(without) - declared
    effects: list[Effect] = []
    rows: list[int] = []
    said: list[tuple[str, CarriedOver]] = []
    start = 0
    for effect in found.model.effects:
        own = list(range(start, start + len(effect.parameters)))
        start += len(own)
        if effect.name in left_out:
            continue
        carried = effect.carry_over([float(found.theta[i]) for i in own], spans)
        if effect.name in declared:
            if not carried.kept:
                said.append((effect.name, CarriedOver(note=DECLARED_EVENT.format(effect.name))))
        else:
            said.append((effect.name, carried))
            if not carried.kept:
                continue
        effects.append(effect)
        rows += own
    model = EffectList(effects)
    theta, std_error = found.theta[rows], found.std_error[rows]
    for name, carried in said:
        for signal, value in carried.adds.items():
            place = model.index_of(signal)
            if place is None:
                basic = basic_effects()[signal].name
                raise UsageError(f"{name} is carried over into {basic}, which the model has not")
            theta[place] += value
    scale = float(np.prod([carried.scale for _, carried in said]))
    return CarriedModel(
        model,
        scale * theta,
        abs(scale) * std_error,
        tuple(name for name, carried in said if not carried.kept),
        tuple(carried.note for _, carried in said if carried.note),
    )
