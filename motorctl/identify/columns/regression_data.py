"""From recorded signals to the filtered columns of the regression.

Nonlinear terms are formed first, at the full rate, by the effects' own kernels; then one linear
filter goes over every column alike, so that the equation u = sum theta_i psi_i still holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.command_timing import Taps, hold_taps, sample_taps
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
from motorctl.identify.fit.settings import FitOptions, Segment
from motorctl.model import EffectList
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


@dataclass(frozen=True)
class RegressionData:
    """Filtered and decimated columns of one axis; m rows, n parameters, h input columns."""

    model: EffectList
    options: FitOptions
    """With everything filled in."""
    period_s: float
    """Of the recording, before decimation."""
    time_s: Array
    """(m,)"""
    state_columns: Array
    """(m, n), zero where the column is one of the command."""
    input_index: Indices
    """(h,) which of the n columns depend on the command."""
    held: Array
    """(K, 1 + h) filtered command and its columns at the full rate, before alignment."""
    pick: Indices
    """(m,) the row of `held` that belongs to each row."""

    def taps(self, delay_samples: float) -> Taps:
        """Return the alignment of the command for an input delay."""
        if not self.options.hold_alignment:
            return sample_taps(delay_samples)
        return hold_taps(delay_samples, 1 if self.options.derivative == "second_difference" else 2)

    def at(self, delay_s: float) -> tuple[Array, Array]:
        """Return psi (m, n) and the command (m,) for an input delay [s], positive: acts later."""
        taps = self.taps(delay_s / self.period_s)
        aligned = np.zeros((len(self.pick), self.held.shape[1]))
        for lag, weight in zip(taps.lags, taps.weights, strict=True):
            aligned += weight * self.held[self.pick - lag]
        psi = self.state_columns.copy()
        psi[:, self.input_index] = aligned[:, 1:]
        return psi, aligned[:, 0]

    def rows(self, chosen: NDArray[np.bool_]) -> RegressionData:
        """Return only some of the rows; `chosen` of shape (m,)."""
        return replace(
            self,
            time_s=self.time_s[chosen],
            state_columns=self.state_columns[chosen],
            pick=self.pick[chosen],
        )

    def within(self, segments: tuple[Segment, ...]) -> RegressionData:
        """Return the rows whose time lies in one of the segments, begin included, end not."""
        time = self.time_s + 0.5 * self.period_s
        inside = [(time >= begin) & (time < end) for begin, end in segments]
        return self.rows(np.logical_or.reduce(inside))


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
    """Form, filter and decimate the columns of `model` over the usable rows of `data`.

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
        Command, columns and times of the rows that are left, with every choice stated.

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
    kinds = [effect.kind for effect in model.effects for _ in effect.parameters]
    input_index = np.flatnonzero(np.array(kinds) == "input")
    parts = [
        _stretch(data, rows, model, options, input_index, reach)
        for rows in data.stretches(shortest)
    ]
    if not parts:
        raise DataError(
            f"{data.place}: no usable stretch reaches {shortest * data.period_s:.3g} s, which a "
            f"filter at {options.filter_hz:g} Hz needs to settle: record longer without a gap, or "
            "choose a higher filter_hz"
        )
    starts = np.cumsum([0, *(len(held) for _, _, held, _ in parts)])
    return RegressionData(
        model=model,
        options=options,
        period_s=data.period_s,
        time_s=np.concatenate([time for time, _, _, _ in parts]),
        state_columns=np.concatenate([columns for _, columns, _, _ in parts]),
        input_index=input_index,
        held=np.concatenate([held for _, _, held, _ in parts]),
        pick=np.concatenate([pick + s for (_, _, _, pick), s in zip(parts, starts, strict=False)]),
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


def _stretch(
    data: Measured,
    rows: slice,
    model: EffectList,
    options: FitOptions,
    input_index: Indices,
    reach: tuple[int, int],
) -> tuple[Array, Array, Array, Indices]:
    """Return time, state columns, held columns and picks of one stretch without gaps."""
    assert options.filter_hz is not None
    assert options.decimation is not None
    sections = low_pass(
        options.filter_kind, options.filter_order, options.filter_hz, data.sample_rate_hz
    )

    def smooth(columns: Array) -> Array:
        if options.zero_phase:
            return zero_phase(sections, options.filter_order, columns)
        return one_way(sections, columns)

    on_position = options.filter_target == "position"
    position = smooth(data.position[rows]) if on_position else data.position[rows]
    velocity = velocity_of(position, data.period_s)
    acceleration = acceleration_of(position, velocity, data.period_s, options.derivative)
    # friction must not lag the motion, whatever filter goes over its column afterwards
    quiet = velocity
    if not on_position:
        assert options.friction_hz is not None
        gentle = low_pass("butterworth", 4, options.friction_hz, data.sample_rate_hz)
        quiet = zero_phase(gentle, 4, velocity)
    desired = data.desired_velocity
    if options.friction_velocity == "reference" and desired is not None:
        quiet = desired[rows]
    time, command = data.time_s[rows], data.command[rows]
    psi = model.regressor(position, velocity, acceleration, quiet, time, command)
    columns = np.column_stack([psi, command])
    if not on_position:
        columns = smooth(columns)
    assert options.discard_start is not None
    assert options.discard_end is not None
    assert options.rest_velocity is not None
    kept = slice(options.discard_start, len(time) - options.discard_end)
    columns, time = columns[kept], time[kept]
    if options.decimation_order and options.decimation > 1:
        chebyshev = decimation_filter(options.decimation_order, options.decimation)
        columns = zero_phase(chebyshev, options.decimation_order, columns)
    pick = picked(len(time), options.decimation)
    back, ahead = reach
    pick = pick[(pick >= back) & (pick < len(time) - ahead)]
    pick = pick[np.abs(quiet[kept][pick]) >= options.rest_velocity]
    state = columns[pick, :-1].copy()
    state[:, input_index] = 0.0
    held = columns[:, [len(model), *input_index]]
    return time[pick], state, held, pick
