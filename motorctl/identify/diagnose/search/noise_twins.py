"""Noise twins of the identified machine: what gains the search finds where nothing is missing.

A twin is the fitted model with noise of the machine's own spectrum in place of what is left over:
the phases of the residual that no smooth function explains are drawn anew. What the best form of
any effect gains on twins is chance, however the noise is coloured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.diagnose.search.forms import best_form, candidates
from motorctl.identify.diagnose.search.held_out_blocks import residual
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.smooth_functions import SmoothFunctions
from motorctl.identify.diagnose.search.whitening import saturated_residual
from motorctl.model import Spans
from motorctl.model.sign_function import Sign

Array = NDArray[np.float64]

TWINS = 2
"""Noise twins of the identified machine that are formed. More tells better what chance gains,
and takes time; fewer lets a lucky twin pass a false name. Chosen by hand on the simulated
campaign."""
SEED = 20
"""Seed of the twins' noise, always the same: the same recording gets the same answer. Any other
would do as well. Convention."""


def largest_gain(hypothesis: Hypothesis, spans: Spans, sign: Sign | None) -> float:
    """Return the largest gain in held-out log-likelihood that any effect has on noise twins."""
    rows = hypothesis.regressors.signals.rows
    fitted_rest = residual(hypothesis.problem, hypothesis.solution.b)[:rows]
    noise = saturated_residual(hypothesis, SmoothFunctions(hypothesis.regressors.signals))
    draw = np.random.default_rng(SEED)
    largest = 0.0
    for _ in range(TWINS):
        regressors = hypothesis.regressors.with_offset(_phases_anew(noise, draw) - fitted_rest)
        twin = Hypothesis(regressors, hypothesis.added, hypothesis.acceleration)
        forms = (best_form(twin, cls, spans, sign) for cls in candidates(twin, spans))
        left = min((f.held_out for f in forms if f is not None), default=twin.held_out)
        largest = max(largest, 0.5 * rows * float(np.log(twin.held_out / max(left, 1e-300))))
    return largest


def _phases_anew(rows: Array, draw: np.random.Generator) -> Array:
    spectrum = np.fft.rfft(rows)
    turned = spectrum * np.exp(2j * np.pi * draw.random(len(spectrum)))
    turned[0] = spectrum[0]
    return np.fft.irfft(turned, len(rows))
