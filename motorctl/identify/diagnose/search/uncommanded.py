"""Resonances where the command has nothing: what smooths a noisy acceleration, and is no spring.

A resonance is a shape over frequency. What it explains of one sine is a size and a phase, which any
other cause may give as well: so it has to gain what a name needs beside a free sine of the
command's strongest line.

With the command on the left the measured acceleration stands on the right, with its noise. A
resonance that takes all inertia above its frequency away takes that noise away too, and a command
that is slow, or a single sine, is met better by it on any machine. A part on a spring shows in the
command where it swings.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from motorctl.identify.diagnose.search.acceptance import LEAST_GAIN, gain
from motorctl.identify.diagnose.search.held_out_blocks import held_out_sse, with_columns
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.spectral_lines import without_sines
from motorctl.model import Effect

Array = NDArray[np.float64]

ASKED = 0.1
"""Command where a part on a spring swings, over what the spring explains of the command [rms], at
least. Larger refutes resonances that hardly take force, smaller takes smoothed noise for a spring.
Chosen by hand: on recorded machines springs have from 0.4 on, smoothed noise 0.005 to 0.04."""
BELOW = 0.9
"""Part of a resonance's frequency from which on a part on a spring swings. Nearer to 1 leaves the
foot of broad resonances out, smaller counts the slow motion of the whole. Chosen by hand: from 0.5
on, a leg that was swept to just below such a resonance has 0.8 to 1.2."""
IN_BAND = 0.75
"""Part of the band, up to which that frequency is asked: above, the foot of a resonance is all that
is seen. Larger asks of too little, smaller counts slow motion. Chosen by hand."""
FINER = 8
"""Factor by which the spectrum is finer than its resolution, in which the strongest line is sought.
Larger takes time, smaller leaves more of a sine behind. Arithmetic: 1/8 of a period is left."""
TRIED = 41
"""Frequencies that are tried around that line. More takes time, fewer leaves more of a sine behind.
Arithmetic: over one period in the recording, the line is met to 1/80 of one."""


def uncommanded(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a resonance that explains what the command does not have there, and what to say."""
    signals = final.regressors.signals
    for effect in final.added:
        if "resonance" not in effect.groups or not effect.lines:
            continue
        rest = final.without(effect.name).refreshed()
        command = final.problem.joined(signals.rows)[final.regressors.command_column]
        line_hz = _strongest_line(signals.time_s, command, signals.row_period_s)
        alone = _gain_beside(rest, final, line_hz)
        if alone < LEAST_GAIN:
            whole = gain(rest, final.held_out)
            return effect, (
                f"{effect.name} is refuted: held-out log-likelihood rises by {whole:.0f} with it, "
                f"but by {alone:.0f} beside a sine of {line_hz:.3g} Hz, the command's strongest "
                f"({LEAST_GAIN:.0f} are required): one frequency tells a size and a phase, which "
                "other causes have as well. Record a motion of many frequencies"
            )
        if final.regressors.side != "command":
            continue
        lowest_hz = BELOW * min(*effect.lines, IN_BAND * signals.band_hz)
        left = without_sines(signals.time_s, command - command.mean(), (line_hz,))
        has = _above(left, signals.row_period_s, lowest_hz)
        part = math.sqrt(float(has @ has) / max(rest.held_out - final.held_out, 1e-300))
        if part < ASKED:
            return effect, (
                f"{effect.name} is refuted: above {lowest_hz:.3g} Hz the command has, beside its "
                f"strongest sine, only {part:.2g} times what this would explain of it (limit "
                f"{ASKED:g}): it smooths the noise of the acceleration. Record a motion whose "
                "command has all frequencies up to there"
            )
    return None


def _gain_beside(rest: Hypothesis, final: Hypothesis, line_hz: float) -> float:
    """Return the gain in log-likelihood of one model over another, a sine being free in both."""
    signals = final.regressors.signals
    angle = 2.0 * math.pi * line_hz * signals.time_s
    sine = np.stack([np.sin(angle), np.cos(angle)])
    without, left = (
        float(held_out_sse(with_columns(model.problem, sine)).sum()) for model in (rest, final)
    )
    return 0.5 * signals.rows * math.log(max(without, 1e-300) / max(left, 1e-300))


def _strongest_line(time_s: Array, command: Array, period_s: float) -> float:
    """Return the frequency of a command's strongest sine [Hz]."""
    rest = command - command.mean()
    size = FINER * len(rest)
    density = np.abs(np.fft.rfft(rest * np.hanning(len(rest)), size))
    step_hz = 1.0 / (size * period_s)
    around = (np.argmax(density) + np.linspace(-1.0, 1.0, TRIED) * FINER / 2.0) * step_hz
    return float(min(around, key=lambda hz: float(np.sum(without_sines(time_s, rest, (hz,)) ** 2))))


def _above(rows: Array, period_s: float, lowest_hz: float) -> Array:
    """Return rows above a frequency."""
    fs = 1.0 / period_s
    if lowest_hz >= 0.5 * fs:
        return rows
    high = signal.butter(4, lowest_hz, "highpass", fs=fs, output="sos")
    return np.asarray(signal.sosfiltfilt(high, rows))
