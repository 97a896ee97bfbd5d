"""A spring that hides what a command does from every sum of inertia, friction and forces of place.

Between the motor and the encoder: above its resonance the encoder stands still, and the
acceleration is that of the command behind a low-pass of second order. Well below it the two move
together. Behind the encoder, with a load that outweighs the motor: below the resonance the load
holds the motor back, so that the acceleration is that of the command less a part of it behind the
low-pass. Between the antiresonance and the resonance the motor moves against the command.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

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
    tried = _tried(plain)
    if tried is None:
        return None
    without = tried.explained(tried.command[None])[0]
    best, at = -math.inf, 0
    for behind in tried.behind():
        shares = tried.explained(behind)
        if shares.max() > best:
            best, at = float(shares.max()), int(np.argmax(shares))
    inside = 0 < at < len(tried.frequencies_hz) - 1
    if not inside or best < EXPLAINS or without > 1.0 - EXPLAINS:
        return None
    return FarSpring(float(tried.frequencies_hz[at]), best, float(without))


def load_on_spring(plain: Signals) -> bool:
    """Return whether a command drives this position, and a load on a spring hides that.

    Both masses must come out positive, and the resonance within what is tried. No more is told: the
    search finds such a load by itself.

    Parameters
    ----------
    plain
        As of `far_spring`.
    """
    tried = _tried(plain)
    if tried is None:
        return False
    best, found = EXPLAINS, False
    last = len(tried.frequencies_hz) - 1
    for behind in tried.behind():
        shares, of_command, of_behind = tried.explained_beside(behind)
        at = int(np.argmax(shares))
        if shares[at] < best:
            continue
        best = float(shares[at])
        motor, both = of_command[at], of_command[at] + of_behind[at]  # 1 / inertia
        found = 0 < at < last and 0.0 < both < motor
    return found


@dataclass(frozen=True)
class _Tried:
    """What resonances are tried on: rows beside the velocity and a constant."""

    signals: Signals
    frequencies_hz: Array
    basis: Array
    left: Array
    already: float
    total: float

    @cached_property
    def command(self) -> Array:
        """The command in rows."""
        return np.asarray(self.beside([s.command[None] for s in self.signals.stretches])[0])

    def beside(self, commands: list[Array]) -> Array:
        """Return commands in rows, beside the basis."""
        rows = self.signals.filtered(commands)
        return np.asarray(rows - (rows @ self.basis) @ self.basis.T)

    def behind(self) -> Iterator[Array]:
        """Yield the command behind resonances of each damping, (frequencies, rows)."""
        s = self.signals
        for zeta in DAMPING:
            behind = [
                np.stack([_behind(p.command, f, zeta, s.period_s) for f in self.frequencies_hz])
                for p in s.stretches
            ]
            yield self.beside(behind)

    def explained(self, rows: Array) -> Array:
        """Return what each row explains of the squared acceleration."""
        power = np.maximum(np.sum(rows**2, axis=1), 1e-300)
        return np.asarray(self.already + (rows @ self.left) ** 2 / power / self.total)

    def explained_beside(self, rows: Array) -> tuple[Array, Array, Array]:
        """Return the same of each row beside the command, and both factors."""
        u = self.command
        aa, bb, ab = u @ u, np.sum(rows**2, axis=1), rows @ u
        a, b = u @ self.left, rows @ self.left
        whole = np.maximum(aa * bb - ab**2, 1e-300)
        of_command, of_row = (bb * a - ab * b) / whole, (aa * b - ab * a) / whole
        shares = np.asarray(self.already + (of_command * a + of_row * b) / self.total)
        return shares, of_command, of_row


def _tried(plain: Signals) -> _Tried | None:
    """Return what resonances are tried on; None where the recording is too short for any."""
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
    left = left - basis @ (basis.T @ left)
    already = 1.0 - float(left @ left) / total
    frequencies_hz = np.array(log_grid(low, high, PER_DECADE))
    return _Tried(plain, frequencies_hz, basis, left, already, total)


def _behind(command: Array, frequency_hz: float, zeta: float, period_s: float) -> Array:
    """Return what a spring gives on of a command that is held between samples."""
    omega = 2.0 * math.pi * frequency_hz
    system = (np.array([omega**2]), np.array([1.0, 2.0 * zeta * omega, omega**2]))
    b, a, _ = cont2discrete(system, period_s, method="zoh")
    return np.asarray(lfilter(np.ravel(b), a, command))
