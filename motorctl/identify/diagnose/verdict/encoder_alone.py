"""What an encoder's rounding and noise leave by themselves, at the speeds of this motion.

Rounding is no white noise: at a steady speed v its error repeats v/count times a second, and a
harmonic of that, folded back by the sampling, may stand as a line within the band. A smooth
function of what was before explains such a line well, and nothing of the machine is in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from motorctl.identify.columns.stretches import smoothed
from motorctl.identify.diagnose.search.search import Found
from motorctl.identify.diagnose.verdict.clean_twin import SEED, as_measured

SMOOTHER = 4.0
"""How far below the band the motion is smoothed before it is rounded anew [1]. Smaller keeps the
rounding itself in the motion, and so leaves too little; much larger bends the motion where it
accelerates, which only moves the rounding's phase. Chosen by hand: 4 to 30 give the same within a
tenth on machines of this kind."""


def encoder_alone(found: Found) -> float:
    """Return the squared residual that the encoder would leave on a machine that lacks nothing.

    Parameters
    ----------
    found
        The outcome of a search.

    Returns
    -------
    float
        Sum over its rows, in the units of its final model's left side: what
        ``found.final.held_out`` is compared with.
    """
    final = found.final
    signals = final.regressors.signals
    draw = np.random.default_rng(SEED)
    errors = []
    for stretch in signals.stretches:
        motion = smoothed(stretch.position, signals.band_hz / SMOOTHER, signals.period_s)
        errors.append(replace(stretch, position=as_measured(motion, signals, draw) - motion))
    rows = signals.with_stretches(tuple(errors)).acceleration()
    per_left = 1.0 if final.regressors.side == "acceleration" else 1.0 / abs(float(final.b[0]))
    return float(np.sum(rows**2)) * per_left**2
