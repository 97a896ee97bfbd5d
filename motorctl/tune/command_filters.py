"""Filters of the command that are tried, where a measured response shows what rings."""

from __future__ import annotations

from motorctl.config.rules import HIGHEST_FILTER
from motorctl.control import CommandFilter, command_filter
from motorctl.tune.recorded_loop import RecordedLoop

NOTCH_DAMPING, NOTCH_DEPTH = (0.1, 0.3, 0.7), (0.03, 0.1, 0.3)
"""Of the notches that are tried on each resonance: a wide one bears a resonance that moves, a
narrow one turns the loop less."""
LOW_PASS_RATIOS, LOW_PASS_DAMPING = (0.5, 0.7, 1.0, 1.4, 2.0), 0.7
"""Of the low-passes that are tried, over each resonance, and their damping."""
DIGITS = 4
"""Significant digits of their frequencies, as they are written."""


def filters_to_try(loop: RecordedLoop) -> list[CommandFilter]:
    """Return the filters that may let a loop go further: none where no part rings by its response.

    Notches on each resonance, and low-passes around it.
    """
    if loop.measured is None:
        return []
    highest = HIGHEST_FILTER / loop.period_s
    lines = [part.resonance_hz for part in loop.measured.measured.fitted.parts]
    tries = [
        *(("notch", line, damping, depth)
          for line in lines for damping in NOTCH_DAMPING for depth in NOTCH_DEPTH),
        *(("low_pass", line * ratio, LOW_PASS_DAMPING, 1.0)
          for line in lines for ratio in LOW_PASS_RATIOS),
    ]  # fmt: skip
    return [
        command_filter(kind, float(f"{hz:.{DIGITS}g}"), damping, depth, loop.period_s)
        for kind, hz, damping, depth in tries
        if hz <= highest
    ]
