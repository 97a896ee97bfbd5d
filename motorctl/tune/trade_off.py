"""What error costs: the least predicted error at each phase margin, and at each noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.tune.candidates import MarginsWanted
from motorctl.tune.choice import Candidate

Array = NDArray[np.float64]

PHASE_STEP_DEG = 5.0
"""Between two points of the curve over the phase margin [degrees]; only looks depend on it."""
WIDEST_DEG = 80.0
"""Where that curve ends [degrees]; only the picture depends on it."""
NOISE_POINTS = 16
"""Points of the curve over the noise; only the picture depends on it."""


@dataclass(frozen=True)
class TradeOff:
    """Two curves; NaN where nothing was found."""

    phase_deg: Array
    """(n,) phase margins [degrees]."""
    at_phase_m: Array
    """(n,) least eF with at least that margin, the other limits kept [m]."""
    noise_v: Array
    """(m,) noise of the command [V rms]."""
    at_noise_m: Array
    """(m,) least eF with at most that noise, the margins kept [m]."""


def trade_off(tried: Sequence[Candidate], wanted: MarginsWanted, d_hat_max_v: float) -> TradeOff:
    """Return the curves of everything that was tried.

    Parameters
    ----------
    tried
        Stable gains with what they would do.
    wanted
        What is kept while one of the limits is varied.
    d_hat_max_v
        Bound of d0_hat [V], always kept.

    Returns
    -------
    TradeOff
        Least errors over the phase margin and over the noise.
    """
    rows = [
        (c.phase_deg, c.gain, c.prediction.command_noise_v, c.prediction.eF_m)
        for c in tried
        if c.prediction.d0_hat_v <= d_hat_max_v
    ]
    phase, gain, noise, error = np.array(rows).reshape(-1, 4).T
    margins = np.arange(0.0, WIDEST_DEG + 0.5 * PHASE_STEP_DEG, PHASE_STEP_DEG)
    most = wanted.command_noise_v or noise.max(initial=1e-3)
    quiet = (gain >= wanted.gain) & (noise <= most)
    firm = (gain >= wanted.gain) & (phase >= wanted.phase_deg)
    noises = np.geomspace(0.05 * most, 2.0 * most, NOISE_POINTS)
    return TradeOff(
        phase_deg=margins,
        at_phase_m=np.array([_least(error[quiet & (phase >= limit)]) for limit in margins]),
        noise_v=noises,
        at_noise_m=np.array([_least(error[firm & (noise <= limit)]) for limit in noises]),
    )


def _least(values: Array) -> float:
    return float(values.min()) if len(values) else math.nan
