"""By what method the parameters were found, and how errors in the regressors were met."""

from __future__ import annotations

from typing import Literal

import numpy as np

from motorctl.identify.diagnose.result import Estimator
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.whole_model import FAR_OFF, OF_INERTIA, TINY, inertia_of

HARDLY_SEEN = 0.05
"""Part of the acceleration that the command tells beside the model, up to which no range is told.
Larger leaves ranges untold, smaller tells of ones that say nothing. Chosen by hand: twentyfold."""


def estimator_of(model: Hypothesis, instruments: bool = False) -> Estimator:
    """Return how a model's parameters were found; `instruments`: with those of the reference."""
    signals = model.regressors.signals
    if model.regressors.side == "acceleration":
        told = (
            "least squares of the acceleration, which carries the noise of the measured position; "
            "rows are whitened by that noise's spectrum, and the recorded command counts as free "
            "of error"
        )
    elif instruments:
        told = (
            "instruments formed from the reference (two-stage least squares of the recorded "
            "command): they know nothing of the encoder's noise in the acceleration"
        )
    else:
        told = (
            "least squares of the recorded command, which carries the forces that nothing "
            "explains; the acceleration on the right counts as free of error below "
            f"{signals.band_hz:.3g} Hz{_between(model)}"
        )
    method: Literal["least_squares", "instruments"] = (
        "instruments" if instruments else "least_squares"
    )
    return Estimator(model.regressors.side, method, f"parameters by {told}")


def _between(model: Hypothesis) -> str:
    """Return between what values the inertia lies, where the acceleration may be full of noise.

    With the command on the left, noise of the acceleration makes the inertia smaller; with the
    acceleration there, forces that nothing explains make it larger, if they know nothing of it.
    """
    gram = model.problem.total
    two, others = np.array([0, len(gram) - 1]), np.arange(1, len(gram) - 1)
    beside, cross = gram[np.ix_(others, others)], gram[np.ix_(others, two)]
    rest = gram[np.ix_(two, two)] - cross.T @ np.linalg.lstsq(beside, cross, rcond=None)[0]
    seen = rest[0, 1] ** 2 / max(rest[0, 0] * rest[1, 1], TINY)
    inertia = inertia_of(model)
    if not HARDLY_SEEN < seen < 1.0 / FAR_OFF or not inertia > 0.0:
        return ""
    data = model.regressors.signals.data
    unit = data.unit(OF_INERTIA)
    return (
        f"; least squares of the acceleration would have an inertia of {inertia / seen:.3g} "
        f"{unit} where this has {inertia:.3g}, and the true one may lie between"
    )
