"""Nonparametric rivals: smooth functions of what was measured, which assume no physics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import AT_ONCE, CommandPath, later
from motorctl.identify.columns.kept_spectra import Spectra
from motorctl.identify.columns.signals import Signals
from motorctl.identify.columns.stretches import Stretch

Array = NDArray[np.float64]

POSITION_KNOTS = 40
"""Knots over the travel. More takes up noise and short waves, fewer misses structure over position.
Chosen by hand."""
VELOCITY_KNOTS = 12
"""Knots on each side of zero velocity. More takes up noise, fewer misses friction's shape. Chosen
by hand."""
SPEED_RANGE = 300.0
"""Top speed over the speed below which velocities are not told apart. Larger puts knots into noise,
smaller blurs friction near rest. Chosen by hand."""
TIME_KNOT_S = 2.0
"""Time between knots [s]. Larger misses slow changes, smaller takes up forces of single moves.
Chosen by hand."""
MOST_TIME_KNOTS = 100
"""And the most of them. More takes memory (their number is squared for each block), fewer misses
changes within long recordings. Chosen by hand."""
COMMAND_KNOTS = 10
"""Knots on each side of zero command. More takes up noise, fewer misses the drive's curve. Chosen
by hand."""
TENSOR_KNOTS = 9
"""Knots of each of two variables together. More is slow and takes up noise (their number is
squared), fewer misses structure. Chosen by hand."""
HISTORY_S = 0.04
"""How long the command's past may matter [s]: modes ring longer, but their rise shows. Larger takes
time and noise, smaller misses slow lags. Chosen by hand."""
VARIABLES: Mapping[str, tuple[str, ...]] = {
    "position": ("position",),
    "velocity": ("velocity",),
    "time": ("time",),
    "command": ("command",),
    "position_and_velocity": ("position", "velocity"),
    "position_and_direction": ("position", "velocity"),
    "position_and_command": ("position", "command"),
    "history": ("history",),
}
"""What each rival depends on."""


def hats(x: Array, knots: Array) -> Array:
    """Return the piecewise linear functions that are one at a knot, (knots, N)."""
    place = np.clip(np.interp(x, knots, np.arange(len(knots))), 0, len(knots) - 1)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place - np.arange(len(knots))[:, None])))


class SmoothFunctions:
    """The rivals' columns over one signals."""

    def __init__(self, signals: Signals) -> None:
        self.signals = signals
        d = signals.decimation
        self._x = np.concatenate([s.x[::d] for s in signals.stretches])
        self._v = np.concatenate([s.v[::d] for s in signals.stretches])
        top = float(np.percentile(np.abs(self._v), 99.9))
        side = np.geomspace(top / SPEED_RANGE, top, VELOCITY_KNOTS)
        self._speeds = np.concatenate([-side[::-1], [0.0], side])

    def columns(self, name: str) -> Array:
        """Return the filtered columns of a rival, (p, m)."""
        return self.signals.kept_rows(("smooth", name), lambda: self._formed(name))

    def columns_apart(self, names: Sequence[str], undo: CommandPath = AT_ONCE) -> Iterator[Array]:
        """Yield the columns of some rivals together, (p, m_k), one stretch after the other.

        Those of a long recording take gigabytes at once; none are kept.
        """
        stretches, d = self.signals.stretches, self.signals.decimation
        over = (np.vstack([self._of(name, s, d) for name in names]) for s in stretches)
        return self.signals.filtered_apart(over, d, undo)

    def powers_of_position(self, count: int) -> Array:
        """Return the filtered powers 1 to count of the position, (count, m).

        Of the position within the travel, -1 to 1, so that no power is out of all measure.
        """
        low, high = float(self._x.min()), float(self._x.max())
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        stretches, d = self.signals.stretches, self.signals.decimation
        exponents = np.arange(1, count + 1)[:, None]

        def form() -> Spectra:
            return self.signals.spectra(
                [((s.x[::d] - middle) / half) ** exponents for s in stretches], d
            )

        return self.signals.kept_rows(("powers", count), form)

    def _formed(self, name: str) -> Spectra:
        stretches, d = self.signals.stretches, self.signals.decimation
        if name == "history":
            shifts = self._shifts()
            return self.signals.spectra(
                [np.stack([later(s.command, shift) for shift in shifts]) for s in stretches]
            )
        return self.signals.spectra([self._of(name, s, d) for s in stretches], d)

    def _shifts(self) -> list[int]:
        """Return delays [samples] from one sample to about a twentieth of a second."""
        last = HISTORY_S / self.signals.period_s
        first = np.arange(1, min(6, int(last) + 2))
        rest = np.arange(6.0, last, max(1.0, 0.35 / self.signals.band_hz / self.signals.period_s))
        return [int(k) for k in np.unique(np.concatenate([first, rest]).astype(int))]

    def _of(self, name: str, s: Stretch, d: int) -> Array:
        x, v, t = s.x[::d], s.v[::d], s.time_s[::d]
        u = _mean_between(s.command, d)
        low, high = float(self._x.min()), float(self._x.max())
        coarse = np.linspace(low, high, TENSOR_KNOTS)
        if name == "position":
            return hats(x, np.linspace(low, high, POSITION_KNOTS))
        if name == "velocity":
            return hats(v, self._speeds)
        if name == "time":
            first, last = self.signals.stretches[0].time_s[0], self.signals.stretches[-1].time_s[-1]
            count = min(max(4, round((last - first) / TIME_KNOT_S)), MOST_TIME_KNOTS)
            return hats(t, np.linspace(first, last, count))
        if name == "command":
            top = self.signals.largest_command
            return hats(u, np.linspace(-top, top, 2 * COMMAND_KNOTS))
        if name == "position_and_direction":
            return np.asarray(hats(x, np.linspace(low, high, 24)) * np.tanh(v / self._speeds[-8]))
        if name == "position_and_command":
            return hats(x, np.linspace(low, high, POSITION_KNOTS)) * u
        speeds = self._speeds[::3]
        both = hats(x, coarse)[:, None, :] * hats(v, speeds)[None]
        return np.asarray(both.reshape(-1, len(x)))


def _mean_between(command: Array, d: int) -> Array:
    """Average the command around each d-th sample."""
    kernel = np.ones(d) / d
    return np.convolve(np.pad(command, (d // 2, d - 1 - d // 2), mode="edge"), kernel, "valid")[::d]
