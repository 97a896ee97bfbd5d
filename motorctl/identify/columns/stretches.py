"""One stretch of a recording without a gap: its motion, its columns, and where it is at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from motorctl.identify.columns.filters import second_difference
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.position_noise import velocity_band_hz
from motorctl.model import Effect, EffectList
from motorctl.model.columns import error_columns, input_columns, state_columns

Array = NDArray[np.float64]

TRIM_PERIODS = 8.0
"""Rows dropped at each end of a stretch, in periods of the band's end. Smaller lets the filter's
ends into the rows, larger loses rows of short stretches. Chosen by hand."""
QUIET_NOISE = 0.1
"""Noise of the velocity that friction depends on, in multiples of 1/slope. Larger blurs the sign of
friction near rest, smaller smooths reversals away. Chosen on nine machines of other hands: with
0.03 one leaves five times as much, with 0.3 slopes come out up to 40 % wrong."""
NARROWEST_QUIET = 0.3
"""That velocity's band is at least this part of the rows' band. Larger lets noise through, smaller
delays reversals too much. Chosen by hand."""
QUIET_STEPS = 4
"""Steps of that band in an octave: slopes that are alike share one. More takes time, fewer changes
the band where friction's slope is fitted. Chosen by hand."""
REST_S = 0.06
"""Shortest standstill that counts as a rest [s]. Smaller takes the turning points of a move for
rests, larger keeps rests that say nothing. Chosen by hand."""
REST_EDGE_S = 0.03
"""What of a rest is kept at each end [s]: how friction lets go is seen there. Larger keeps rows
that say nothing, smaller hides the breakaway. Chosen by hand."""
STICK_S = 0.02
"""Shortest time that an axis stays within what its encoder shows, to stick [s]. Larger keeps rows
in which friction is whatever the command is, smaller takes slow motion for sticking. Chosen by
hand: machines of other hands stick for 40 to 80 ms at a reversal."""
FEWEST_STUCK_SAMPLES = 4
"""The same in samples, at low rates. Fewer take a slow clock's repeats for sticking. Chosen by
hand."""
TOLD_APART = 8e-3
"""Part of the top speed: an encoder that cannot tell slower motion from a rest within that time
shows no sticking. Larger drops slow motion behind coarse encoders, smaller keeps sticking. Chosen
by hand."""
COUNTS_PER_PERIOD = 1.0
"""Counts that a coarse encoder passes in a period of the band's end, below which its steps are no
motion that the rows could show. Larger drops slow motion, smaller takes an encoder's stairs for
forces. Chosen on six machines of other hands, of 0.5, 1 and 2: half a count leaves more
unexplained, two find no other effect."""
MOST_SLOW = 0.5
"""Part of a stretch that may be dropped for it. Larger leaves too little of slow recordings,
smaller keeps the stairs. Chosen by hand."""
REST_SPEED = 3.0
"""Speed, in multiples of the velocity noise's rms, below which the axis may be at rest. Larger
throws away slow motion, smaller takes noise for motion. Convention: three standard deviations."""
REST_RANGE = 14.0
"""Range of the position, in multiples of its noise's rms, that is rest as well: some four counts,
within which friction's bristles bend unseen. Larger throws away slow motion, smaller keeps rests.
Arithmetic: a count's rounding has an rms of 1/sqrt(12), so 14 / sqrt(12) = 4.04 counts; that it is
four was chosen by hand on the simulated campaign."""
REST_PART = 1e-3
"""Part of the top speed that creeping at rest stays below. Larger throws away slow motion, smaller
keeps rests whose position hunts. Chosen by hand."""
INVERSION_STEPS = 15
"""Times that the command is put into its own input map: it converges by the map's slope each time.
More takes time, fewer leaves the command of steep maps short. Arithmetic: a slope of 0.5, of a worm
gear, leaves 3e-5."""


