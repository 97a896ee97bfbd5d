"""What a hypothesis predicts of a motion: the command that it asks, as the rows that a fit sees.

No machine is simulated: the axis is taken to follow its reference, and the columns are formed by
the same code that forms them of a recording, behind the same filter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from motorctl.identify.columns.at_rest import COUNTS_PER_PERIOD, at_rest
from motorctl.identify.columns.command_timing import CommandPath
from motorctl.identify.columns.filters import second_difference
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.position_noise import velocity_noise_rms
from motorctl.identify.columns.signals import STUCK_PERIODS, Signals
from motorctl.identify.columns.stretches import command_for, make_stretch
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.parameters import values_of
from motorctl.model.columns import error_columns
from motorctl.motion import Trajectory

Array = NDArray[np.float64]

MOST_COMMAND = 2.0
"""Largest command that is predicted, over the largest that was recorded. Larger lets a wrong input
map run away beyond what it was fitted to, smaller bends harder motions. By hand."""


def predicted(
    hypothesis: Hypothesis, paths: Mapping[str, Trajectory], axis: str, begin_s: float
) -> Signals:
    """Return the signals of an axis on a motion, were a hypothesis the truth.

    Parameters
    ----------
    hypothesis
        With the parameters that it was fitted with, on signals whose filter is used here too.
    paths
        The motion of every axis, all of one length, at rest at both ends.
    axis
        The axis.
    begin_s
        When the motion begins, by the clock of the recording [s].
    """
    known = hypothesis.regressors.signals
    data, rate = known.data, known.data.sample_rate_hz
    time_s = np.arange(int(paths[axis].duration_s * rate)) / rate
    x = paths[axis].sample(time_s)[0]
    motion = _measured(data, axis, begin_s + time_s, x, np.zeros_like(x))
    others = {
        name: _measured(data, name, begin_s + time_s, path.sample(time_s)[0], np.zeros_like(x))
        for name, path in paths.items()
        if name in data.others
    }
    motion = replace(motion, others=others)
    smooth_hz = min(2.0 * known.band_hz, 0.45 * rate)
    stretch = make_stretch(motion, slice(None), smooth_hz, known.quiet_hz)
    a = second_difference(stretch.x, known.period_s)
    values = values_of(hypothesis)
    most = MOST_COMMAND * known.largest_command
    command = command_for(stretch, values.model, values.theta, a, most)
    held = CommandPath(
        hypothesis.path.delay_s + 0.5 * known.period_s, hypothesis.path.lag_s
    )  # what is held acts half a period late
    command = _led(command, held, 2.0 * known.band_hz, known.period_s)
    position = x + _errors_of_measurement(hypothesis, stretch.x)
    stretch = replace(stretch, position=position, command=command)
    used = np.zeros(-(-len(x) // known.decimation), dtype=np.bool_)
    used[known.trim : len(used) - known.trim] = True
    used &= ~at_rest(
        stretch,
        known.row_period_s,
        known.decimation,
        velocity_noise_rms(known.position_noise, known.band_hz),
        known.position_noise_rms,
        STUCK_PERIODS / known.band_hz,
        COUNTS_PER_PERIOD * known.band_hz * (data.resolution or 0.0),
    )
    measured = replace(motion, position=position, command=command)
    return replace(known.with_stretches((stretch,)), data=measured, kept=(used,))


def _measured(data: Measured, axis: str, time_s: Array, x: Array, command: Array) -> Measured:
    return Measured(
        source="a motion that was not run",
        axis=axis,
        sample_rate_hz=data.sample_rate_hz,
        time_s=time_s,
        position=x,
        command=command,
        usable=np.ones(len(x), dtype=np.bool_),
        resolution=data.resolution,
        position_unit=data.position_unit,
        command_unit=data.command_unit,
    )


def _errors_of_measurement(hypothesis: Hypothesis, x: Array) -> Array:
    """Return what a hypothesis adds to the measured position."""
    total, b = np.zeros_like(x), dict(zip(hypothesis.places, hypothesis.b[1:], strict=True))
    for effect in hypothesis.of_kind("measurement"):
        columns = error_columns(effect, x)
        for j, column in enumerate(columns):
            total += b[effect, j] * column
    return total


def _led(command: Array, path: CommandPath, highest_hz: float, period_s: float) -> Array:
    """Return what has to be given so that, behind a path, this command acts."""
    ramp = np.linspace(command[0], command[-1], len(command))
    size = fft.next_fast_len(2 * len(command), real=True)
    spectrum = fft.rfft(command - ramp, size)
    frequency = np.arange(len(spectrum)) / (size * period_s)
    passed = np.exp(-((frequency / highest_hz) ** 8) * np.log(2.0))
    given = fft.irfft(spectrum * path.undone(frequency) * passed, size)[: len(command)]
    return np.asarray(given + ramp)
