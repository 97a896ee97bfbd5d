"""The command in time with the acceleration: held, delayed and lagged as the difference sees it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CommandPath:
    """What happens to the command before it acts."""

    delay_s: float = 0.0
    lag_s: float = 0.0


def held_parts(command: Array, path: CommandPath, period_s: float) -> list[tuple[float, Array]]:
    """Give what acts around each tick, as series (N,) with weights that add up to one.

    A second difference around a tick is the acceleration averaged with a triangle of half-width
    one period, so what belongs to it is the command that acts, averaged with the same triangle:
    held for a period, delayed, then through the lag. The triangle cuts the held periods into
    four pieces; each series is the triangle's mean over a piece, exact for what is linear.
    """
    u = command
    whole = math.floor(path.delay_s / period_s)
    part = path.delay_s / period_s - whole
    weights = (
        0.5 * part**2,
        part * (1.0 - part) + 0.5 * (1.0 - part) ** 2,
        part - 0.5 * part**2,
        0.5 * (1.0 - part) ** 2,
    )
    if path.lag_s <= 0.0:
        pieces = [(weights[0], 2), (weights[1] + weights[2], 1), (weights[3], 0)]
        return [(w, later(u, lag + whole)) for w, lag in pieces if w > 0.0]
    rate = period_s / path.lag_s
    decay = math.exp(-rate)
    # i at the beginning of each held period, exactly
    i, _ = lfilter([0.0, 1.0 - decay], [1.0, -decay], u, zi=u[:1])
    rest = i - u
    edge = 1.0 - part
    # each piece: where in its held period it lies, and the triangle there, a + b s
    pieces_ = [
        (edge, 1.0, -edge, 1.0, 2),
        (0.0, edge, part, 1.0, 1),
        (edge, 1.0, 1.0 + edge, -1.0, 1),
        (0.0, edge, edge, -1.0, 0),
    ]
    parts = []
    for weight, (begin, end, a, b, lag) in zip(weights, pieces_, strict=True):
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
    """Give a series so many ticks later, its first value before."""
    if ticks == 0:
        return u
    return np.concatenate([np.full(min(ticks, len(u)), u[0]), u[:-ticks]])
