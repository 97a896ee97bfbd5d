"""Random numbers of one subject of a case, as plain Python numbers for a configuration."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


class Draw:
    """A stream of its own for each seed and subject.

    So a machine stays the same whatever effects are put into it, and an effect keeps its shape
    whatever other effects stand beside it.
    """

    def __init__(self, seed: int, *subject: str | int) -> None:
        words = (zlib.crc32(str(word).encode()) for word in subject)
        self._rng = np.random.default_rng([seed, *words])

    def uniform(self, low: float, high: float) -> float:
        """Return a number drawn uniformly between the two."""
        return float(self._rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """Return a number whose logarithm is uniform between those of the two."""
        return math.exp(self.uniform(math.log(low), math.log(high)))

    def sign(self) -> float:
        """Return 1 or -1."""
        return 1.0 if self.chance(0.5) else -1.0

    def phase(self) -> float:
        """Return an angle [rad]."""
        return self.uniform(-math.pi, math.pi)

    def chance(self, share: float) -> bool:
        """Return true with that probability."""
        return bool(self._rng.random() < share)

    def whole(self, low: int, high: int) -> int:
        """Return a whole number between the two, both included."""
        return int(self._rng.integers(low, high, endpoint=True))

    def pick(self, choices: Sequence[T], weights: Sequence[float] | None = None) -> T:
        """Return one of the choices, by weights where given."""
        shares = None if weights is None else np.asarray(weights) / sum(weights)
        return choices[int(self._rng.choice(len(choices), p=shares))]

    def some(self, choices: Sequence[T], count: int) -> list[T]:
        """Return `count` different choices, in random order."""
        return [choices[int(k)] for k in self._rng.permutation(len(choices))[:count]]

    def shares(self, count: int) -> list[float]:
        """Return `count` positive numbers whose sum is 1, none of them tiny."""
        parts = self._rng.uniform(0.3, 1.0, count)
        return [float(part) for part in parts / parts.sum()]

    def smooth_values(self, count: int, peak: float) -> list[float]:
        """Return the knots of a random curve of zero mean whose largest deviation is `peak`."""
        values = self._rng.standard_normal(count)
        values -= values.mean()
        return [float(value) for value in values * (peak / np.abs(values).max())]
