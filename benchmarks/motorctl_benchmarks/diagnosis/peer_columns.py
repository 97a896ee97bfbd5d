"""What peers are given: the rows and columns of our own search, as one regression problem.

The rows are those behind our filter and our whitening, and what the declared effects explain has
been taken out of them: both libraries then only have to tell which column explains the rest.

- *physical*: every known effect in the form that our first scan finds best for it, nonlinear
  parameters included: pitch, frequency, time constant, dead band
- *generic*: what one would take without knowing the effects: products of two measured signals,
  and sines over position and time
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import CommandPath, held_parts
from motorctl.identify.columns.measured import with_others
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.columns.stretches import Stretch
from motorctl.identify.diagnose.search.forms import candidates
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.ranking import ranked
from motorctl.identify.diagnose.search.search import whitened
from motorctl.identify.diagnose.search.undetermined import without_undetermined
from motorctl.identify.fit.declared_models import declared_models
from motorctl.log import Recording
from motorctl.model import Effect, Spans
from motorctl.model.sign_function import Sign, sign_of, slope_of

Array = NDArray[np.float64]

Meaning = tuple[str, ...]
"""The known effects that a column stands for; empty where it stands for none."""

STILL_M_S = 2e-3
"""Speed at which the generic library's direction of motion is 0.76."""
SINES = 10
"""Of the generic library over position and over time: so many cycles in the recording."""
MEANINGS: dict[frozenset[str], Meaning] = {
    frozenset(signals.split()): meaning
    for signals, meaning in (
        ("x", ("position_force",)),
        ("v", ("asymmetric_friction", "quadratic_drag")),
        ("v direction", ("asymmetric_friction",)),
        ("direction", ("stribeck", "presliding")),
        ("x direction", ("position_dependent_friction",)),
        ("x v", ("position_dependent_friction",)),
        ("x u", ("force_ripple",)),
        ("u", ("dead_zone",)),
        ("u direction", ("dead_zone",)),
        ("du", ("input_lag", "input_delay")),
        ("t u", ("gain_drift",)),
        ("t a", ("payload_change",)),
        ("other_a", ("cross_axis",)),
        ("other_v", ("cross_axis",)),
        ("sine_x", ("cogging",)),
        ("sine_t", ("periodic_disturbance",)),
    )
}
"""Which effects a generic term would be read as, by the signals in it."""


@dataclass(frozen=True)
class PeerProblem:
    """A sparse regression of y on columns; m rows, p columns."""

    y: Array
    """(m,)"""
    columns: Array
    """(p, m), each of length one."""
    meanings: tuple[Meaning, ...]
    """(p,)"""


@dataclass(frozen=True)
class PeerBench:
    """One axis of a recording behind our filter, and the forms of our first scan."""

    hypothesis: Hypothesis
    spans: Spans
    sign: Sign | None

    @classmethod
    def of(cls, recording: Recording, axis: str) -> PeerBench:
        """Prepare as a diagnosis does, up to its first scan."""
        data = with_others(recording, axis)
        declared = declared_models(recording, None, axis)[axis]
        signals = make_signals(data, slope_s_m=slope_of(declared.effects))
        model, _ = without_undetermined(signals, declared)
        regressors, _ = whitened(signals, model, ())
        return cls(Hypothesis(regressors).refreshed(), spans_of(signals), sign_of(declared.effects))

    def physical(self) -> PeerProblem:
        """Return the columns of every known effect."""
        forms = ranked(
            self.hypothesis, candidates(self.hypothesis, self.spans), self.spans, self.sign
        )
        columns, meanings = [], []
        for form in forms:
            rows = self._rows_of(form.effect)
            columns.append(rows)
            meanings += [(form.effect.name,)] * len(rows)
        return self._problem(np.vstack(columns), meanings)

    def generic(self) -> PeerProblem:
        """Return products of two signals, and sines."""
        signals = self.hypothesis.regressors.signals
        acceleration = self.hypothesis.predicted_acceleration()
        names, parts = [], []
        for s, a in zip(signals.stretches, acceleration, strict=True):
            terms = _generic_terms(s, a, signals.period_s, self.spans)
            names = [name for name, _ in terms]
            parts.append(np.stack([term for _, term in terms]))
        meanings = [MEANINGS.get(frozenset(name.split()), ()) for name in names]
        return self._problem(signals.filtered(parts), meanings)

    def _rows_of(self, effect: Effect) -> Array:
        """Return an effect's columns as they enter our regression, (p, m)."""
        own = self.hypothesis.problem.columns
        if effect.kind == "command":
            # enters as the difference that it makes to the command
            with_it = self.hypothesis.plus(effect).problem.columns
            return self._flat(with_it[:, :1] - own[:, :1])
        extended = self.hypothesis.extended(effect).columns
        return self._flat(extended[:, own.shape[1] - 1 : -1])

    def _flat(self, columns: Array) -> Array:
        flat = columns.swapaxes(0, 1).reshape(columns.shape[1], -1)
        return np.asarray(flat[:, : self.hypothesis.regressors.signals.rows])

    def _problem(self, columns: Array, meanings: Sequence[Meaning]) -> PeerProblem:
        """Take what the declared effects explain out of columns and rows."""
        declared = self._flat(self.hypothesis.problem.columns)
        q, _ = np.linalg.qr(declared[:-1].T / np.linalg.norm(declared[:-1], axis=1))
        y = declared[-1] - q @ (q.T @ declared[-1])
        left = columns - (columns @ q) @ q.T
        whole, own = np.linalg.norm(columns, axis=1), np.linalg.norm(left, axis=1)
        usable = np.isfinite(own) & (own > 1e-6 * whole) & (own > 0.0)
        kept = [meaning for meaning, use in zip(meanings, usable, strict=True) if use]
        return PeerProblem(y, left[usable] / own[usable, None], tuple(kept))


def _generic_terms(s: Stretch, a: Array, period_s: float, spans: Spans) -> list[tuple[str, Array]]:
    """Return named terms over a stretch, (N,) each; signals are scaled to about one."""
    middle = 0.5 * sum(spans.position_m)
    place = 2.0 * (s.x - middle) / spans.travel_m
    age = (s.time_s - spans.time_s[0]) / spans.duration_s
    u = sum(weight * part for weight, part in held_parts(s.command, CommandPath(), period_s))
    command = np.asarray(u) / spans.command_v
    signals = {
        "x": place,
        "v": s.v / spans.speed_m_s,
        "direction": np.tanh(s.quiet / STILL_M_S),
        "a": a / spans.acceleration_m_s2,
        "u": command,
        "du": np.gradient(command, period_s) * 1e-3,
        "t": age,
    }
    terms = [(name, signal) for name, signal in signals.items() if name != "a"]
    for (one, first), (two, second) in combinations_with_replacement(signals.items(), 2):
        terms.append((f"{one} {two}", first * second))
    for motion in s.others.values():
        speed, change = motion[:, 1], motion[:, 2]
        terms += [("other_v", speed), ("other_a", change)]
    for k in range(1, SINES + 1):
        for name, angle in (("sine_x", np.pi * k * place), ("sine_t", 2.0 * np.pi * k * age)):
            terms += [(name, np.sin(angle)), (name, np.cos(angle))]
    return terms
