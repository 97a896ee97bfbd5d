"""Waves over time that are harmonics of the motion itself, where that repeats.

A program that begins anew after a time brings all that depends on the motion back after that time:
friction, weights, and the load of other axes in the same program. A wave of a whole number of
cycles in it may be any of that.
"""

from __future__ import annotations

import math

from motorctl.identify.columns.repetition import find_period
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import measure
from motorctl.model import Effect

SHOWN = 1.15
"""Periods of a motion that a recording must show before it repeats. Larger misses long programs of
which little is seen again, smaller takes a few like rows for a repetition. Chosen by hand."""
STAYS = 0.1
"""Phase [rad] by which a wave leaves the repetition over the recording, rms, up to which it is in
step with it. Larger doubts fans that come near a harmonic, smaller names harmonics whose frequency
is told poorly. Chosen by hand: a harmonic of a recorded arm's program has 0.05, 1.2 periods long;
of fans with any frequency, one in fifty is as near where six periods were recorded."""
AS_MUCH = 0.98
"""Part of what a wave takes that its nearest harmonic takes, from which it may be that: an error
that is no clean line tells its frequency poorly. Larger names such, smaller doubts fans near a
harmonic. Chosen by hand: at a harmonic of a recorded arm's program it is 0.996; of fans with any
frequency, one in twenty is as near where three periods were recorded."""
FEWEST_CYCLES = 2
"""Cycles of a wave in the motion's shortest period, at least. Larger names low harmonics, smaller
refutes what a disturbance moves by itself: that repeats after one. Arithmetic."""


def motions_own_wave(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return a wave over time that is in step with the motion's repetition, and what to say."""
    for effect in final.added:
        if "wave_over_time" not in effect.groups:
            continue
        period_s = _period_in_step(final, effect)
        if period_s is None:
            continue
        line_hz = effect.lines[0]
        cycles = round(line_hz * period_s)
        return effect, (
            f"{effect.name} is refuted: the motion repeats after {period_s:.4g} s, and "
            f"{line_hz:.4g} Hz is {cycles} cycles in it: whatever depends on the motion, or on "
            "other axes of the same program, repeats so, too. Record a motion that does not repeat"
        )
    return None


def _period_in_step(final: Hypothesis, effect: Effect) -> float | None:
    """Return after what time the motion repeats, if a wave stays in step with that."""
    signals = final.regressors.signals
    longest = max(signals.stretches, key=lambda s: len(s.v))
    step = signals.decimation
    time_s, velocity = longest.time_s[::step], longest.v[::step]
    period_s = find_period(time_s, velocity, SHOWN)
    if period_s is None:
        return None
    cycles = effect.lines[0] * period_s
    whole = round(cycles)
    if whole < FEWEST_CYCLES:
        return None
    left_by = abs(cycles - whole) * float(time_s[-1] - time_s[0]) / period_s  # over the recording
    drift = 2.0 * math.pi * left_by / math.sqrt(12.0)  # of phase, rms
    if drift < STAYS or (left_by < 0.5 and _as_well(final, effect, whole / period_s)):
        return period_s
    return None


def _as_well(final: Hypothesis, effect: Effect, harmonic_hz: float) -> bool:
    """Return whether a wave takes nearly as much at a harmonic as where it was found."""
    rest = final.without(effect.name).refreshed()
    moved = measure(rest, type(effect).at_line(harmonic_hz))
    if moved is None:
        return False
    most = rest.solution.sse
    return most - moved.sse >= AS_MUCH * (most - final.solution.sse)
