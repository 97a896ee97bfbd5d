"""Resonances where the command has nothing: what smooths a noisy acceleration, and is no spring.

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

from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.model import Effect

Array = NDArray[np.float64]

ASKED = 0.1
"""Command where a part on a spring swings, over what the spring explains of the command [rms], at
least. Larger refutes resonances that hardly take force, smaller takes smoothed noise for a spring.
Chosen by hand: on recorded machines springs have from 0.24 on, smoothed noise 0.005 to 0.03."""
BELOW = 0.5
"""Part of a resonance's frequency from which on a part on a spring swings. Nearer to 1 leaves the
foot of broad resonances out, smaller counts the slow motion of the whole. Chosen by hand: an octave
below, its column has a third of the acceleration."""
FINER = 8
"""Factor by which the spectrum is finer than its resolution, in which the strongest line is sought.
Larger takes time, smaller leaves more of a sine behind. Arithmetic: 1/8 of a period is left."""
TRIED = 41
"""Frequencies that are tried around that line. More takes time, fewer leaves more of a sine behind.
Arithmetic: over one period in the recording, the line is met to 1/80 of one."""


def uncommanded(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a resonance that explains what the command does not have there, and what to say."""
    if final.regressors.side != "command":
        return None
    signals = final.regressors.signals
    for effect in final.added:
        if "resonance" not in effect.groups or not effect.lines:
            continue
        taken = final.without(effect.name).refreshed().held_out - final.held_out
        command = final.problem.joined(signals.rows)[-1]
        lowest_hz = BELOW * min(effect.lines)
        has = _beside_one_sine(signals.time_s, command, signals.row_period_s, lowest_hz)
        part = math.sqrt(float(has @ has) / max(taken, 1e-300))
        if part < ASKED:
            return effect, (
                f"{effect.name} is refuted: above {lowest_hz:.3g} Hz the command has, beside its "
                f"strongest sine, only {part:.2g} times what this would explain of it (limit "
                f"{ASKED:g}): it smooths the noise of the acceleration. Record a motion whose "
                "command has all frequencies up to there"
            )
    return None


def _beside_one_sine(time_s: Array, command: Array, period_s: float, lowest_hz: float) -> Array:
    """Return a command above a frequency, without its strongest sine."""
    rest = command - command.mean()
    size = FINER * len(rest)
    density = np.abs(np.fft.rfft(rest * np.hanning(len(rest)), size))
    step_hz = 1.0 / (size * period_s)
    around = (np.argmax(density) + np.linspace(-1.0, 1.0, TRIED) * FINER / 2.0) * step_hz
    left = min((_without(time_s, rest, hz) for hz in around), key=lambda e: float(e @ e))
    fs = 1.0 / period_s
    if lowest_hz >= 0.5 * fs:
        return left
    high = signal.butter(4, lowest_hz, "highpass", fs=fs, output="sos")
    return np.asarray(signal.sosfiltfilt(high, left))


def _without(time_s: Array, rows: Array, line_hz: float) -> Array:
    """Return rows without a sine."""
    angle = 2.0 * math.pi * line_hz * time_s
    columns = np.stack([np.sin(angle), np.cos(angle), np.ones(len(rows))], axis=1)
    return np.asarray(rows - columns @ np.linalg.lstsq(columns, rows, rcond=None)[0])
