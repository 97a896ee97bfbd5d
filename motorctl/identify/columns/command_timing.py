"""The command in time with the acceleration: held, delayed and lagged as the difference sees it.

The amplifier holds u_k from tick k to tick k + 1 (zero-order hold), d samples later where
there is an input delay. A second difference of positions around tick k is the acceleration
averaged with a triangle of half-width one period, so the command that belongs to it is the held
command averaged with the same triangle: (u_k + u_{k-1})/2 without delay, and for 0 <= d <= 1

    (1 - d)^2/2 u_k + (1/2 + d - d^2) u_{k-1} + d^2/2 u_{k-2}.

This is linear in u; for a nonlinear term it holds of h(u_k), formed before. A positive delay
means that the command acts later than the tick in which it was written. Behind a lag the held
periods are cut where the triangle and the hold change, and each piece is exact for what is linear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Taps:
    """A short filter: the sum of weights[i] u_{k - lags[i]}."""

    lags: NDArray[np.int64]
    weights: Array


def hold_taps(delay_samples: float, half_width: int) -> Taps:
    """Weigh the held commands that act within the triangle around a tick.

    `half_width` of the triangle is in samples: 1 for a second difference, 2 for a central
    difference taken twice.
    """
    first = math.ceil(delay_samples - half_width) - 1
    last = math.floor(delay_samples + half_width) + 1
    lags = np.arange(first, last + 1, dtype=np.int64)
    edges = delay_samples - np.append(lags, last + 1) + 1.0
    area = _triangle_area(edges / half_width)
    weights = area[:-1] - area[1:]
    used = weights > 0.0
    return Taps(lags[used], weights[used])


def sample_taps(delay_samples: float) -> Taps:
    """Take the command at its tick, with no regard to the hold; between ticks interpolated."""
    whole = math.floor(delay_samples)
    part = delay_samples - whole
    if part == 0.0:
        return Taps(np.array([whole], dtype=np.int64), np.array([1.0]))
    return Taps(np.array([whole, whole + 1], dtype=np.int64), np.array([1.0 - part, part]))


def _triangle_area(s: Array) -> Array:
    """Integrate the triangle max(0, 1 - |s|) from minus infinity."""
    s = np.clip(s, -1.0, 1.0)
    return np.where(s < 0.0, 0.5 * (1.0 + s) ** 2, 1.0 - 0.5 * (1.0 - s) ** 2)


@dataclass(frozen=True)
class CommandPath:
    """What happens to the command before it acts."""

    delay_s: float = 0.0
    lag_s: float = 0.0

    def undone(self, frequency_hz: Array) -> NDArray[np.complex128]:
        """Return the response that takes the path back: a lead for the lag, earlier by the delay.

        A force that the command has to give at a time is found in the command so much before.
        """
        w = 2.0j * np.pi * frequency_hz
        return np.asarray(np.exp(w * self.delay_s) * (1.0 + w * self.lag_s))


@dataclass(frozen=True)
class RecordedLate(CommandPath):
    """The same, where the column was smoothed or late besides when it was recorded."""

    smoothed_s: float = 0.0
    """Time constant of what smoothed it."""
    late_s: float = 0.0

    def undone(self, frequency_hz: Array) -> NDArray[np.complex128]:
        """Return the response that takes the path back, and then smooths and delays."""
        w = 2.0j * np.pi * frequency_hz
        back = super().undone(frequency_hz)
        return np.asarray(back * np.exp(-w * self.late_s) / (1.0 + w * self.smoothed_s))


AT_ONCE = CommandPath()
"""The command acts in the tick in which it is written, held until the next."""


def held_parts(command: Array, path: CommandPath, period_s: float) -> list[tuple[float, Array]]:
    """Return what acts around each tick, as series (N,) with weights that add up to one.

    Behind a lag, the triangle cuts the held periods into four pieces; each series is the
    triangle's mean over a piece, exact for what is linear.
    """
    u = command
    if path.lag_s <= 0.0:
        taps = hold_taps(path.delay_s / period_s, 1)
        return [
            (float(weight), later(u, int(lag)))
            for lag, weight in zip(taps.lags, taps.weights, strict=True)
        ]
    whole = math.floor(path.delay_s / period_s)
    part = path.delay_s / period_s - whole
    weights = (
        0.5 * part**2,
        part * (1.0 - part) + 0.5 * (1.0 - part) ** 2,
        part - 0.5 * part**2,
        0.5 * (1.0 - part) ** 2,
    )
    rate = period_s / path.lag_s
    decay = math.exp(-rate)
    # i at the beginning of each held period, exactly
    i, _ = lfilter([0.0, 1.0 - decay], [1.0, -decay], u, zi=u[:1])
    rest = i - u
    edge = 1.0 - part
    # each piece: where in its held period it lies, and the triangle there, a + b s
    pieces = [
        (edge, 1.0, -edge, 1.0, 2),
        (0.0, edge, part, 1.0, 1),
        (edge, 1.0, 1.0 + edge, -1.0, 1),
        (0.0, edge, edge, -1.0, 0),
    ]
    parts = []
    for weight, (begin, end, a, b, lag) in zip(weights, pieces, strict=True):
        if weight <= 0.0:
            continue
        share = (_moment(begin, end, rate, a, b)) / weight
        parts.append((weight, later(u + share * rest, lag + whole)))
    return parts


def _moment(begin: float, end: float, rate: float, a: float, b: float) -> float:
    """Integrate (a + b s) exp(-rate s) from begin to end."""

    def primitive(s: float) -> float:
        return -math.exp(-rate * s) * ((a + b * s) / rate + b / rate**2)

    return primitive(end) - primitive(begin)


def later(u: Array, ticks: int) -> Array:
    """Return a series so many ticks later, its first value before; or earlier, its last after."""
    if ticks == 0:
        return u
    if ticks < 0:
        return later(u[::-1], -ticks)[::-1]
    return np.concatenate([np.full(min(ticks, len(u)), u[0]), u[:-ticks]])