@dataclass(frozen=True)
class Stretch:
    """Signals without a gap; arrays of shape (N,)."""

    time_s: Array
    position: Array
    """As measured."""
    x: Array
    """Smoothed."""
    v: Array
    command: Array
    others: dict[str, Array]
    """(N, 3) motion of each other axis."""
    quiet: Array
    """The velocity that friction depends on."""

    def part(self, rows: slice) -> Stretch:
        """Return some of the samples."""
        own = {name: signal[rows] for name, signal in vars(self).items() if name != "others"}
        return Stretch(**own, others={name: motion[rows] for name, motion in self.others.items()})

    def columns(
        self,
        effect: Effect,
        acceleration: Array | None = None,
        command: Array | None = None,
        step: int = 1,
    ) -> Array:
        """Return the columns of an effect over the stretch, (p, n), each step-th sample.

        Parameters
        ----------
        effect
            Of the state, of the input, or of the measurement: then one column an amplitude.
        acceleration
            What state effects see, (N,); none by default, zero.
        command
            What input effects see, (N,); by default the recorded one.
        step
            Decimation at which they are formed.
        """
        x, v, quiet, t = (signal[::step] for signal in (self.x, self.v, self.quiet, self.time_s))
        if effect.kind == "measurement":
            return error_columns(effect, x)
        if effect.kind == "input":
            u = self.command if command is None else command
            return input_columns(effect, u[::step], x, quiet, t)
        a = np.zeros_like(x) if acceleration is None else acceleration[::step]
        return state_columns(effect, x, v, a, quiet, t, self.beside(effect, step))

    def beside(self, effect: Effect, step: int = 1) -> Array:
        """Return the motion of the axes that an effect depends on, (n, axes, 3), each step-th row.

        An axis that was not recorded stands still.
        """
        motion = np.zeros((len(self.x[::step]), len(effect.other_axes), 3))
        for i, axis in enumerate(effect.other_axes):
            if axis in self.others:
                motion[:, i] = self.others[axis][::step]
        return motion


def command_for(
    motion: Stretch, model: EffectList, theta: Array, acceleration: Array, limit: float = math.inf
) -> Array:
    """Return the command that a model asks for a motion, (N,).

    Solves v(u) = sum of the state terms by iterating u = v + (u - v(u)).

    Parameters
    ----------
    motion
        Its command is not asked.
    model, theta
        The effects and their parameters, (n,).
    acceleration
        Of the motion, (N,).
    limit
        Largest command.
    """
    force = np.zeros_like(motion.x)
    inputs: list[tuple[Effect, Array]] = []
    start = 0
    for effect in model.effects:
        own = theta[start : (start := start + len(effect.parameters))]
        if effect.kind == "input":
            inputs.append((effect, own))
        elif len(own):
            force += own @ motion.columns(effect, acceleration)
    command = np.clip(force, -limit, limit)
    for _ in range(INVERSION_STEPS if inputs else 0):
        bent = sum(own @ motion.columns(effect, None, command) for effect, own in inputs)
        command = np.clip(force + bent, -limit, limit)
    return np.asarray(command)


def make_stretch(data: Measured, rows: slice, smooth_hz: float, quiet_hz: float) -> Stretch:
    """Smooth the motion of some rows of a recording.

    Parameters
    ----------
    data
        What was measured of the axis.
    rows
        Which samples.
    smooth_hz
        Band of the smoothed position [Hz].
    quiet_hz
        Band of the velocity that friction depends on [Hz].

    Returns
    -------
    Stretch
        The signals at the full rate.
    """
    x = smoothed(data.position[rows], smooth_hz, data.period_s)
    v = np.gradient(x, data.period_s)
    beside = {}
    for name, other in data.others.items():
        xo = smoothed(other.position[rows], 0.5 * smooth_hz, data.period_s)
        vo = np.gradient(xo, data.period_s)
        beside[name] = np.column_stack([xo, vo, second_difference(xo, data.period_s)])
    return Stretch(
        time_s=data.time_s[rows],
        position=data.position[rows],
        x=x,
        v=v,
        command=data.command[rows],
        others=beside,
        quiet=quiet_velocity(data.position[rows], quiet_hz, data.period_s),
    )


def quiet_velocity(position: Array, quiet_hz: float, period_s: float) -> Array:
    """Return the velocity that friction depends on, (N,), of a measured position in this band."""
    return np.asarray(np.gradient(smoothed(position, quiet_hz, period_s), period_s))


def quiet_band_hz(density: float, band_hz: float, slope_s_m: float | None) -> float:
    """Return the band of the velocity that friction depends on [Hz]: noise small beside 1/slope."""
    widest = 2.0 * band_hz
    if slope_s_m is None or not 0.0 < slope_s_m < math.inf or density <= 0.0:
        return widest
    allowed = velocity_band_hz(density, QUIET_NOISE / slope_s_m)
    octaves = math.log2(min(max(allowed / widest, 0.5 * NARROWEST_QUIET), 1.0))
    return float(widest * 2.0 ** (math.floor(QUIET_STEPS * octaves) / QUIET_STEPS))


