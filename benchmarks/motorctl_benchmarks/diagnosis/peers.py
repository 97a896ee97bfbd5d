"""The same rows and columns to PySINDy and SysIdentPy: which effects they select.

Both are optional (``pip install './benchmarks[peers]'``). Each selects columns in its usual way,
and both get a dead band like that of our own search: an effect is named only where it takes enough
away, else they name causes on clean logs.

- PySINDy: sequentially thresholded least squares (STLSQ) over several thresholds, the one with the
  least Bayesian information criterion
- SysIdentPy: forward regression with orthogonal least squares (FROLS), its order chosen by the same
  criterion
"""

from __future__ import annotations

import importlib.util
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.log import Recording
from motorctl_benchmarks.diagnosis.peer_columns import Meaning, PeerBench, PeerProblem

Array = NDArray[np.float64]

THRESHOLDS = (0.01, 0.03, 0.06, 0.1, 0.2, 0.4)
"""Of STLSQ, in parts of the rows' length."""
MOST_TERMS = 15
"""Of FROLS, its own default."""
DEAD_BAND_GAIN = 60.0
"""In log-likelihood: what an effect must gain to be named."""
DEAD_BAND_SHARE = 0.06
"""Of the squared rest: what it must take away."""
Selected = Mapping[int, float]
"""The columns that were selected, each with the part of the squared rows that it stands for."""
MODULES = {"PySINDy": "pysindy", "SysIdentPy": "sysidentpy"}
LIBRARIES = ("physical", "generic")


@dataclass(frozen=True)
class PeerAnswer:
    """What a peer names, most important first; each as the effects that it may be read as."""

    named: tuple[Meaning, ...]
    seconds: float
    """Of its own selection; our scan of the forms is not in it."""

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {"named": [list(meaning) for meaning in self.named], "seconds": self.seconds}


def peer_name(library: str, columns: str) -> str:
    """Name a peer with the columns that it was given."""
    return f"{library}, {columns} library"


def installed_peers() -> tuple[str, ...]:
    """Return the peers that can be imported."""
    return tuple(name for name, module in MODULES.items() if importlib.util.find_spec(module))


def ask_peers(recording: Recording, axis: str) -> Mapping[str, PeerAnswer]:
    """Ask every installed peer, with either library; empty where none is installed."""
    present = installed_peers()
    if not present:
        return {}
    bench = PeerBench.of(recording, axis)
    problems = {"physical": bench.physical(), "generic": bench.generic()}
    answers = {}
    for name in present:
        for columns, problem in problems.items():
            began = time.monotonic()
            selected = SELECTIONS[name](problem)
            named = named_by(problem, selected)
            answers[peer_name(name, columns)] = PeerAnswer(named, time.monotonic() - began)
    return answers


def stlsq(problem: PeerProblem) -> Selected:
    """Select columns by PySINDy's STLSQ; a column of length one stands for its weight squared."""
    from pysindy import STLSQ

    scale = float(np.linalg.norm(problem.y))
    rows, y = problem.columns.T, problem.y / scale
    best: tuple[float, Selected] = (bic(float(y @ y), 0, len(y)), {})
    for threshold in THRESHOLDS:
        optimizer = STLSQ(threshold=threshold, alpha=1e-6)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that nothing is above the threshold
            optimizer.fit(rows, y)
        weight = np.ravel(optimizer.coef_)
        left = y - rows @ weight
        value = bic(float(left @ left), int(np.count_nonzero(weight)), len(y))
        if value < best[0]:
            best = value, {int(i): float(weight[i] ** 2) for i in np.flatnonzero(weight)}
    return best[1]


def frols(problem: PeerProblem) -> Selected:
    """Select columns by SysIdentPy's FROLS; a column stands for its error reduction ratio."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    p = len(problem.columns)
    model = FROLS(
        model_type="NFIR",
        xlag=[[1]] * p,
        ylag=1,
        basis_function=Polynomial(degree=1),
        estimator=LeastSquares(),
        info_criteria="bic",
        n_info_values=min(MOST_TERMS, p),
    )
    scale = float(np.linalg.norm(problem.y)) / np.sqrt(len(problem.y))
    # its inputs act one sample later
    inputs = np.vstack([problem.columns.T, np.zeros((1, p))]) * np.sqrt(len(problem.y))
    output = np.concatenate([[0.0], problem.y / scale])[:, None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(X=inputs, y=output)
    # its first regressor is the constant
    ratios = zip(model.pivv[: model.n_terms], model.err, strict=False)
    return {int(i) - 1: float(ratio) for i, ratio in ratios if i > 0}


def bic(sse: float, terms: int, rows: int) -> float:
    """Return the Bayesian information criterion of a least-squares fit.

    Parameters
    ----------
    sse
        Sum of squared residuals.
    terms
        Fitted coefficients.
    rows
        Equations.
    """
    return rows * float(np.log(max(sse, 1e-300) / rows)) + terms * float(np.log(rows))


def named_by(problem: PeerProblem, selected: Selected) -> tuple[Meaning, ...]:
    """Name the effects whose selected columns take enough away, the most important first.

    How important an effect is says the peer: what its columns stand for. What it takes away is
    measured with the effects before it fitted too.
    """
    importance: dict[Meaning, float] = {}
    for i, part in selected.items():
        meaning = problem.meanings[i]
        importance[meaning] = importance.get(meaning, 0.0) + part
    order = sorted(importance, key=lambda meaning: -importance[meaning])
    taken: list[int] = []
    named: list[Meaning] = []
    before = float(problem.y @ problem.y)
    for meaning in order:
        own = [i for i in selected if problem.meanings[i] == meaning]
        left = _left(problem, [*taken, *own])
        enough = 0.5 * len(problem.y) * np.log(before / max(left, 1e-300)) > DEAD_BAND_GAIN
        if not enough or before - left < DEAD_BAND_SHARE * before:
            continue
        taken += own
        before = left
        if meaning:
            named.append(meaning)
    return tuple(named)


def _left(problem: PeerProblem, columns: Sequence[int]) -> float:
    X = problem.columns[list(columns)].T
    b = np.linalg.lstsq(X, problem.y, rcond=None)[0]
    return float(np.sum((problem.y - X @ b) ** 2))


SELECTIONS: Mapping[str, Callable[[PeerProblem], Selected]] = {
    "PySINDy": stlsq,
    "SysIdentPy": frols,
}
