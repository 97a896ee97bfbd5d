"""Whether a machine adds what was written for it: the file that it reads, what its log shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config import Machine
from motorctl.errors import RunError, UsageError
from motorctl.learn.cycles import Repetition

LIKE = 0.1
"""Part of what was written by which what was added may differ, both rms: places in the log are
right within a tick, of which a cycle has thousands. Less trips over that, more takes the voltage of
the run before for this one's. By hand."""
FAINT_V = 1e-4
"""Voltage that nobody misses [V rms]: a twelfth of a step of 14 bits over 10 V. Less
trips over digits, more misses faint things. By hand."""


def require_same_file(machine: Machine, axis: str, place: Path, status: Mapping[str, Any]) -> None:
    """Insist that a daemon adds what a file has: it reads the one beside its own configuration.

    Parameters
    ----------
    machine
        The configuration here; the daemon's has the same keys.
    axis
        Its axis, which learns.
    place
        The file that would be written.
    status
        What the daemon answered to `status`.

    Raises
    ------
    UsageError
        Where it reads another one.
    """
    learning = machine.axes[axis].learning
    assert learning is not None  # as `require_learning` has seen
    config = Path(status["daemon"]["config"])
    read = config.parent / learning.file
    if read.resolve() != place.resolve():
        raise UsageError(
            f"{machine.source}: what is learned would be written to {place}, and the daemon reads "
            f"{read}, beside its own configuration: name that one: --config {config}"
        )


def require_added(
    repetition: Repetition, written: NDArray[np.float64], notes: Sequence[str]
) -> None:
    """Insist that the log of a run shows the voltage that was written for it.

    Parameters
    ----------
    repetition
        The run.
    written
        One cycle, evenly spaced [V].
    notes
        What the machine said of it when the program began.

    Raises
    ------
    RunError
        Where it shows another.
    """
    points = repetition.points
    places = np.arange(points) / points
    own = np.arange(len(written)) / len(written)
    expected = np.interp(places, own, written, period=1.0)
    off_v, whole_v = _rms(repetition.learned - expected), _rms(expected)
    if off_v > max(LIKE * whole_v, FAINT_V):
        told = f": {'; '.join(notes)}" if notes else ""
        raise RunError(
            f"axis {repetition.axis} added {_rms(repetition.learned):.3g} V rms, and not the "
            f"{whole_v:.3g} V rms that were written for it{told}"
        )


def _rms(volts: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(volts**2)))
