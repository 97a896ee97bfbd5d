"""Options of effects whose residual has many valleys: sought by evolution, first below a low band.

Where a load meets the flank of a gap at another moment, all its later impacts move. So nearly right
options fit no better than wrong ones do, and no search that goes downhill comes from one to the
other. Below a low band an impact is as wide as the error of its moment, and the valleys are one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.measured_forms import Form, measure
from motorctl.identify.diagnose.search.option_ranges import option_bounds
from motorctl.model import Spans

Array = NDArray[np.float64]

SMOOTH_PART, SMOOTH_HZ = 0.3, 20.0
"""Low band, as a part of the recording's, and at most [Hz]. Larger has more valleys, smaller says
less of an impact's moment. Chosen by hand on five machines of other hands, by acceleration and by
command: below 15 and below 20 Hz nine gaps of ten are found, in the whole band one."""
MEMBERS, GENERATIONS = 60, 25
"""Forms that evolve together below the low band, and how long. More take time, fewer miss the
deepest valley. Chosen by hand: twelve times the options of a gap."""
SHOWS = 0.9
"""Part of the squared residual below the low band that the best form leaves, from which on the
whole band is not searched. Larger takes time on what is no such effect, smaller misses weak ones.
Chosen by hand."""
EARLY = 5
"""Generations after which evolution ends where nothing shows by then. More take time, fewer miss
gaps that are met late. Chosen by hand: machines of other hands with a gap leave 0.83 by then at
most, others 0.79 to 0.95."""
LAST_MEMBERS, LAST_GENERATIONS = 30, 12
"""Forms that evolve, and how long, in the whole band around what was found. More take time, fewer
end beside the valley. Chosen by hand."""
AS_GOOD = 0.3
"""Part of the squared residual that an option may leave more than the best, to count as being as
good: there the whole band is searched. Larger leaves too much to search, smaller too little. Chosen
by hand."""
STEPS = (0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.0)
"""Steps by which an option is moved until it does worse, as parts of its range. Larger leave too
much to search, smaller take time. Arithmetic: each is twice the
one before, and the last is all of the range."""
SETTLED = 1e-3
"""Spread of the members' squared residuals, over their mean, at which they have met. Larger stops
short, smaller takes time. Chosen by hand."""
UNBOUNDED = 4.0
"""Factor around an option without a range of its own. Larger leaves too much to search, smaller
misses what the scan did not meet. Chosen by hand."""
WORST = 1e9
"""Cost of a form that cannot be, over that of no form at all. Any other would do that is beyond
what forms cost. Chosen by hand."""
SEED = 1
"""Of the evolution: the same recording has the same answer. Any other would do. Convention."""


@dataclass(frozen=True)
class _Box:
    """Where options are sought; positive ones by their logarithm."""

    names: tuple[str, ...]
    low: Array
    high: Array
    by_logarithm: NDArray[np.bool_]

    def options(self, places: Array) -> Array:
        """Return the options at places between 0 and 1, (..., names)."""
        low, high = self._scaled(self.low), self._scaled(self.high)
        values = low + places * (high - low)
        return np.where(self.by_logarithm, np.exp(values), values)

    def places(self, options: Array) -> Array:
        """Return where options lie, (..., names); those outside at the box's end."""
        low, high = self._scaled(self.low), self._scaled(self.high)
        inside = np.clip(options, self.low, self.high)
        return np.clip((self._scaled(inside) - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)

    def between(self, low: Array, high: Array) -> _Box:
        """Return the part of the box between two places."""
        return _Box(self.names, self.options(low), self.options(high), self.by_logarithm)

    def _scaled(self, values: Array) -> Array:
        positive = np.where(self.by_logarithm, values, 1.0)
        return np.where(self.by_logarithm, np.log(positive), values)


def evolved(hypothesis: Hypothesis, scanned: Sequence[Form], spans: Spans) -> Form:
    """Return the best form that evolves from some of an effect, the best of which is the first.

    Parameters
    ----------
    hypothesis
        What is there beside it.
    scanned
        Forms of one effect, best first.
    spans
        Of the motion.
    """
    box = _box(scanned[0], spans)
    smooth = _below(hypothesis, min(SMOOTH_PART * _band(hypothesis), SMOOTH_HZ))
    begun = _values(scanned, box.names)
    rough = _Trial(smooth, scanned[0], coarse=True)
    found = _evolve(rough, box, begun, MEMBERS, GENERATIONS, hopeless=SHOWS)
    if rough.cost(box, box.places(found)) > SHOWS:
        return scanned[0]
    near = _as_good(rough, box, found)
    whole = _Trial(hypothesis, scanned[0], coarse=False)
    found = _evolve(whole, near, found[None], LAST_MEMBERS, LAST_GENERATIONS)
    best = whole.measured(box.names, found)
    return scanned[0] if best is None or best.sse >= scanned[0].sse else best


def _band(hypothesis: Hypothesis) -> float:
    return hypothesis.regressors.signals.band_hz


def _below(hypothesis: Hypothesis, band_hz: float) -> Hypothesis:
    """Return the hypothesis on the same rows behind a low pass, its parameters fitted anew."""
    old = hypothesis.regressors
    if old.offset is not None:  # formed for the whole band
        return hypothesis
    regressors = Regressors(
        old.signals.plain(band_hz), old.declared, old.blocks, old.side, old.catalogue
    )
    return Hypothesis(regressors, hypothesis.added, hypothesis.acceleration)


def _box(form: Form, spans: Spans) -> _Box:
    names = tuple(form.effect.steps(spans))
    bounds = option_bounds(form.effect, names, spans)
    at = _values([form], names)[0]
    low, high = (np.array(ends) for ends in zip(*bounds, strict=True))
    low = np.where(np.isfinite(low), low, np.minimum(at / UNBOUNDED, at * UNBOUNDED))
    high = np.where(np.isfinite(high), high, np.maximum(at / UNBOUNDED, at * UNBOUNDED))
    return _Box(names, low, high, low > 0.0)


def _values(forms: Sequence[Form], names: Sequence[str]) -> Array:
    return np.array(
        [[float(getattr(form.effect.options, name)) for name in names] for form in forms]
    )


@dataclass(frozen=True)
class _Trial:
    """What a form is measured by."""

    hypothesis: Hypothesis
    form: Form
    coarse: bool

    def measured(self, names: Sequence[str], options: Array) -> Form | None:
        """Return the form with these options; None where it cannot be."""
        changed = dict(zip(names, map(float, options), strict=True))
        try:
            effect = self.form.effect.with_options(**changed)
        except ValidationError:
            return None
        return measure(self.hypothesis, effect, coarse=self.coarse)

    def cost(self, box: _Box, place: Array) -> float:
        """Return the squared residual at a place in the box, over that of no such form."""
        found = self.measured(box.names, box.options(place))
        if found is None:
            return WORST
        return found.sse / max(self.hypothesis.solution.sse, 1e-300)


def _as_good(trial: _Trial, box: _Box, best: Array) -> _Box:
    """Return the part of the box within which, one by one, options do nearly as well as the best.

    What the low band does not tell, as how quick a contact is, keeps all of its range.
    """
    place = box.places(best)
    limit = (1.0 + AS_GOOD) * trial.cost(box, place)
    low, high = place.copy(), place.copy()
    for i in range(len(place)):
        for ends, way in ((low, -1.0), (high, 1.0)):
            for step in STEPS:
                tried = place.copy()
                tried[i] = min(max(place[i] + way * step, 0.0), 1.0)
                ends[i] = tried[i]
                if trial.cost(box, tried) > limit:
                    break
    return box.between(low, high)


def _evolve(
    trial: _Trial,
    box: _Box,
    begun: Array,
    count: int,
    generations: int,
    hopeless: float = math.inf,
) -> Array:
    """Return the best options (names,) that evolve from some, (forms, names).

    Where the best costs more than what is hopeless it ends early.
    """
    places = qmc.LatinHypercube(len(box.names), rng=SEED).random(count)
    half = min(len(begun), count // 2)
    # what a scan never varied says nothing, and without variety nothing evolves
    varied = (np.ptp(begun, axis=0) > 0.0) | (len(begun) == 1)
    places[:half] = np.where(varied, box.places(begun[:half]), places[:half])

    def cost(place: Array) -> float:
        return trial.cost(box, place)

    def go_on(intermediate_result: Any) -> None:
        if intermediate_result.nit >= EARLY and intermediate_result.fun > hopeless:
            raise StopIteration  # which is how scipy is told to end

    result = differential_evolution(
        cost,
        Bounds(np.zeros(len(box.names)), np.ones(len(box.names))),
        init=places,
        maxiter=generations,
        rng=SEED,
        polish=False,
        tol=SETTLED,
        callback=go_on,
    )
    return box.options(result.x)
