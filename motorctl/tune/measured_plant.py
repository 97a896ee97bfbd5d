"""The plant of a measured response, and how far each frequency of it is known.

At coherent lines it is what was measured, between them the fitted plant that is bent to them, and
beyond them the fitted plant alone. Everywhere it has a relative error, which margins bear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.config.analysis import DelayedPlant
from motorctl.errors import UsageError
from motorctl.response.measurement import Measurement

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LINE_ERRORS = 2.0
"""Standard errors of a measured line that margins bear. Convention: 95 %."""
DB = 20.0 / math.log(10.0)
"""Decibels of a relative error, where that is small."""
AROUND, POINTS_AROUND = 1.3, 240
"""Frequencies besides, from so many times below to as many above each part that rings, and how
many. Wider or more takes time, fewer step over a sharp resonance."""


@dataclass(frozen=True)
class MeasuredPlant:
    """An axis' plant as it was measured."""

    source: str
    period_s: float
    """Of the axis [s]."""
    measured: Measurement

    @property
    def band_hz(self) -> tuple[float, float]:
        """The first and the last coherent line [Hz]."""
        hz = self.measured.response.frequency_hz[self.measured.response.coherent]
        return float(hz[0]), float(hz[-1])

    @property
    def rigid(self) -> DelayedPlant:
        """The fitted plant without its parts that ring."""
        fitted = self.measured.fitted
        balance = (fitted.theta1, fitted.theta2, 0.0)
        return DelayedPlant(balance, self.period_s, fitted.delay_s, fitted.lag_s)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names and frequencies of what rings."""
        return tuple(
            f"{part.effect.name} at {part.resonance_hz:.4g} Hz"
            for part in self.measured.fitted.parts
        )

    def response(self, w: Array) -> ComplexArray:
        """Return the transfer from command to position [m/V] at frequencies w [rad/s], (n,)."""
        response, good = self.measured.response, self.measured.response.coherent
        hz, lines = w / (2.0 * np.pi), response.frequency_hz[good]
        fitted = self.measured.fitted
        bend = np.log(response.plant[good] / fitted.response(lines, self.period_s))
        parts = [np.interp(hz, lines, x, left=0.0, right=0.0) for x in (bend.real, bend.imag)]
        result: ComplexArray = fitted.response(hz, self.period_s) * np.exp(parts[0] + 1j * parts[1])
        return result

    def error(self, w: Array) -> Array:
        """Return the relative error that margins bear at frequencies w [rad/s], (n,).

        Beyond the coherent lines it is that of the worst of them, or what the fitted plant leaves
        of them, whichever is more.
        """
        response, good = self.measured.response, self.measured.response.coherent
        lines, errors = response.frequency_hz[good], response.plant_error[good]
        beyond = max(float(errors.max()), self.measured.fitted.error_db / DB)
        known = np.interp(w / (2.0 * np.pi), lines, errors, left=beyond, right=beyond)
        return LINE_ERRORS * np.asarray(known)

    def frequencies(self, w: Array) -> Array:
        """Return frequencies [rad/s] with those around every part that rings besides."""
        more = [w]
        for part in self.measured.fitted.parts:
            for line_hz in (part.resonance_hz, *part.effect.lines):
                around = np.geomspace(line_hz / AROUND, line_hz * AROUND, POINTS_AROUND)
                more.append(2.0 * np.pi * around)
        every = np.unique(np.concatenate(more))
        inside: Array = every[(every >= w[0]) & (every <= w[-1])]
        return inside


def measured_plant(measured: Measurement, axis: str, period_s: float) -> MeasuredPlant:
    """Return the plant of a measured response.

    Parameters
    ----------
    measured
        The response.
    axis, period_s
        The axis that is tuned, and its period [s].

    Raises
    ------
    UsageError
        Where the response is of another axis, or was measured at another rate.
    """
    response = measured.response
    if response.axis != axis:
        raise UsageError(f"{response.source}: the response of axis {response.axis}, not of {axis}")
    if abs(response.period_s - period_s) > 1e-9 * period_s:
        raise UsageError(
            f"{response.source}: measured at {1.0 / response.period_s:g} Hz, and axis {axis} runs "
            f"at {1.0 / period_s:g} Hz: measure it with this configuration"
        )
    return MeasuredPlant(response.source, period_s, measured)