def smoothed(position: Array, cutoff_hz: float, period_s: float) -> Array:
    """Low-pass without phase; the ends are continued by point reflection."""
    n = len(position)
    pad = min(n - 1, math.ceil(TRIM_PERIODS / cutoff_hz / period_s))
    extended = np.pad(position, pad, mode="reflect", reflect_type="odd")
    ramp = np.linspace(extended[0], extended[-1], len(extended))
    size = fft.next_fast_len(len(extended), real=True)
    spectrum = fft.rfft(extended - ramp, size)
    frequency = np.arange(len(spectrum)) / (size * period_s)
    spectrum *= np.exp(-((frequency / cutoff_hz) ** 8) * math.log(2.0))
    smooth = fft.irfft(spectrum, size)[: len(extended)] + ramp
    return np.asarray(smooth[pad : pad + n])


def at_rest(
    stretch: Stretch,
    row_period_s: float,
    decimation: int,
    velocity_noise: float,
    noise: float,
    margin_s: float,
    slowest: float,
) -> NDArray[np.bool_]:
    """Find the rows of rests, where friction is no function of velocity.

    Parameters
    ----------
    stretch
        The motion.
    row_period_s, decimation
        Time between rows [s], and the samples of one.
    velocity_noise, noise
        Rms of the noise of velocity and of position, in the position's unit (per second).
    margin_s
        As far as the rows' filter reaches [s].
    slowest
        Speed below which the encoder's counts come too seldom for the rows to show motion.

    Returns
    -------
    ndarray
        Which rows are dropped, (m,).
    """
    x, v = stretch.x[::decimation], stretch.v[::decimation]
    top = float(np.percentile(np.abs(stretch.v), 99.0))
    within = min(REST_RANGE * noise, REST_PART * top * REST_S)
    still = np.abs(v) < REST_SPEED * velocity_noise
    still |= _stays(x, within, max(3, round(REST_S / row_period_s)))
    return _inside_of_rests(still, row_period_s) | sticks(
        stretch, row_period_s, decimation, noise, margin_s, slowest
    )


def sticks(
    stretch: Stretch,
    row_period_s: float,
    decimation: int,
    noise: float,
    margin_s: float,
    slowest: float,
) -> NDArray[np.bool_]:
    """Find the rows in which the axis sticks: there friction is whatever the command asks of it.

    An encoder that is too coarse to tell that shows stairs instead of slow motion: where its counts
    come too seldom, the rows are dropped as well.

    Parameters
    ----------
    stretch, row_period_s, decimation, noise, slowest
        As of `at_rest`.
    margin_s
        What is dropped on each side of it [s]: as far as the rows' filter reaches.

    Returns
    -------
    ndarray
        Which rows are dropped, (m,).
    """
    period_s = row_period_s / decimation
    size = max(FEWEST_STUCK_SAMPLES, round(STICK_S / period_s))
    within = REST_RANGE * noise
    if within > TOLD_APART * np.percentile(np.abs(stretch.v), 99.0) * STICK_S:
        stuck, size = np.abs(stretch.v) < slowest, 1
        if np.mean(stuck) > MOST_SLOW:
            stuck = np.zeros_like(stuck)
    else:
        stuck = _stays(stretch.x, within, size)
    reach = size + 2 * round(margin_s / period_s)
    return np.asarray(maximum_filter1d(stuck.astype(np.int8), reach)[::decimation] > 0)


def _stays(x: Array, within: float, size: int) -> NDArray[np.bool_]:
    """Return where the position stays within a range, hunting included, for so many samples."""
    highest: Array = maximum_filter1d(x, size)
    lowest: Array = minimum_filter1d(x, size)
    return np.asarray(highest - lowest < within)


def _inside_of_rests(still: NDArray[np.bool_], period_s: float) -> NDArray[np.bool_]:
    """Find the inside of long rests, where friction is no function of velocity."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    result = np.zeros(len(still), dtype=np.bool_)
    keep = round(REST_EDGE_S / period_s)
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if (stop - start) * period_s > REST_S + 2 * REST_EDGE_S:
            result[start + keep : stop - keep] = True
    return result
