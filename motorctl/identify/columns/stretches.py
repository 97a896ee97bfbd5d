"""One stretch of a recording without a gap: its motion, and its columns."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import fft

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
    _thinned: dict[int, tuple[Array, ...]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    """By step, what `thinned` returns: a search asks for it with every form."""

    def part(self, rows: slice) -> Stretch:
        """Return some of the samples."""
        apart = ("others", "_thinned")
        own = {name: signal[rows] for name, signal in vars(self).items() if name not in apart}
        return Stretch(**own, others={name: motion[rows] for name, motion in self.others.items()})

    def thinned(self, step: int) -> tuple[Array, ...]:
        """Return x, v, quiet and time of each step-th sample, (n,) each; not to be written to."""
        if step not in self._thinned:
            signals = (self.x, self.v, self.quiet, self.time_s)
            self._thinned[step] = tuple(np.ascontiguousarray(s[::step]) for s in signals)
        return self._thinned[step]

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
        x, v, quiet, t = self.thinned(step)
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
