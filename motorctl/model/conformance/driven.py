"""Kernels as the tick calls them, and motions to call them with."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from motorctl.model.effect import Effect
from motorctl.model.first_run import kernel_calls

Array = NDArray[np.float64]

PERIOD_S = 2e-4
"""Time from tick to tick [s]. Larger takes the memory of quick effects in coarse steps, smaller
makes the strokes of so many ticks too short. Convention: that of a loop at 5 kHz."""
BEHIND = 37
"""Ticks that each other axis is behind the one before; the first moves with this one. Fewer makes
the axes alike, so that columns of two of them could not be told apart, more leaves the last ones at
their start in short motions. Chosen by hand."""


def wide(most: float) -> st.SearchStrategy[float]:
    """Return numbers of both signs up to the largest, zero and tiny ones among them."""
    return st.floats(-most, most, allow_nan=False, allow_subnormal=True)


MOTION = st.tuples(wide(1e2), wide(1e2), wide(1e4), wide(1e2), st.floats(0.0, 1e7))
"""x [m], v [m/s], a [m/s^2], a quiet velocity, t [s]: beyond any machine."""
COMMAND = st.tuples(wide(1e3), wide(1e2), wide(1e2), st.floats(0.0, 1e7))
"""u [V], x [m], vs [m/s], t [s]."""


class Driven:
    """An effect with a memory of its own, driven from outside."""

    def __init__(self, effect: Effect) -> None:
        self.effect = effect
        self.memory: Array = np.zeros(effect.memory_size)
        self.constants = np.array(effect.constants, np.float64)
        self._past: list[tuple[float, float, float]] = []
        self._calls = kernel_calls(type(effect))

    @property
    def indices(self) -> range:
        """Of the parameters."""
        return range(len(self.effect.parameters))

    def state(self, j: int, x: float, v: float, a: float, vs: float, t: float) -> float:
        """Return the column of a state effect."""
        return float(self._calls.column(j, x, v, a, vs, t, *self._held(), self.constants))

    def input(
        self, kernel: str, j: int, u: float, x: float = 0.0, vs: float = 0.0, t: float = 0.0
    ) -> float:
        """Return the column or the slope of an input effect."""
        place = self.effect.place(x, vs, t)
        return float(getattr(self._calls, kernel)(j, u, *place, *self._held(), self.constants))

    def advance(self, x: float, v: float, a: float, dt: float) -> None:
        """Take the memory of a state effect along; the other axes move alike, but later."""
        self._past.append((x, v, a))
        others = np.zeros((len(self.effect.other_axes), 3))
        for i in range(len(others)):
            others[i] = self._past[max(0, len(self._past) - 1 - BEHIND * i)]
        self._calls.advance(self.memory, x, v, a, dt, others, self.constants)

    def commit(self, u: float, dt: float) -> None:
        """Commit a command to the memory of an input effect."""
        self._calls.advance(self.memory, u, dt, self.constants)

    def correct(self, y: float) -> float:
        """Return the position without the error of a measurement effect."""
        return float(self._calls.correct(y, self.constants))

    def error(self, j: int, x: float) -> float:
        """Return what a measurement effect shows too much for an amplitude of one."""
        return float(self._calls.column(j, x, self.constants))

    def _held(self) -> tuple[Array, ...]:
        return (self.memory,) if self.effect.remembers() else ()


def strokes(count: int, seed: int = 3) -> list[tuple[float, float, float, float]]:
    """Return x, v, a and u from -0.3 to 0.4 m and back, a tick apart; the first is at rest.

    Smaller strokes of other frequencies go on top of it.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(count) * PERIOD_S
    x, v, a, u = np.full(count, -0.3), np.zeros(count), np.zeros(count), np.zeros(count)
    strokes_m = [(1.0 / t[-1], 0.35), *((hz, 0.02 / hz) for hz in rng.uniform(2.0, 40.0, 8))]
    for hz, size in strokes_m:
        w = 2.0 * np.pi * hz
        x += size * (1.0 - np.cos(w * t))
        v += size * w * np.sin(w * t)
        a += size * w * w * np.cos(w * t)
        u += rng.uniform(0.2, 2.0) * np.sin(w * t)
    return list(zip(x.tolist(), v.tolist(), a.tolist(), u.tolist(), strict=True))
