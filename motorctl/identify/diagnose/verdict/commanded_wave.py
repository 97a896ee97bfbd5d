"""Waves over time that are the command itself: a force that takes back what was commanded.

Where the command is hardly more than one sine, a disturbance of that frequency can cancel it. It
then says no more than that the command does not move the axis, whatever does.
"""

from __future__ import annotations

import math

import numpy as np

from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.search import Found, with_final

ALL_OF_COMMAND = 0.9
"""Part of the command's variance that waves may take before they count as the command itself.
Larger names forces that cancel what was commanded, smaller doubts fans and pumps that a loop at
rest answers. Chosen by hand: an arm that is driven by one sine has 0.986."""


def without_commanded_waves(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without waves over time that are the command, and why for each."""
    notes = []
    for effect in found.final.added:
        if "wave_over_time" not in effect.groups:
            continue
        share = share_of_command(found.final.regressors.signals, effect.lines)
        if share < ALL_OF_COMMAND:
            continue
        found = with_final(found, found.final.without(effect.name).refreshed())
        lines = ", ".join(f"{line:.4g} Hz" for line in effect.lines)
        notes.append(
            f"{effect.name} is refuted: the command itself is a sine of {lines} "
            f"({100.0 * share:.0f} % of its variance, limit {100.0 * ALL_OF_COMMAND:g} %), and a "
            "force that cancels it is not known from one that never came. Record a motion with "
            "other frequencies"
        )
    return found, tuple(notes)


def share_of_command(signals: Signals, lines_hz: tuple[float, ...]) -> float:
    """Return the part of the command's variance that sines of these frequencies take, 0 to 1.

    Parameters
    ----------
    signals
        The axis' motion and command.
    lines_hz
        Frequencies [Hz].
    """
    t = np.concatenate([stretch.time_s for stretch in signals.stretches])
    u = np.concatenate([stretch.command for stretch in signals.stretches])
    angles = [2.0 * math.pi * line * t for line in lines_hz]
    columns = np.stack([f(angle) for angle in angles for f in (np.sin, np.cos)], axis=1)
    u, columns = u - u.mean(), columns - columns.mean(axis=0)
    left = u - columns @ np.linalg.lstsq(columns, u, rcond=None)[0]
    return float(1.0 - left @ left / max(float(u @ u), 1e-300))
