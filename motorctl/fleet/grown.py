"""What grew where a fit leaves more than before: a wave along the way, by logs before and after.

A log alone may not tell it: what the model always lacked can be larger, and a second wave of a kind
that the model has already is none that a diagnosis tries. Between two times of one machine under
one program all of that is the same, and what is left is the change.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError, MotorctlError
from motorctl.fleet.changes import Alarm
from motorctl.fleet.findings import RESIDUAL
from motorctl.fleet.head import Declared, identity_of
from motorctl.fleet.paths import opened
from motorctl.fleet.series import Seen
from motorctl.identify.columns.command_timing import CommandPath
from motorctl.identify.columns.filters import acceleration_of, velocity_of
from motorctl.identify.columns.measured import SIGNALS, with_others
from motorctl.identify.fit.declared_models import declared_models
from motorctl.identify.fit.recording import fit_axis
from motorctl.identify.fit.result import AxisFit
from motorctl.identify.fit.settings import FitOptions
from motorctl.log.parquet_pieces import ParquetPieces
from motorctl.log.read import recording_of
from motorctl.log.row_groups import RowGroupTable
from motorctl.long_logs.footer import times_of
from motorctl.model import Effect, known_effects

Array = NDArray[np.float64]

LOGS = 3
"""Logs that are read before the change, and after it. More tells smaller changes and takes time,
fewer leaves more to chance. Chosen by hand: a day's, of three a day."""
ALONG_THE_WAY = frozenset({"wave_over_position", "wave_of_measurement"})
"""Groups of the effects that are tried."""
FEWEST_WAVES = 3.5
"""Waves over the way, at least. Fewer takes slow curves for waves, more misses long ones. Chosen by
hand, as for the waves that a diagnosis seeks."""
SLOW_PERCENTILE = 10.0
"""Of the speeds: what at that speed is beyond the fit's band is not sought. Larger looks for fewer
short waves, smaller for ones of which hardly a row tells. Chosen by hand."""
PLACES_A_WAVE = 8
"""Places that a wave is told by at least, where the residual is sorted by place. More takes time,
fewer blurs short waves. Chosen by hand: of eight, the strongest is told to 97 %."""
PADDED = 4
"""Lines of the spectrum for each that the way tells apart. More takes time, fewer misses what lies
between two. Chosen by hand."""
STANDS_OUT = 15.0
"""Times the spectrum's median that a line must have grown by. Larger misses small changes, smaller
tries lines of chance, which do not explain what grew. Arithmetic: of a thousand lines of noise the
strongest is ten medians."""
LINES = 3
"""Lines that are tried. More takes time, fewer misses a change whose second order is its strongest.
Chosen by hand."""
ORDERS = (1, 2)
"""Of each wave, as encoders and magnets show them. More takes up chance, fewer leaves a part of a
short push. Chosen by hand."""
PASSES, STEPS = 2, 9
"""Refinements of a line, and wave numbers tried in each. More takes time, fewer leaves the pitch
vague. Chosen by hand."""
BEYOND_CHANCE = 0.06
"""Share of all that the fit leaves which a wave must take away to be named. Larger misses small
changes, smaller takes chance for a wave. Chosen on simulated machines: in what three logs of four
seconds leave, without a wave, the best one takes away 3 %."""
MOST_OF_IT = 0.5
"""Share of the growth that a wave must explain to be named. Larger keeps silent of waves that are
no plain ones, smaller names what is the lesser part. Convention: the greater part."""


