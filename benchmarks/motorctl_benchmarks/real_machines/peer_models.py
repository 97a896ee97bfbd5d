"""What general identification libraries predict on the same motion as `diagnose`.

Both are optional (``pip install './benchmarks[peers]'``) and are used as their documentation does:

- ARX and NARX by SysIdentPy: the position from its own last samples and the command's, linear or
  with products of two; terms chosen by forward regression (FROLS) and the Bayesian information
  criterion. Simulated freely over each window.
- sparse dynamics by PySINDy: the acceleration as products up to the third degree of position,
  velocity and command; terms chosen by thresholded least squares (STLSQ). Integrated over each
  window along the recorded motion, as our own model is.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.signals import Signals
from motorctl.identify.columns.stretches import Stretch
from motorctl.identify.diagnose.search.simulated_position import ByWindow, missed_by
from motorctl_benchmarks.diagnosis.peers import MODULES, THRESHOLDS, bic, installed_peers

Array = NDArray[np.float64]

LINEAR_LAGS = 4
"""Samples of the past that ARX sees."""
SQUARED_LAGS = 2
"""The same of NARX, whose products grow with their square."""
STEPS = 10
"""Samples of a window, where the recording has more: one-step predictions of samples that are much
closer than the motion is fast say nothing."""
MOST_TERMS = 20
NEAR = 0.4
"""Logarithm of the ratio of two lengths of windows that count as one. Chosen by hand: less than a
half decade."""
DEGREE = 3
"""Of PySINDy's products."""
PREDICTED_BAND = 1.5
"""Band of the acceleration that PySINDy is fitted to, in multiples of the rows' band: as ours."""


def peer_errors(train: Signals, test: Signals, window_s: float) -> dict[str, float]:
    """Return by peer what its prediction misses of the position [rms] in windows of a length.

    Parameters
    ----------
    train, test
        The motion to fit, and that to be judged on.
    window_s
        Length of the windows [s].
    """
    present = {MODULES[name] for name in installed_peers()}
    errors = {}
    for name, (module, predict) in PEERS.items():
        if module in present:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # their arithmetic is their own
                errors[name] = predict(train, test, window_s)
    return errors


def _arx(train: Signals, test: Signals, window_s: float) -> float:
    return _autoregressive(train, test, window_s, degree=1, lags=LINEAR_LAGS)


def _narx(train: Signals, test: Signals, window_s: float) -> float:
    return _autoregressive(train, test, window_s, degree=2, lags=SQUARED_LAGS)


def _autoregressive(
    train: Signals, test: Signals, window_s: float, degree: int, lags: int
) -> float:
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    samples = max(round(window_s / train.period_s), 1)
    step = max(1, samples // STEPS)
    longest = max(train.stretches, key=lambda s: len(s.x))
    scale = _Scale(longest)
    X, y = scale.command(longest)[::step, None], scale.position(longest)[::step, None]
    model = FROLS(
        ylag=lags,
        xlag=lags,
        info_criteria="bic",
        n_info_values=MOST_TERMS,
        estimator=LeastSquares(),
        basis_function=Polynomial(degree=degree),
    )
    model.fit(X=X, y=y)
    squares = []
    for s in test.stretches:
        X, y = scale.command(s)[::step, None], scale.position(s)[::step, None]
        predicted = model.predict(X=X, y=y, steps_ahead=samples // step)
        squares.append(np.ravel(predicted - y)[lags:] ** 2)
    return scale.x_spread * math.sqrt(float(np.mean(np.concatenate(squares))))


def _sparse(train: Signals, test: Signals, window_s: float) -> float:
    from pysindy import STLSQ, PolynomialLibrary

    scale = _Scale(max(train.stretches, key=lambda s: len(s.x)))
    library = PolynomialLibrary(degree=DEGREE)
    inside = np.concatenate([scale.state(s) for s in train.stretches])
    acceleration = np.concatenate(train.smoothed_acceleration(PREDICTED_BAND))
    columns = np.asarray(library.fit_transform(inside))
    lengths = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    size = float(np.linalg.norm(acceleration))
    best: tuple[float, Array] = (math.inf, np.zeros(columns.shape[1]))
    for threshold in THRESHOLDS:
        optimizer = STLSQ(threshold=threshold, alpha=1e-6)
        optimizer.fit(columns / lengths, acceleration / size)
        weights = np.ravel(optimizer.coef_)
        left = acceleration / size - columns / lengths @ weights
        value = bic(float(left @ left), int(np.count_nonzero(weights)), len(left))
        if value < best[0]:
            best = value, weights * size / lengths
    predicted = [np.asarray(library.transform(scale.state(s))) @ best[1] for s in test.stretches]
    return at(missed_by(predicted, test), window_s)


def at(missed: ByWindow, window_s: float) -> float:
    """Return what is missed in the windows of the length nearest to one; NaN where none is near."""
    near = min(missed, key=lambda length: abs(math.log(length / window_s)), default=math.inf)
    return missed[near] if abs(math.log(near / window_s)) < NEAR else math.nan


class _Scale:
    """Position, velocity and command of about unit size: libraries are used on such."""

    def __init__(self, s: Stretch) -> None:
        self.x_mean, self.x_spread = float(s.x.mean()), max(float(s.x.std()), 1e-300)
        self.v_spread = max(float(s.v.std()), 1e-300)
        self.u_spread = max(float(s.command.std()), 1e-300)

    def position(self, s: Stretch) -> Array:
        return np.asarray((s.x - self.x_mean) / self.x_spread)

    def command(self, s: Stretch) -> Array:
        return np.asarray(s.command / self.u_spread)

    def state(self, s: Stretch) -> Array:
        return np.column_stack([self.position(s), s.v / self.v_spread, self.command(s)])


PEERS: Mapping[str, tuple[str, Callable[[Signals, Signals, float], float]]] = {
    "ARX (SysIdentPy)": ("sysidentpy", _arx),
    "NARX (SysIdentPy)": ("sysidentpy", _narx),
    "SINDy (PySINDy)": ("pysindy", _sparse),
}
"""By name, the module that it needs and what predicts."""
