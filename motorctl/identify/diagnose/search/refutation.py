"""What physics and a simulation refute: effects that lower an error and still cannot be there.

An effect may fit the rows it was chosen on and be impossible: friction that gives energy, a
negative inertia, a model whose motion runs further from the recorded one than that of the declared
model. Such an effect is taken out, and it is told why.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.physics import beyond_physics, physical
from motorctl.identify.diagnose.search.search import Found, rival_gains
from motorctl.identify.diagnose.search.simulated_position import (
    Missed,
    Rows,
    coasting,
    judge_by_simulation,
    position_of_declared,
    simulated_position,
)
from motorctl.model import Effect

WORSE = 1.02
"""Simulated position over that of the declared model, from which a model is refuted. Larger lets
impossible models pass, smaller refutes by chance. Chosen by hand."""
WORSE_THAN_COASTING = 3.0
"""The same over going on at the measured velocity, where the declared model's inertia is negative
and it cannot be simulated. Larger lets an inertia shrink that the motion does not show, smaller
refutes weights of joints whose motor does much else than to move them. Chosen by hand on real
joints: 1.3 to 1.8 with gravity, 3.2 with a payload that is not there."""
CERTAIN = 1e-9
"""Relative size below which a simulation that is worse means nothing: rounding. Convention."""


def without_refuted(found: Found, held_out: Rows | None = None) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without effects that are refuted, and for each of them why.

    Simulated positions are compared over all rows and, where they are told, over those held out,
    (m,): a model must be further from the recording on neither.
    """
    notes: list[str] = []
    final = found.final
    asked = (None,) if held_out is None else (None, held_out)
    others = [(rows, _other(found.base, rows)) for rows in asked if final.added]
    while final.added:
        forbidden = beyond_physics(final)
        allowed = forbidden and physical(final, forbidden[0].name)
        if allowed:
            final = allowed.refreshed()
            continue
        worse = (_worse_when_simulated(other, final, rows) for rows, other in others)
        refuted = forbidden or next(filter(None, worse), None)
        if refuted is None:
            break
        effect, why = refuted
        notes.append(why)
        final = final.without(effect.name).refreshed()
    if final is found.final:
        return found, ()
    return replace(found, final=final, rival_gains=rival_gains(final)), tuple(notes)


@dataclass(frozen=True)
class _Other:
    """What a model's own motion must come as near as."""

    name: str
    missed: Missed
    most: float
    """How many times as much the model may miss."""


def _other(base: Hypothesis, rows: Rows | None) -> _Other:
    """Return the declared model, or coasting where that cannot be simulated."""
    missed = position_of_declared(base, rows)
    if missed:
        return _Other("the declared one", missed, WORSE)
    return _Other("coasting", coasting(base.regressors.signals, rows), WORSE_THAN_COASTING)


def _worse_when_simulated(
    other: _Other, final: Hypothesis, rows: Rows | None
) -> tuple[Effect, str] | None:
    """Find the effect that takes a model's own motion too far from the recorded one.

    Errors of the measurement change no motion and are not asked.
    """
    signals = final.regressors.signals
    suspects = [effect for effect in final.added if effect.kind != "measurement"]
    if not suspects:
        return None
    simulated = judge_by_simulation(signals, other.missed, simulated_position(final, rows))
    rounding = CERTAIN * float(np.ptp(signals.stretches[0].x))
    if simulated is None or simulated.worse <= other.most or simulated.after_rms < rounding:
        return None

    rest = {effect.name: final.without(effect.name).refreshed() for effect in suspects}

    def left(effect: Effect) -> float:
        missed = simulated_position(rest[effect.name], rows)
        again = judge_by_simulation(signals, other.missed, missed)
        return np.inf if again is None else again.worse

    # the least of those that may be to blame alone, or the one that is to blame most
    alone = [effect for effect in suspects if left(effect) <= other.most]
    effect = min(alone, key=lambda e: rest[e.name].held_out, default=min(suspects, key=left))
    return effect, (
        f"{effect.name} is refuted: simulated over windows of {simulated.window_s:.3g} s, the "
        f"model with it would be {simulated.after_rms:.3g} from the recorded position, "
        f"{other.name} {simulated.before_rms:.3g}; over all lengths of window the ratio is "
        f"{simulated.ratio:.3g}"
    )