@dataclass(frozen=True)
class Grown:
    """A wave along the way that was not there before, or smaller."""

    name: str
    """Of the effect."""
    pitch: float
    """What it repeats after, in the position's unit."""
    position_unit: str
    explained: float
    """The share of what the fit leaves more that it explains."""
    before_rms: float
    """What it adds to the command in the fitted band, in the command's unit."""
    after_rms: float
    command_unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return it as it stands in ``fleet changes --json``."""
        return {**asdict(self), "sentence": self.sentence}

    @property
    def sentence(self) -> str:
        """Say what grew."""
        unit = self.command_unit
        return (
            f"{self.name} that repeats every {self.pitch:.4g} {self.position_unit}: "
            f"{self.after_rms:.2g} {unit} rms in the fitted band, {self.before_rms:.2g} {unit} "
            f"before; it explains {100.0 * self.explained:.0f} % of what the fit leaves more"
        )


def what_grew(
    before: Sequence[Seen], after: Sequence[Seen], axis: str, declared: Declared | None = None
) -> Grown | None:
    """Hold what a fit leaves in windows of logs after a change to what it left before.

    Parameters
    ----------
    before, after
        Windows of one axis of one machine, under one program.
    axis
        Its name.
    declared
        Which model is meant; None: what each log declares.

    Returns
    -------
    Grown or None
        None where what is left did not grow, or no wave along the way explains most of it.

    Raises
    ------
    DataError
        Where a log is not where it was, or tells nothing.
    """
    declared = declared or Declared()
    first = _fitted(before[0], axis, declared)
    alike = FitOptions(filter_hz=first.options.filter_hz)  # in one band
    earlier = _Leftovers([first, *(_fitted(seen, axis, declared, alike) for seen in before[1:])])
    later = _Leftovers([_fitted(seen, axis, declared, alike) for seen in after])
    growth = later.mean_square - earlier.mean_square
    if growth <= 0.0:
        return None
    classes = [cls for cls in known_effects().values() if cls.groups & ALONG_THE_WAY]
    best: tuple[float, type[Effect], float] | None = None
    for line in _grown_lines(earlier, later):
        cls = max(classes, key=lambda each: later.gain(each, line))
        gain, refined = _refined(later, cls, line)
        if best is None or gain > best[0]:
            best = gain, cls, refined
    if best is None or best[0] < BEYOND_CHANCE * later.mean_square:
        return None
    gain, cls, line = best
    was = earlier.gain(cls, line)
    explained = (gain - was) / growth
    if explained < MOST_OF_IT:
        return None
    data = later.fits[0].data
    return Grown(
        name=cls.name,
        pitch=1.0 / line,
        position_unit=data.position_unit,
        explained=min(explained, 1.0),
        before_rms=math.sqrt(was),
        after_rms=math.sqrt(gain),
        command_unit=data.command_unit,
    )


def named(alarm: Alarm) -> Grown | str | None:
    """Return what grew where an alarm is of what the fit leaves, or why that is not told.

    None of alarms that have a parameter's name.
    """
    if alarm.series.name != RESIDUAL:
        return None
    if alarm.change.after.value <= alarm.change.before.value:
        return "the model tells more than before"
    try:
        found = what_grew(*alarm.around(LOGS), alarm.series.axis)
    except MotorctlError as error:
        return f"not named: {error}"
    except OSError as error:
        return f"not named: {alarm.log}: {error}"
    return found or f"no wave along the way explains it; look at it: motorctl diagnose {alarm.log}"


class _Leftovers:
    """What the declared model leaves of the command in some windows.

    Parameters
    ----------
    fits
        Of each window.
    """

    def __init__(self, fits: Sequence[AxisFit]) -> None:
        self.fits = list(fits)
        self.left: list[Array] = []
        self._declared: list[Array] = []
        for fit in fits:
            psi, command = fit.columns.at(fit.delay_s)
            size = np.linalg.norm(psi, axis=0)
            basis = np.linalg.qr(psi / np.where(size > 0.0, size, 1.0))[0]
            self._declared.append(basis)
            self.left.append(command - basis @ (basis.T @ command))
        self.rows = sum(map(len, self.left))
        self.mean_square = sum(float(left @ left) for left in self.left) / self.rows

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """Position and velocity at the rows, (m,) each."""
        x, v = [], []
        for fit in self.fits:
            options = fit.columns.options
            begin, end = options.discard_start or 0, options.discard_end or 0
            own = [
                np.column_stack([s.x, s.v])[begin : len(s.x) - end] for s in fit.columns.stretches
            ]
            place, speed = fit.columns.rows_of(own)
            x.append(place)
            v.append(speed)
        return np.concatenate(x), np.concatenate(v)

    def spectrum(self, origin: float, step: float, places: int) -> NDArray[np.complex128]:
        """Return waves along the way in what is left, by line, with their phase at the origin."""
        at = ((self.motion[0] - origin) / step).astype(np.int64)
        inside = (at >= 0) & (at < places)
        sums = np.bincount(at[inside], np.concatenate(self.left)[inside], places)
        return np.asarray(np.fft.rfft(sums, PADDED * places) / self.rows)

    def gain(self, cls: type[Effect], line: float) -> float:
        """Return by how much a wave lowers the mean square of what is left."""
        gram = np.zeros((0, 0))
        cross = np.zeros(0)
        for fit, basis, left in zip(self.fits, self._declared, self.left, strict=True):
            columns = np.concatenate(list(_columns(fit, cls, line))).T
            columns -= basis @ (basis.T @ columns)
            gram = columns.T @ columns + (gram if gram.size else 0.0)
            cross = columns.T @ left + (cross if cross.size else 0.0)
        size = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
        found = np.linalg.lstsq(gram / np.outer(size, size), cross / size, rcond=1e-9)[0]
        return float(found @ (cross / size)) / self.rows


def _columns(fit: AxisFit, cls: type[Effect], line: float) -> Iterator[Array]:
    """Yield the columns of a wave and its orders, (p, m), as what they add to the command."""
    rows = fit.columns
    for order in ORDERS:
        effect = cls.at_line(order * line)
        if effect.kind == "input":
            yield rows.input(effect, CommandPath(fit.delay_s))
        elif effect.kind == "measurement":
            yield rows.rows_of(rows.formed(each) for each in _shown(fit, effect))
            return  # it has its orders itself
        else:
            yield rows.state(effect)


def _shown(fit: AxisFit, effect: Effect) -> Iterator[Array]:
    """Yield the acceleration that an error of the measured position seems to be, (p, N)."""
    period_s, how = fit.data.period_s, fit.columns.options.derivative
    for stretch in fit.columns.stretches:
        shown = stretch.columns(effect)
        yield np.stack([acceleration_of(e, velocity_of(e, period_s), period_s, how) for e in shown])


def _grown_lines(earlier: _Leftovers, later: _Leftovers) -> list[float]:
    """Return the wave numbers [1/m] of what grew most along the way."""
    x, v = later.motion
    band_hz = later.fits[0].options.filter_hz or 0.0
    slow = float(np.percentile(np.abs(v), SLOW_PERCENTILE))
    way = float(np.ptp(x))
    if slow <= 0.0 or way <= 0.0:
        return []
    most = band_hz / slow
    places = math.ceil(PLACES_A_WAVE * most * way)
    step = way / places
    origin = float(np.min(x))
    # what was there before has the same phase: it goes
    now, then = (each.spectrum(origin, step, places) for each in (later, earlier))
    grown = np.abs(now - then) ** 2
    lines = np.arange(len(grown)) / (PADDED * places * step)
    inside = (lines >= FEWEST_WAVES / way) & (lines <= most)
    if not inside.any():
        return []
    floor = STANDS_OUT * float(np.median(grown[inside]))
    found: list[float] = []
    for k in np.argsort(-np.where(inside, grown, -np.inf)):
        if grown[k] < floor or len(found) == LINES or not inside[k]:
            break
        if all(abs(lines[k] - line) > 1.0 / way for line in found):
            found.append(float(lines[k]))
    return found


def _refined(later: _Leftovers, cls: type[Effect], line: float) -> tuple[float, float]:
    """Return what a wave near a line takes away at best, and its wave number."""
    reach = 0.5 / float(np.ptp(later.motion[0]))
    best = later.gain(cls, line), line
    for _ in range(PASSES):
        tried = best[1] + reach * np.linspace(-1.0, 1.0, STEPS)
        best = max(best, *((later.gain(cls, float(k)), float(k)) for k in tried if k > 0.0))
        reach *= 2.0 / (STEPS - 1)
    return best


def _fitted(
    seen: Seen, axis: str, declared: Declared, options: FitOptions | None = None
) -> AxisFit:
    """Fit a window of a log again. Raises DataError where it is not there any more."""
    if identity_of(seen.source) != seen.log_id:
        raise DataError(f"{seen.source}: is another log by now than the one that was looked at")
    with opened(seen.source) as file:
        groups = list(range(len(file.group_rows)))
        if seen.begin_s is not None and seen.end_s is not None:
            begins, ends = times_of(seen.source, ParquetPieces(seen.source, file))
            inside = (ends >= seen.begin_s) & (begins <= seen.end_s)
            groups = np.flatnonzero(inside).tolist()
        recording = recording_of(RowGroupTable(seen.source, file, groups), "keep", SIGNALS)
    machine = declared.machine(recording.metadata["config"], seen.source)
    models = declared_models(recording, declared.model, axis, machine=machine)
    return fit_axis(with_others(recording, axis), models[axis], options)
