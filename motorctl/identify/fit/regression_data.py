"""Rows behind recursive filters and decimation, as the literature identifies machines with.

The delay of the command may be sought: columns of the command are kept at the full rate, and are
aligned for each delay that is tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.command_timing import (
    CommandPath,
    Taps,
    hold_taps,
    later,
    sample_taps,
)
from motorctl.identify.columns.filters import (
    acceleration_of,
    decimation_filter,
    low_pass,
    one_way,
    picked,
    settling_samples,
    velocity_of,
    zero_phase,
)
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.position_noise import (
    choose_band_hz,
    choose_decimation,
    choose_velocity_band_hz,
    reference_is_quieter,
    top_speed,
)
from motorctl.identify.columns.rows import Rows
from motorctl.identify.columns.stretches import Stretch
from motorctl.identify.fit.settings import FitOptions, Segment
from motorctl.model import Effect, EffectList
from motorctl.model.columns import form_key
from motorctl.model.sign_function import SlopeOptions, with_slope

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SETTLED = 1e-4
"""What is left of a filter's step response, as a part of one, when rows begin to count. Larger lets
the filter's start bias the fit, smaller drops more rows. Chosen by hand."""
LONGEST_DELAY_S = 5e-3
"""Longest input delay that is sought [s]. Smaller misses slow drives, larger finds delays that are
other effects. Chosen by hand."""
LONGEST_DELAY_SAMPLES = 5
"""At slow sample rates the search reaches at least this many samples. Smaller misses delays of a
few samples, larger takes time. Chosen by hand."""
EARLIEST_SAMPLES = -3
"""Samples by which a recorded command may come too late, as a negative delay. Further from zero
takes time; nearer misses recordings whose columns were latched at different moments. Chosen by
hand."""
REST_SLOPES = 5.0
"""Speeds below this many times the speed 1/slope, at which Sf turns over, count as rest. Larger
throws away slow motion, smaller keeps rows in which static friction is undetermined. Chosen by
hand."""
REST_PART = 0.05
"""Rest is never taken beyond this part of the top speed. Larger throws away slow motion, smaller
keeps rest in recordings of a shallow Sf. Chosen by hand."""
AT_ITS_TICK = sample_taps(0.0)
"""Each sample for itself, as columns of the motion are."""


class TooFewRowsError(DataError):
    """Filters and decimation leave too little of the recording to identify the model from."""


