"""Margins as a person writes them."""

from __future__ import annotations

import math
import re

from motorctl.errors import UsageError
from motorctl.tune.candidates import MarginsWanted

LEAST_DEG, MOST_DEG = 10.0, 85.0
"""Phase margins that may be asked for [degrees]: below, an error of the model of a sample makes the
loop swing; above, no loop with a double integrator goes."""
LEAST_DB, MOST_DB = 2.0, 30.0
"""Gain margins that may be asked for [dB], for the same reasons."""
FORM = re.compile(r"\s*(?P<deg>[0-9.]+)\s*deg\s*,\s*(?P<db>[0-9.]+)\s*dB\s*")


def margins_wanted(text: str, command_noise_v: float | None) -> MarginsWanted:
    """Return margins from words such as ``30deg,6dB``.

    Parameters
    ----------
    text
        Phase margin in degrees and gain margin in dB.
    command_noise_v
        Noise of the command at rest, at most [V rms]; None: not told.

    Returns
    -------
    MarginsWanted
        What the loop must keep.

    Raises
    ------
    UsageError
        Where the words or numbers make no sense.
    """
    found = FORM.fullmatch(text)
    try:
        phase_deg, gain_db = (float(found[key]) for key in ("deg", "db")) if found else (0.0, 0.0)
    except ValueError:
        found = None
    if found is None:
        raise UsageError(f"--margin {text}: should be a phase and a gain margin, as 30deg,6dB")
    if not LEAST_DEG <= phase_deg <= MOST_DEG or not LEAST_DB <= gain_db <= MOST_DB:
        raise UsageError(
            f"--margin {text}: should be {LEAST_DEG:g} to {MOST_DEG:g} deg and {LEAST_DB:g} to "
            f"{MOST_DB:g} dB"
        )
    if command_noise_v is not None and not 0.0 < command_noise_v < math.inf:
        raise UsageError(f"--command-noise {command_noise_v:g}: should be a voltage above 0")
    return MarginsWanted(phase_deg, 10.0 ** (gain_db / 20.0), command_noise_v)
