"""What the declared model leaves of the command in windows of logs, and what waves explain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import CommandPath
from motorctl.identify.columns.filters import acceleration_of, velocity_of
from motorctl.identify.columns.measured import Measured
from motorctl.identify.fit.regression_data import RegressionData
from motorctl.identify.fit.result import AxisFit
from motorctl.model import Effect

Array = NDArray[np.float64]

PADDED = 4
"""Lines of the spectrum for each that the way tells apart. More takes time, fewer misses what lies
between two. Chosen by hand."""
ORDERS = (1, 2)
"""Of each wave, as encoders and magnets show them. More takes up chance, fewer leaves a part of a
short push. Chosen by hand."""
MOVING = 0.03
"""Part of the top speed from which on a row moves. Larger leaves out slow motion, smaller takes
what noise does to a rest for motion. Chosen by hand."""


class Leftovers:
    """What the declared model leaves of the command in some windows.

    Parameters
    ----------
    fits
        Of each window; what is needed no more is let go with it.
    """

    def __init__(self, fits: Iterator[AxisFit]) -> None:
        self._rows: list[RegressionData] = []
        self._delays_s: list[float] = []
        self._left: list[Array] = []
        self._declared: list[Array] = []
        motion: list[tuple[Array, Array]] = []
        for fit in fits:
            psi, command = fit.columns.at(fit.delay_s)
            size = np.linalg.norm(psi, axis=0)
            basis = np.linalg.qr(psi / np.where(size > 0.0, size, 1.0))[0]
            rows = replace(fit.columns, _held={}, _rows={})
            self._rows.append(rows)
            self._delays_s.append(fit.delay_s)
            self._declared.append(basis)
            self._left.append(command - basis @ (basis.T @ command))
            motion.append(_motion(rows))
        self.position, self.speed = map(np.concatenate, zip(*motion, strict=True))
        """At the rows, (m,) each; the speed has no sign."""
        self.speed = np.abs(self.speed)
        self.left = np.concatenate(self._left)
        """(m,) in the command's unit."""
        self.mean_square = float(self.left @ self.left) / len(self.left)

    @property
    def data(self) -> Measured:
        """What was measured in the first window."""
        return self._rows[0].data

    @property
    def band_hz(self) -> float:
        """Up to where the fits look."""
        return self._rows[0].options.filter_hz or 0.0

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """In which rows the axis moves, (m,)."""
        return self.speed > MOVING * float(np.max(self.speed))

    @property
    def way(self) -> float:
        """From one end of the motion to the other."""
        return float(np.ptp(self.position))

    def spectrum(self, origin: float, step: float, places: int) -> NDArray[np.complex128]:
        """Return waves along the way in what is left, by line, with their phase at the origin."""
        at = ((self.position - origin) / step).astype(np.int64)
        inside = (at >= 0) & (at < places)
        sums = np.bincount(at[inside], self.left[inside], places)
        return np.asarray(np.fft.rfft(sums, PADDED * places) / len(self.left))

    def gain(self, cls: type[Effect], line: float) -> float:
        """Return by how much a wave lowers the mean square of what is left."""
        gram, cross = self._equations(self._beside_declared(cls, line))
        return float(_solved(gram, cross) @ cross) / len(self.left)

    def explained(self, cls: type[Effect], line: float) -> Array:
        """Return what a wave explains of what is left, (m,): one wave at every speed."""
        columns = list(self._beside_declared(cls, line))
        found = _solved(*self._equations(iter(columns)))
        return np.concatenate([each @ found for each in columns])

    def _equations(self, columns: Iterator[Array]) -> tuple[Array, Array]:
        gram: Array | float = 0.0
        cross: Array | float = 0.0
        for each, left in zip(columns, self._left, strict=True):
            gram = each.T @ each + gram
            cross = each.T @ left + cross
        return np.asarray(gram), np.asarray(cross)

    def _beside_declared(self, cls: type[Effect], line: float) -> Iterator[Array]:
        """Yield the columns of a wave in each window, (m, p), without what the model can be."""
        parts = zip(self._rows, self._delays_s, self._declared, strict=True)
        for rows, delay_s, basis in parts:
            columns = np.concatenate(list(_columns(rows, delay_s, cls, line))).T
            yield columns - basis @ (basis.T @ columns)


def _solved(gram: Array, cross: Array) -> Array:
    size = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    found = np.linalg.lstsq(gram / np.outer(size, size), cross / size, rcond=1e-9)[0]
    return np.asarray(found / size)


def _motion(rows: RegressionData) -> tuple[Array, Array]:
    """Return position and velocity at the rows, (m,) each."""
    begin, end = rows.options.discard_start or 0, rows.options.discard_end or 0
    own = [np.column_stack([s.x, s.v])[begin : len(s.x) - end] for s in rows.stretches]
    place, speed = rows.rows_of(own)
    return place, speed


def _columns(
    rows: RegressionData, delay_s: float, cls: type[Effect], line: float
) -> Iterator[Array]:
    """Yield the columns of a wave and its orders, (p, m), as what they add to the command."""
    fresh = rows.with_stretches(rows.stretches)  # it keeps what it forms: of a line tried, for once
    for order in ORDERS:
        effect = cls.at_line(order * line)
        if effect.kind == "input":
            yield fresh.input(effect, CommandPath(delay_s))
        elif effect.kind == "measurement":
            yield fresh.rows_of(fresh.formed(each) for each in _shown(fresh, effect))
            return  # it has its orders itself
        else:
            yield fresh.state(effect)


def _shown(rows: RegressionData, effect: Effect) -> Iterator[Array]:
    """Yield the acceleration that an error of the measured position seems to be, (p, N)."""
    period_s, how = rows.period_s, rows.options.derivative
    for stretch in rows.stretches:
        shown = stretch.columns(effect)
        yield np.stack([acceleration_of(e, velocity_of(e, period_s), period_s, how) for e in shown])
