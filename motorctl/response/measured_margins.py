"""Margins of a loop as it was measured: from line to line, nothing beyond them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import sign_changes

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class MeasuredMargins:
    """How far a loop is from instability in a band; None where it has no such crossing there."""

    crossover_hz: float | None
    phase_margin_deg: float | None
    """At the crossover that is nearest to -180 degrees."""
    gain_margin: float | None
    """The loop gain may grow by less than this factor."""
    largest_sensitivity: float
    """Largest |S| of the lines: 1 over it is how near the loop comes to -1."""
    largest_at_hz: float


def measured_margins(frequency_hz: Array, loop: ComplexArray) -> MeasuredMargins:
    """Return the margins of an open loop.

    Parameters
    ----------
    frequency_hz
        (n,) rising frequencies [Hz].
    loop
        (n,) the open loop at them.
    """
    log_hz, log_size = np.log(frequency_hz), np.log(np.abs(loop))
    angle = np.unwrap(np.angle(loop))
    crossings = [
        (math.exp(_between(log_hz, k, share)), math.degrees(_between(angle, k, share)))
        for k, share in zip(*sign_changes(log_size), strict=True)
    ]
    margins = [(hz, (degrees + 360.0) % 360.0 - 180.0) for hz, degrees in crossings]
    crossover, phase = min(margins, key=lambda pair: abs(pair[1]), default=(None, None))
    crossed = zip(*sign_changes(loop.imag), strict=True)
    real = [_between(loop.real, k, share) for k, share in crossed]
    inside = [-1.0 / r for r in real if -1.0 < r < 0.0]
    sensitivity = np.abs(1.0 / (1.0 + loop))
    worst = int(np.argmax(sensitivity))
    return MeasuredMargins(
        crossover_hz=crossover,
        phase_margin_deg=phase,
        gain_margin=min(inside, default=None),
        largest_sensitivity=float(sensitivity[worst]),
        largest_at_hz=float(frequency_hz[worst]),
    )


def _between(values: Array, k: np.intp, share: float) -> float:
    return float(values[k] + share * (values[k + 1] - values[k]))