@dataclass(frozen=True)
class RegressionData(Rows[Array]):
    """Rows behind recursive filters and decimation; n parameters of a model."""

    model: EffectList
    options: FitOptions
    """With everything filled in."""
    accelerations: tuple[Array, ...]
    """Of each stretch, (N,)."""
    picks: tuple[Indices, ...]
    """For each stretch, which of its samples are rows, counted from the first settled one."""
    _held: dict[Hashable, list[Array]] = field(default_factory=dict, repr=False)
    """The filtered command and its columns at the full rate, before alignment."""
    _rows: dict[Hashable, Array] = field(default_factory=dict, repr=False)
    """Rows of columns that are asked for again, whatever the delay."""

    @property
    def time_s(self) -> Array:
        """Time of the rows, (m,)."""
        settled = [s.time_s[self._settled(s.time_s)] for s in self.stretches]
        return np.concatenate([t[pick] for t, pick in zip(settled, self.picks, strict=True)])

    @property
    def input_index(self) -> Indices:
        """Which of the n columns depend on the command."""
        kinds = [effect.kind for effect in self.model.effects for _ in effect.parameters]
        return np.flatnonzero(np.array(kinds) == "input")

    @property
    def row_period_s(self) -> float:
        """Time between rows."""
        assert self.options.decimation is not None
        return self.period_s * self.options.decimation

    def at(self, delay_s: float) -> tuple[Array, Array]:
        """Return psi (m, n) and the command (m,) for an input delay [s], positive: acts later."""
        psi, command = self.regression(self.model, CommandPath(delay_s), self.accelerations)
        return psi.T, command

    def rows(self, chosen: NDArray[np.bool_]) -> RegressionData:
        """Return only some of the rows; `chosen` of shape (m,)."""
        ends = np.cumsum([len(pick) for pick in self.picks])[:-1]
        parts = zip(self.picks, np.split(chosen, ends), strict=True)
        formed = {key: rows[:, chosen] for key, rows in self._rows.items()}
        return replace(self, picks=tuple(pick[part] for pick, part in parts), _rows=formed)

    def with_stretches(self, stretches: tuple[Stretch, ...]) -> RegressionData:
        """Return the same rows of other stretches."""
        return replace(self, stretches=stretches, _held={}, _rows={})

    def within(self, segments: tuple[Segment, ...]) -> RegressionData:
        """Return the rows whose time lies in one of the segments, begin included, end not."""
        time = self.time_s + 0.5 * self.period_s
        inside = [(time >= begin) & (time < end) for begin, end in segments]
        return self.rows(np.logical_or.reduce(inside))

    def formed(self, columns: Array, step: int = 1) -> Array:
        """Return columns of one stretch behind the filters, (N', p), where these have settled."""
        assert self.options.decimation is not None
        filtered = columns.T
        if self.options.filter_target == "columns":
            filtered = smoothed_by(self.options, filtered, self.data.sample_rate_hz)
        filtered = filtered[self._settled(filtered)]
        if self.options.decimation_order and self.options.decimation > 1:
            chebyshev = decimation_filter(self.options.decimation_order, self.options.decimation)
            filtered = zero_phase(chebyshev, self.options.decimation_order, filtered)
        return filtered

    def rows_of(self, formed: Iterable[Array], taps: Taps = AT_ITS_TICK) -> Array:
        """Return the rows, (p, m), of filtered columns of every stretch, aligned by taps."""
        parts = []
        for columns, pick in zip(formed, self.picks, strict=True):
            lagging = zip(taps.lags, taps.weights, strict=True)
            parts.append(sum(weight * columns[pick - lag] for lag, weight in lagging))
        return np.concatenate(parts).T

    def state(
        self, effect: Effect, acceleration: Sequence[Array] | None = None, step: int = 1
    ) -> Array:
        """Return the columns of a state effect, (p, m)."""
        return self._once(form_key(effect), lambda: self.over(effect, acceleration, step))

    def input(self, effect: Effect | None, path: CommandPath, *, keep: bool = True) -> Array:
        """Return the columns of an input effect, (p, m), or the command, (1, m)."""
        key = None if effect is None else form_key(effect)
        taps = taps_of(self.options, path.delay_s / self.period_s)
        if effect is None or not effect.varies:
            # alignment is linear, as the filter is: the filtered columns serve for every delay
            if key not in self._held:
                columns = (
                    s.command[None] if effect is None else s.columns(effect) for s in self.stretches
                )
                self._held[key] = [self.formed(each) for each in columns]
            return self.rows_of(self._held[key], taps)

        def behind(lag: int) -> Iterator[Array]:
            for s in self.stretches:
                yield self.formed(s.columns(effect, None, later(s.command, lag)))

        # the command acts late, but at the place where the axis is then
        parts = [
            weight * self._once((key, lag), partial(behind, lag))
            for lag, weight in zip(taps.lags.tolist(), taps.weights, strict=True)
        ]
        return np.asarray(sum(parts))

    def _once(self, key: Hashable, form: Callable[[], Iterable[Array]]) -> Array:
        if key not in self._rows:
            self._rows[key] = self.rows_of(form())
        return self._rows[key]

    def _settled(self, samples: Array) -> slice:
        assert self.options.discard_start is not None
        assert self.options.discard_end is not None
        return slice(self.options.discard_start, len(samples) - self.options.discard_end)


def taps_of(options: FitOptions, delay_samples: float) -> Taps:
    """Return the alignment of the command for an input delay."""
    if not options.hold_alignment:
        return sample_taps(delay_samples)
    return hold_taps(delay_samples, 1 if options.derivative == "second_difference" else 2)


def smoothed_by(options: FitOptions, columns: Array, sample_rate_hz: float) -> Array:
    """Return columns, (N, ...), behind the low pass of these options."""
    assert options.filter_hz is not None
    order = options.filter_order
    sections = low_pass(options.filter_kind, order, options.filter_hz, sample_rate_hz)
    return (
        zero_phase(sections, order, columns) if options.zero_phase else one_way(sections, columns)
    )


def delay_range_s(options: FitOptions, sample_rate_hz: float) -> Segment:
    """Return the delays among which the best is sought."""
    if options.delay_range_s is not None:
        return options.delay_range_s
    longest = max(LONGEST_DELAY_SAMPLES, round(LONGEST_DELAY_S * sample_rate_hz))
    return EARLIEST_SAMPLES / sample_rate_hz, longest / sample_rate_hz


def resolve_options(data: Measured, model: EffectList, options: FitOptions) -> FitOptions:
    """Choose what `options` leave open from the recording; `model` with its final slopes."""
    band = options.filter_hz or choose_band_hz(data)
    nyquist = 0.5 * data.sample_rate_hz
    highest = max(band, options.friction_hz or 0.0)
    if highest >= nyquist:
        raise DataError(
            f"{data.place}: the filter at {highest:g} Hz is not below half the sample rate, "
            f"{nyquist:g} Hz: choose a lower filter_hz or friction_hz"
        )
    decimation = options.decimation or choose_decimation(data.sample_rate_hz, band)
    sections = low_pass(options.filter_kind, options.filter_order, band, data.sample_rate_hz)
    discard = settling_samples(sections, SETTLED)
    if options.decimation_order and decimation > 1:
        chebyshev = decimation_filter(options.decimation_order, decimation)
        discard += settling_samples(chebyshev, SETTLED)
    slopes = [e.options.slope_s_m for e in model.effects if isinstance(e.options, SlopeOptions)]
    steepest = max(slopes, default=0.0)
    friction_hz = options.friction_hz or choose_velocity_band_hz(data, band, steepest)
    friction = options.friction_velocity
    if friction == "auto":
        friction = "reference" if reference_is_quieter(data, friction_hz) else "measured"
    elif friction == "reference" and data.reference is None:
        raise DataError(
            f"{data.place}: friction after the reference needs a reference, and there is none: "
            "choose friction_velocity: measured"
        )
    rest = min(REST_SLOPES / steepest, REST_PART * top_speed(data, band)) if slopes else 0.0
    return options.resolved(
        filter_hz=band,
        decimation=decimation,
        discard=discard,
        friction_velocity=friction,
        friction_hz=friction_hz,
        rest_velocity=rest,
    )


