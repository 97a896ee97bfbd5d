"""Waves over time that are the command itself: a force that takes back what was commanded.

Where the command is hardly more than a few sines, a disturbance of the frequency of one of them can
cancel it. It then says no more than that this part of the command does not move the axis, whatever
does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.signals import Signals
from motorctl.identify.diagnose.search.search import Found, with_final
from motorctl.identify.diagnose.search.spectral_lines import without_sines

Array = NDArray[np.float64]

ALL_OF_COMMAND = 0.9
"""Part of the command's variance that waves may take before they count as the command itself.
Larger names forces that cancel what was commanded, smaller doubts fans and pumps that a loop at
rest answers. Chosen by hand: an arm that is driven by one sine has 0.986."""
OTHER_SINES = 3
"""Sines beside those of the waves that a command may consist of. Larger takes the harmonics of
repeated moves for sines that were asked for, smaller names what cancels one of many tones. Chosen
by hand: tests of motors command two to four."""
OWN_PART = 0.2
"""Part of the command's variance that the waves' own sines must have, beside the others. Larger
names what cancels a weak tone, smaller refutes forces that a loop answers. Chosen by hand: each of
four equal tones has a quarter."""
LONGEST_GAPS = 4.0
"""Length of a recording with its gaps, over that of its rows, up to which lines are sought in it.
Larger takes memory, smaller leaves recordings of few stretches to the old rule. Chosen by hand."""
POINTS_A_LINE = 8
"""Frequencies tried for each that the recording tells apart. Fewer leave a part of a sine, more
take time. Arithmetic: at a sixteenth of a line's width 0.3 % of its variance are left."""


def without_commanded_waves(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without waves over time that are the command, and why for each."""
    notes = []
    for effect in found.final.added:
        if "wave_over_time" not in effect.groups:
            continue
        signals = found.final.regressors.signals
        # Behind a reference a loop's own answer to a force is a sine of the command, too.
        others = other_sines(signals, effect.lines) if signals.data.reference is None else ()
        share = share_of_command(signals, (*effect.lines, *others))
        own = share - share_of_command(signals, others)
        if share < ALL_OF_COMMAND or own < OWN_PART:
            continue
        found = with_final(found, found.final.without(effect.name).refreshed())
        lines = ", ".join(f"{line:.4g} Hz" for line in (*effect.lines, *others))
        sines = "sines of" if len(effect.lines) + len(others) > 1 else "a sine of"
        notes.append(
            f"{effect.name} is refuted: the command itself is {sines} {lines} "
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
    t, u = _command(signals)
    left = without_sines(t, u, lines_hz)
    return float(1.0 - left @ left / max(float(u @ u), 1e-300))


def other_sines(signals: Signals, lines_hz: tuple[float, ...]) -> tuple[float, ...]:
    """Return the frequencies of the strongest sines of the command beside some [Hz].

    As many as make the command `ALL_OF_COMMAND`, or `OTHER_SINES`.
    """
    t, u = _command(signals)
    found: tuple[float, ...] = ()
    place = np.round((t - t[0]) / signals.row_period_s).astype(np.int64)  # gaps count as time
    rows = int(place[-1]) + 1
    if rows > LONGEST_GAPS * len(u):
        return ()
    hz = np.fft.rfftfreq(POINTS_A_LINE * rows, signals.row_period_s)
    while len(found) < OTHER_SINES:
        left = without_sines(t, u, (*lines_hz, *found))
        if left @ left <= (1.0 - ALL_OF_COMMAND) * (u @ u):
            break
        power = np.abs(np.fft.rfft(np.bincount(place, left), POINTS_A_LINE * rows))
        found = (*found, float(hz[1 + np.argmax(power[1:])]))
    return found


def _command(signals: Signals) -> tuple[Array, Array]:
    """Return times [s] and the command about its mean at the rate of the rows, both (m,)."""
    d = signals.decimation
    t, u = (
        np.concatenate([c[: len(c) // d * d].reshape(-1, d).mean(axis=1) for c in columns])
        for columns in zip(*((s.time_s, s.command) for s in signals.stretches), strict=True)
    )
    return t, u - u.mean()
