"""The errors on another recording of the same machine, to which no parameter is fitted.

The one thing that is found again is the zero of the position: an incremental encoder has another
one after every homing, and what is periodic over a screw's turn or a magnet's pitch is then
shifted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import Signals, make_signals
from motorctl.identify.diagnose.result import ModelError
from motorctl.identify.diagnose.search.held_out_blocks import residual
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.search import Found
from motorctl.identify.diagnose.search.simulated_position import (
    judge_by_simulation,
    position_of_declared,
    simulated_position,
)
from motorctl.identify.diagnose.search.whole_model import known_inertias
from motorctl.identify.diagnose.verdict.errors import REPORT_HZ, explained, per_command
from motorctl.model.sign_function import slope_of

Array = NDArray[np.float64]

TRIALS = 48
"""Zeros that are tried over a pitch. Fewer may miss the best of a high order, more takes time.
Chosen by hand."""


def error_on(test: Measured, found: Found, error: ModelError) -> tuple[ModelError, list[str]]:
    """Return the errors before and after on `test`, and what was found again there."""
    declared = found.final.regressors.declared
    moved = make_signals(test, slope_s_m=slope_of(declared.effects))
    signals = moved.plain(REPORT_HZ)
    unit_left = per_command(found)
    before, command = _rms(found.base, signals, unit_left)
    after, _ = _rms(found.final, signals, unit_left)
    notes = [
        f"the errors before and after are those on {test.source}, up to {signals.band_hz:g} Hz; no "
        "parameter was fitted to it; each effect's evidence is from the fitted recording"
    ]
    shift = _shift(found.final, signals)
    if shift:
        shifted, _ = _rms(found.final, _shifted(signals, shift), unit_left)
        linear = test.position_unit == "m"
        told = f"{1e3 * shift:.3f} mm" if linear else f"{shift:.3g} {test.position_unit}"
        if shifted < after:
            notes.append(
                f"its zero of position is shifted by {told}, estimated from the periodic effects; "
                f"without this shift the error would be {after:.3g} {error.unit}"
            )
            after = shifted
            moved = _shifted(moved, shift)
    simulated = judge_by_simulation(
        moved,
        position_of_declared(found.base.on(moved), known=known_inertias(found.base)),
        simulated_position(found.final.on(moved)),
    )
    gain = abs(float(found.final.b[0]))
    floor = min(float(np.sqrt(signals.noise_variance(found.force_noise))) / gain, before, after)
    changed = replace(
        error,
        held_out_before_rms=before,
        held_out_after_rms=after,
        noise_floor_rms=floor,
        explained_fraction=explained(before, after, floor),
        command_rms=command,
        simulated_position_before_rms=None if simulated is None else simulated.before_rms,
        simulated_position_after_rms=None if simulated is None else simulated.after_rms,
        window_s=None if simulated is None else simulated.window_s,
    )
    return changed, notes


def _rms(hypothesis: Hypothesis, signals: Signals, unit_left: float = 1.0) -> tuple[float, float]:
    """Return what the parameters leave on other rows, and those rows' command."""
    moved = hypothesis.on(signals)
    problem = moved.problem
    left = residual(problem, moved.solution.b)[: signals.rows]
    command = problem.columns[:, moved.regressors.command_column].ravel()[: signals.rows]
    return float(np.sqrt(np.mean(left**2))) / unit_left, float(np.sqrt(np.mean(command**2)))


def _shift(hypothesis: Hypothesis, signals: Signals) -> float:
    """Find the zero that explains the rows best, within half a pitch."""
    pitches = [e.repeats_every for e in hypothesis.added if "wave_over_position" in e.groups]
    if not pitches:
        return 0.0
    pitch = max(pitches)

    def left(shift: float) -> float:
        return _rms(hypothesis, _shifted(signals, shift))[0]

    trials = pitch * (np.arange(TRIALS) / TRIALS - 0.5)
    best = float(min(trials, key=left))
    step = pitch / TRIALS
    fine = minimize_scalar(left, bounds=(best - step, best + step), method="bounded")
    return float(fine.x)


def _shifted(signals: Signals, shift: float) -> Signals:
    return signals.with_stretches(tuple(replace(s, x=s.x + shift) for s in signals.stretches))
