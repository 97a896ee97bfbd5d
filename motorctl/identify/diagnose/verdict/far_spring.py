"""A spring between the motor and the encoder: above its resonance the encoder stands still.

There the acceleration is that of the command behind a low-pass of second order, of which no sum of
inertia, friction and forces of the place knows. Well below it the two move together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from motorctl.identify.columns.signals import Signals
from motorctl.model.grids import log_grid

Array = NDArray[np.float64]

DAMPING = (0.02, 0.06, 0.2)
"""Damping ratios that are tried. More take time, fewer miss resonances between them. Chosen by
hand: each is three times the one before."""
PER_DECADE = 60
"""Frequencies a decade. More take time, fewer miss sharp resonances: neighbours are 4 % apart, as
wide as a resonance of the smallest damping. Chosen by hand."""
CYCLES = 10.0
"""Least number of its periods in the recording. Larger misses slow resonances of short recordings,
smaller finds them in drift. Chosen by hand."""
TOGETHER = 0.5
"""Part of the resonance up to which motor and encoder move together: the spring gives way there by
a third. Larger counts its give as another effect, smaller leaves less motion to judge. Chosen by
hand."""
EXPLAINS = 0.5
"""Part of the squared acceleration that the command must explain behind a resonance. Larger misses
it beside much else, smaller finds it in motion that something else drives. Chosen by hand: real
loads on springs have 0.7 to 0.97, joints that others drive up to 0.2."""


@dataclass(frozen=True)
class FarSpring:
    """The resonance behind which the command drives the position."""

    frequency_hz: float
    explains: float
    """Part of the squared acceleration."""
    without: float
    """The same of the command itself."""

    @property
    def together_hz(self) -> float:
        """Band in which motor and encoder move together [Hz]."""
        return TOGETHER * self.frequency_hz

    def told(self) -> str:
        """Return a note that tells of it."""
        return (
            f"the command drives this position through a spring: behind a resonance of "
            f"{self.frequency_hz:.3g} Hz it explains {100.0 * self.explains:.0f} % of the "
            f"acceleration, by itself {100.0 * max(self.without, 0.0):.0f} %. The encoder is on "
            f"the far side of it: all is judged below {self.together_hz:.3g} Hz, where the two "
            "sides move together. Record the motor's own position to have more"
        )


def far_spring(plain: Signals) -> FarSpring | None:
    """Return the resonance through which a command drives the position, None where there is none.

    Parameters
    ----------
    plain
        The signals in the band in which motion outweighs the encoder's noise.
    """
    duration_s = sum(len(s.x) for s in plain.stretches) * plain.period_s
    low = CYCLES / duration_s
    high = min(plain.band_hz, 0.4 / plain.period_s)
    if not low < high:
        return None
    d = plain.decimation
    beside = plain.filtered(
        [np.stack([s.v[::d], np.ones(len(s.v[::d]))]) for s in plain.stretches], d
    )
    basis = np.linalg.qr(beside.T)[0]
    left = plain.acceleration()
    total = float(left @ left)
    of_basis = basis.T @ left
    left = left - basis @ of_basis
    already = 1.0 - float(left @ left) / total

    def explained(commands: list[Array]) -> Array:
        rows = plain.filtered(commands)
        rows = rows - (rows @ basis) @ basis.T
        power = np.maximum(np.sum(rows**2, axis=1), 1e-300)
        return np.asarray(already + (rows @ left) ** 2 / power / total)

    without = float(explained([s.command[None] for s in plain.stretches])[0])
    frequencies = log_grid(low, high, PER_DECADE)
    best, at = -math.inf, 0
    for zeta in DAMPING:
        behind = [
            np.stack([_behind(s.command, f, zeta, plain.period_s) for f in frequencies])
            for s in plain.stretches
        ]
        shares = explained(behind)
        if shares.max() > best:
            best, at = float(shares.max()), int(np.argmax(shares))
    inside = 0 < at < len(frequencies) - 1
    if not inside or best < EXPLAINS or without > 1.0 - EXPLAINS:
        return None
    return FarSpring(float(frequencies[at]), best, without)


def _behind(command: Array, frequency_hz: float, zeta: float, period_s: float) -> Array:
    """Return what a spring gives on of a command that is held between samples."""
    omega = 2.0 * math.pi * frequency_hz
    system = (np.array([omega**2]), np.array([1.0, 2.0 * zeta * omega, omega**2]))
    b, a, _ = cont2discrete(system, period_s, method="zoh")
    return np.asarray(lfilter(np.ravel(b), a, command))
