"""Recordings that do not determine even the declared model, whatever is left."""

from __future__ import annotations

import math

import numpy as np

from motorctl.identify.diagnose.result import ModelError
from motorctl.identify.diagnose.search.search import Found
from motorctl.identify.diagnose.verdict.confidence import DoubtedMember
from motorctl.identify.diagnose.verdict.driven_motion import one_move
from motorctl.identify.diagnose.verdict.verdict import Judged

DROWNED = 0.1
"""Part of the command that may be left where a clean twin leaves as much: beyond it the measurement
shows too little of any model. Larger calls poor recordings complete, smaller asks too much of
coarse encoders. Chosen by hand."""
MOSTLY_NOISE = 0.5
"""Part of the squared error that noise alone makes, from which it is told as the cause. Larger
blames the model for a coarse encoder, smaller the encoder for a poor model. Arithmetic: most."""
TINY = 1e-300
"""Least command that anything is divided by. Any other would do that is below every command and
above zero. Convention."""


def why_undetermined(
    found: Found, judged: Judged, error: ModelError, doubted: DoubtedMember | None
) -> str | None:
    """Return why no model can be told complete or lacking from a recording, or None.

    `doubted` is an effect that is not named and takes most of the error: with it the recording
    determines a model, where its kind is sure or what it leaves is less than no model leaves.
    """
    if (why := _drowned(found, judged)) or (doubted is not None and doubted.family is not None):
        return why
    beside = 1.0 if doubted is None else math.sqrt(1.0 - doubted.share)
    return _worse_than_nothing(found, error, beside) or _of_one_move(found, judged)


def _drowned(found: Found, judged: Judged) -> str | None:
    """Return why a measurement too coarse proves no model complete, or None."""
    left = over_command(found, found.base.held_out)
    if not judged.as_twin or left < DROWNED:
        return None
    return (
        f"the model leaves {100.0 * left:.0f} % of the command (limit {100.0 * DROWNED:.0f} %), "
        "and so would a machine that lacks nothing, behind this encoder and at this sample rate: a "
        "finer encoder, a faster rate or a quicker motion would show more"
    )


def _worse_than_nothing(found: Found, error: ModelError, beside: float) -> str | None:
    """Return why a recording does not determine even the declared parameters, or None.

    No model at all is a command that does not change: a load that an axis carries all the time is
    explained by any model, and by none. `beside` is the part of the error, rms, that is left beside
    an effect that is too unsure to be named.
    """
    regressors = found.final.regressors
    rows = found.final.problem.columns[:, regressors.command_column].ravel()
    changes = float(np.std(rows[: regressors.signals.rows]))
    if beside * error.held_out_after_rms <= min(changes, error.command_rms):
        return None
    part = 100.0 * error.held_out_after_rms / max(changes, TINY)
    noise = 100.0 * error.noise_floor_rms / max(changes, TINY)
    why = (
        f"noise of the measured position alone makes {noise:.0f} % of it: a finer encoder, or a "
        "quicker motion, would show more"
        if error.noise_floor_rms**2 > MOSTLY_NOISE * error.held_out_after_rms**2
        else "the motion does not determine its parameters, or sign, unit or model are not those "
        "of this machine"
    )
    return (
        f"fitted to one part of the recording, up to {regressors.signals.band_hz:.3g} Hz, the "
        f"model misses the command of the rest by {part:.0f} % of its changes (rms), and no model "
        f"at all would by 100 %: {why}"
    )


def _of_one_move(found: Found, judged: Judged) -> str | None:
    """Return why what is left and has no name is that of one move, which tells little, or None."""
    unnamed = judged.verdict == "unknown_structure" and not found.final.added
    return one_move(found.final.regressors.signals) if unnamed else None


def over_command(found: Found, squared: float) -> float:
    """Return the rms of what has this sum of squares over the command's."""
    return math.sqrt(squared / max(found.final.regressors.command_energy, TINY))
