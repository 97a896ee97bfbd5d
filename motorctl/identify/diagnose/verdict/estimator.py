"""By what method the parameters were found, and how errors in the regressors were met."""

from __future__ import annotations

from motorctl.identify.diagnose.result import Estimator
from motorctl.identify.diagnose.search.hypothesis import Hypothesis


def estimator_of(model: Hypothesis) -> Estimator:
    """Return how a model's parameters were found."""
    signals = model.regressors.signals
    if model.regressors.side == "acceleration":
        told = (
            "least squares of the acceleration, which carries the noise of the measured position; "
            "rows are whitened by that noise's spectrum, and the recorded command counts as free "
            "of error"
        )
    else:
        told = (
            "least squares of the recorded command, which carries the forces that nothing "
            "explains; the acceleration on the right counts as free of error below "
            f"{signals.band_hz:.3g} Hz"
        )
    return Estimator(
        model.regressors.side,
        f"parameters by {told}; no instruments were used: where a reference was recorded, `fit` "
        "estimates the declared effects by them too",
    )