def prepare(data: Measured, model: EffectList, options: FitOptions) -> RegressionData:
    """Make the rows of `model` over the usable samples of `data`.

    Parameters
    ----------
    data
        What was measured of the axis.
    model
        The effects whose columns are formed.
    options
        May leave choices open (see `resolve_options`).

    Returns
    -------
    RegressionData
        The rows that are left, with every choice stated.

    Raises
    ------
    DataError
        No stretch of usable rows is long enough for the filter to settle, or a choice does not fit
        the sample rate.
    """
    model = EffectList([with_slope(e, options.coulomb_slope_s_m) for e in model.effects])
    options = resolve_options(data, model, options)
    assert options.discard_start is not None
    assert options.discard_end is not None
    assert options.decimation is not None
    lowest, highest = delay_range_s(options, data.sample_rate_hz)
    if not options.estimate_delay:
        lowest = highest = options.input_delay_s
    reach = _reach(options, lowest / data.period_s, highest / data.period_s)
    shortest = options.discard_start + options.discard_end + sum(reach) + 10 * options.decimation
    shortest = max(shortest, 3 * max(options.filter_order, options.decimation_order) + 2)
    stretches, accelerations, picks = [], [], []
    for rows in data.stretches(shortest):
        stretch, acceleration = _motion(data, rows, model, options)
        stretches.append(stretch)
        accelerations.append(acceleration)
        quiet = stretch.quiet[options.discard_start : len(stretch.quiet) - options.discard_end]
        picks.append(_picked(quiet, options, reach))
    if not stretches:
        raise TooFewRowsError(
            f"{data.place}: no usable stretch reaches {shortest * data.period_s:.3g} s, which a "
            f"filter at {options.filter_hz:g} Hz needs to settle: record longer without a gap, or "
            "choose a higher filter_hz"
        )
    return RegressionData(
        data, tuple(stretches), model, options, tuple(accelerations), tuple(picks)
    )


def _reach(options: FitOptions, lowest: float, highest: float) -> tuple[int, int]:
    """Count the samples that alignment reaches back from a row, and ahead of it."""
    if not options.hold_alignment:
        return max(0, math.floor(highest) + 1 if highest else 0), max(0, -math.floor(lowest))
    half_width = 1 if options.derivative == "second_difference" else 2
    return (
        max(0, math.ceil(highest) + half_width),
        max(0, math.ceil(-lowest) + half_width),
    )


def _motion(
    data: Measured, rows: slice, model: EffectList, options: FitOptions
) -> tuple[Stretch, Array]:
    """Return the signals of one stretch without gaps, and its acceleration."""

    def derived(position: Array) -> tuple[Array, Array, Array]:
        on_position = options.filter_target == "position"
        x = smoothed_by(options, position, data.sample_rate_hz) if on_position else position
        v = velocity_of(x, data.period_s)
        return x, v, acceleration_of(x, v, data.period_s, options.derivative)

    x, v, a = derived(data.position[rows])
    # friction must not lag the motion, whatever filter goes over its column afterwards
    quiet = v
    if options.filter_target == "columns":
        assert options.friction_hz is not None
        gentle = low_pass("butterworth", 4, options.friction_hz, data.sample_rate_hz)
        quiet = zero_phase(gentle, 4, v)
    desired = data.desired_velocity
    if options.friction_velocity == "reference" and desired is not None:
        quiet = desired[rows]
    beside = {
        name: np.column_stack(derived(other.position[rows]))
        for name, other in data.others.items()
        if name in model.other_axes
    }
    stretch = Stretch(
        data.time_s[rows], data.position[rows], x, v, data.command[rows], beside, quiet
    )
    return stretch, a


def _picked(quiet: Array, options: FitOptions, reach: tuple[int, int]) -> Indices:
    """Choose the rows of a stretch: decimated, within reach of the alignment, and not at rest."""
    assert options.decimation is not None
    assert options.rest_velocity is not None
    back, ahead = reach
    pick = picked(len(quiet), options.decimation)
    pick = pick[(pick >= back) & (pick < len(quiet) - ahead)]
    return np.asarray(pick[np.abs(quiet[pick]) >= options.rest_velocity])
