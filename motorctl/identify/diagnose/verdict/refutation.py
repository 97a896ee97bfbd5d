"""What physics and a simulation refute: effects that lower an error and still cannot be there.

An effect may fit the rows it was chosen on and be impossible: friction that gives energy, a
negative inertia, a model whose motion runs further from the recorded one than that of the declared
model. Such an effect is taken out, and it is told why.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.physics import beyond_physics
from motorctl.identify.diagnose.search.search import Found, rival_gains
from motorctl.identify.diagnose.verdict.simulated_position import (
    Missed,
    Rows,
    judge_by_simulation,
    simulated_position,
)
from motorctl.model import Effect

WORSE = 1.02
"""Simulated position over that of the declared model, from which a model is refuted. Larger lets
impossible models pass, smaller refutes by chance. Chosen by hand."""
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
    before = [(rows, simulated_position(found.base, rows)) for rows in asked if final.added]
    while final.added:
        worse = (_worse_when_simulated(missed, final, rows) for rows, missed in before)
        refuted = beyond_physics(final) or next(filter(None, worse), None)
        if refuted is None:
            break
        effect, why = refuted
        notes.append(why)
        final = final.without(effect.name).refreshed()
    if not notes:
        return found, ()
    return replace(found, final=final, rival_gains=rival_gains(final)), tuple(notes)


def _worse_when_simulated(
    before: Missed, final: Hypothesis, rows: Rows | None
) -> tuple[Effect, str] | None:
    """Find the effect without which the model's own motion is nearest to the recorded one.

    `before` is what the declared model misses on the same rows. Errors of the measurement change no
    motion and are not asked.
    """
    signals = final.regressors.signals
    suspects = [effect for effect in final.added if effect.kind != "measurement"]
    if not suspects:
        return None
    simulated = judge_by_simulation(signals, before, simulated_position(final, rows))
    rounding = CERTAIN * float(np.ptp(signals.stretches[0].x))
    if simulated is None or simulated.worse <= WORSE or simulated.after_rms < rounding:
        return None

    def left(effect: Effect) -> float:
        missed = simulated_position(final.without(effect.name).refreshed(), rows)
        rest = judge_by_simulation(signals, before, missed)
        return np.inf if rest is None else rest.worse

    effect = min(suspects, key=left)
    return effect, (
        f"{effect.name} is refuted: simulated over windows of {simulated.window_s:.3g} s, the "
        f"model with it would be {simulated.after_rms:.3g} from the recorded position, the "
        f"declared one {simulated.before_rms:.3g}; over all lengths of window the ratio is "
        f"{simulated.ratio:.3g}"
    )
