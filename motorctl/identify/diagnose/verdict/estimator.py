"""By what method the parameters were found, and how errors in the regressors were met."""

from __future__ import annotations

from typing import Literal

from motorctl.identify.diagnose.result import Estimator
from motorctl.identify.diagnose.search.hypothesis import Hypothesis


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
            f"{signals.band_hz:.3g} Hz"
        )
    method: Literal["least_squares", "instruments"] = (
        "instruments" if instruments else "least_squares"
    )
    return Estimator(model.regressors.side, method, f"parameters by {told}")
