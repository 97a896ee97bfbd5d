"""What a model with given parameters leaves of the command on a recording it was not fitted to."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import CommandPath
from motorctl.identify.columns.filters import second_difference
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.position_noise import choose_band_hz
from motorctl.identify.columns.signals import make_signals
from motorctl.model import EffectList

Array = NDArray[np.float64]


def force_error_rms(
    data: Measured,
    model: EffectList,
    theta: Array,
    corrected_by: Collection[str] = (),
) -> float:
    """Return the rms of the command minus the model at the measured motion, over the moving rows.

    theta (n,) in the order of `model`; in units of the command. `corrected_by` names the effects
    of the measurement that the recorded position is free of already. Raises DataError where the
    recording is too short.
    """
    data = corrected(data, model, corrected_by)
    signals = make_signals(data, choose_band_hz(data))
    path = CommandPath(model.delay_s, model.lag_s)
    # at the full rate: the raw second difference has noise far above the band
    acceleration = [second_difference(s.position, signals.period_s) for s in signals.stretches]
    psi, command = signals.regression(model, path, acceleration)
    return float(np.sqrt(np.mean((command - theta @ psi) ** 2)))


def corrected(data: Measured, model: EffectList, corrected_by: Collection[str] = ()) -> Measured:
    """Take the errors of the measurement out of the position, but for those that are out."""
    errors = [e for e in model.effects if e.kind == "measurement" and e.name not in corrected_by]
    if not errors:
        return data
    correct = EffectList(errors).kernels.correct
    return replace(data, position=np.array([correct(y) for y in data.position]))
