"""Resonances that tell the acceleration worse from the command than a rigid machine does.

With the command on the left the measured acceleration stands on the right, with its noise. What
takes the inertia away above a frequency takes that noise away too, and lowers the error there. Read
in the other direction, as an acceleration that follows from the command, a part on a spring still
tells it better than a rigid machine, and a mere filter of noise tells it worse.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.model import Effect

Array = NDArray[np.float64]

BELOW = 0.3
"""Part of a resonance's frequency from which on it is asked: below, both models are the same.
Larger leaves out the foot of broad resonances, smaller lets slow motion decide. Chosen by hand."""
WORSE = 1.2
"""Squared acceleration that a model with a resonance misses, over that which the rigid one does,
from which the resonance is refuted. Larger names filters of noise, smaller refutes springs of which
the command is noisy. Chosen by hand: on seven recorded machines that yield 0.09 to 1.02, on two
rigid legs behind a coarse encoder 1.36 to 1.47."""


def worse_in_other_direction(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a resonance that only filters the acceleration, and what to say; None where none is.

    Parameters
    ----------
    final
        The declared model and what was found.
    """
    if final.regressors.side != "command":
        return None
    for effect in final.added:
        if "resonance" not in effect.groups or effect.over_acceleration(np.ones(1)) is None:
            continue
        rest = final.without(effect.name).refreshed()
        above_hz = BELOW * min(effect.lines)
        rigid, with_it = (_missed(model, effect, above_hz) for model in (rest, final))
        if with_it > WORSE * rigid > 0.0:
            return effect, (
                f"{effect.name} is refuted: above {above_hz:.3g} Hz it meets the command better, "
                f"but the acceleration that follows from the command {with_it / rigid:.3g} times "
                f"as badly as a rigid machine does (limit {WORSE:g}): it smooths the noise of the "
                "acceleration. Record the position more finely"
            )
    return None


def _missed(model: Hypothesis, effect: Effect, above_hz: float) -> float:
    """Return the part of the squared acceleration above a frequency that the command misses."""
    signals = model.regressors.signals
    rows, b = model.problem.joined(signals.rows), model.solution.b
    own = [i for i, name in enumerate(model.names) if name == effect.name]
    forces = [i for i in range(1, len(b)) if i not in own]
    left = rows[-1] - b[forces] @ rows[forces]  # what is there to accelerate the machine
    hz = np.fft.rfftfreq(signals.rows, signals.row_period_s).astype(np.float64)
    inertia = np.full(len(hz), b[0], dtype=np.complex128)
    response = effect.over_acceleration(2.0 * math.pi * hz)
    if own and response is not None:
        inertia += float(b[own[0]]) * response
    asked = (hz > above_hz) & (hz < signals.band_hz) & (np.abs(inertia) > 0.0)
    acceleration = np.fft.rfft(rows[0])[asked]
    told = np.fft.rfft(left)[asked] / inertia[asked]
    power = float(np.vdot(told, told).real)
    if not power > 0.0:
        return 1.0
    scale = float(np.vdot(told, acceleration).real) / power
    missed = acceleration - scale * told
    return float(np.vdot(missed, missed).real / np.vdot(acceleration, acceleration).real)
