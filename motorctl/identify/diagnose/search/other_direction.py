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
ComplexArray = NDArray[np.complex128]

BELOW = 0.3
"""Part of a resonance's frequency from which on it is asked: below, both models are the same.
Larger leaves out the foot of broad resonances, smaller lets slow motion decide. Chosen by hand."""
SOFT = 0.5
"""Part of the inertia below which a model with a resonance is not asked: where a part on its spring
moves the machine nearly by itself, any error of the command is large beside what is left for it.
Larger leaves little to ask, smaller refutes springs of little damping. Chosen by hand on simulated
machines of another author."""
WORSE = 1.0
"""Squared acceleration that a model with a resonance misses, over that which the rigid one does,
from which the resonance is refuted. Larger names filters of noise, smaller refutes springs of which
the command is noisy. Chosen by hand: recorded machines that yield have 0.03 to 0.43, simulated ones
with a noisy command up to 0.8, two rigid legs behind a coarse encoder 1.6 to 2.2."""
NOISY = 0.03
"""Part that the encoder's noise has in the squared acceleration that a rigid machine misses, below
which there is no noise that a resonance could filter: forces that nothing explains, which a loop
answers, make any model miss more than they are. Larger names filters of noise, smaller refutes
springs of machines that are shaken. Chosen by hand: two rigid legs have 0.07 and 0.09, simulated
springs of another author that were refuted had 0.014 at most."""


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
        signals = final.regressors.signals
        hz = np.fft.rfftfreq(signals.rows, signals.row_period_s).astype(np.float64)
        inertia = _inertia(final, effect, hz)
        stiff = np.abs(inertia) >= SOFT * abs(float(final.solution.b[0]))
        asked = stiff & (hz > above_hz) & (hz < signals.band_hz)
        with_it = _missed(final, effect, inertia, asked)
        rigid = _missed(rest, effect, _inertia(rest, effect, hz), asked)
        if with_it > WORSE * rigid > 0.0 and _noise(rest, hz, asked) > NOISY * rigid:
            return effect, (
                f"{effect.name} is refuted: above {above_hz:.3g} Hz it meets the command better, "
                "but the acceleration that follows from the command leaves "
                f"{with_it / rigid:.3g} times the square that a rigid machine leaves (limit "
                f"{WORSE:g}): it may smooth the noise of the acceleration. A finer record of the "
                "position would tell"
            )
    return None


def _inertia(model: Hypothesis, effect: Effect, hz: Array) -> ComplexArray:
    """Return what the command has to move at frequencies [Hz], with an effect or without."""
    b = model.solution.b
    own = [i for i, name in enumerate(model.names) if name == effect.name]
    inertia = np.full(len(hz), b[0], dtype=np.complex128)
    response = effect.over_acceleration(2.0 * math.pi * hz)
    if own and response is not None:
        inertia += float(b[own[0]]) * response
    return inertia


def _noise(model: Hypothesis, hz: Array, asked: NDArray[np.bool_]) -> float:
    """Return the part of the squared acceleration that is the encoder's noise."""
    signals, rows = model.regressors.signals, model.problem.joined(model.regressors.signals.rows)
    acceleration = np.abs(np.fft.rfft(rows[0])[asked]) ** 2
    density = (2.0 * math.pi * hz[asked]) ** 4 * signals.position_noise
    # one-sided density of a record: 2 |FFT|^2 / (rows * rate)
    scale = 2.0 * signals.row_period_s / signals.rows
    return float(density.sum() / (scale * acceleration.sum()))


def _missed(
    model: Hypothesis, effect: Effect, inertia: ComplexArray, asked: NDArray[np.bool_]
) -> float:
    """Return the part of the squared acceleration that the command misses at some frequencies."""
    rows, b = model.problem.joined(model.regressors.signals.rows), model.solution.b
    own = [i for i, name in enumerate(model.names) if name == effect.name]
    forces = [i for i in range(1, len(b)) if i not in own]
    left = rows[-1] - b[forces] @ rows[forces]  # what is there to accelerate the machine
    acceleration = np.fft.rfft(rows[0])[asked]
    told = np.fft.rfft(left)[asked] / inertia[asked]
    power = float(np.vdot(told, told).real)
    if not power > 0.0:
        return 1.0
    scale = float(np.vdot(told, acceleration).real) / power
    missed = acceleration - scale * told
    return float(np.vdot(missed, missed).real / np.vdot(acceleration, acceleration).real)
