"""What a model leaves of the command, and how parameters make up for one that changes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
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
    psi, command = _columns(corrected(data, model, corrected_by), model)
    return float(np.sqrt(np.mean((command - theta @ psi) ** 2)))


def made_up_for(
    data: Measured,
    model: EffectList,
    change: Array,
    free: Sequence[int],
    corrected_by: Collection[str] = (),
) -> Array:
    """Return how much free parameters change to explain what a change of others no longer does.

    Parameters that were fitted together belong together: where some of them cannot stay, as those
    of an input map that turns back before the voltage limit, the rest moves along what the
    recording cannot tell apart.

    Parameters
    ----------
    data
        The recording that they were fitted to.
    model
        Its effects, with n parameters.
    change
        Of each parameter, (n,), in its own unit; zero where there is none.
    free
        Which parameters make up for it.
    corrected_by
        As of `force_error_rms`.

    Returns
    -------
    ndarray
        Change of every parameter, (n,): the given one, and that of the free ones.

    Raises
    ------
    DataError
        Where the recording is too short.
    """
    psi, _ = _columns(corrected(data, model, corrected_by), model)
    scale = np.linalg.norm(psi, axis=1)
    able = [k for k in free if scale[k] > 0.0]
    unit = (psi[able].T / scale[able]) if able else np.zeros((psi.shape[1], 0))
    moved = np.linalg.lstsq(unit, -(change @ psi), rcond=None)[0]
    found = change.astype(float)
    found[able] += moved / scale[able]
    return found


def _columns(data: Measured, model: EffectList) -> tuple[Array, Array]:
    """Return psi (n, m) of the model and the command (m,), over the moving rows."""
    signals = make_signals(data, choose_band_hz(data))
    path = CommandPath(model.delay_s, model.lag_s)
    # at the full rate: the raw second difference has noise far above the band
    acceleration = [second_difference(s.position, signals.period_s) for s in signals.stretches]
    return signals.regression(model, path, acceleration)


def corrected(data: Measured, model: EffectList, corrected_by: Collection[str] = ()) -> Measured:
    """Take the errors of the measurement out of the position, but for those that are out."""
    errors = [e for e in model.effects if e.kind == "measurement" and e.name not in corrected_by]
    if not errors:
        return data
    correct = EffectList(errors).kernels.correct
    return replace(data, position=np.array([correct(y) for y in data.position]))
