"""Times that a command may need until it acts."""

from __future__ import annotations

from motorctl.model.grids import log_grid
from motorctl.model.knowledge import Spans

PER_DECADE = 8
"""Times that are tried, a decade. More takes time, fewer starts the refinement too far away. Chosen
by hand: each is about a third longer than the last."""

LONGEST_LINK_S = 0.25
"""The longest lag or delay that is sought [s] of a recording of many samples a second: what links
over USB, radio or a busy computer take, and filters. More takes time and lets a delay stand for
what repeats; less misses them, or calls a long lag a delay. Chosen by hand: recordings of others
have 30 to 130 ms at 200 to 1000 samples a second."""


def trial_times(spans: Spans) -> list[float]:
    """Return the times [s] that are worth trying, for a lag or a delay.

    Amplifiers and buses take 0.05 to 5 ms. Less than a twentieth of a sample cannot be seen, and
    slowly sampled machines may be slow themselves.
    """
    low, high = max(5e-5, 0.05 * spans.period_s), max(5e-3, 20.0 * spans.period_s)
    return log_grid(low, min(high, spans.duration_s / 10.0, 10.0), PER_DECADE)


def longer_trial_times(spans: Spans) -> list[float]:
    """Return times [s] beyond `trial_times`, up to what a slow link takes."""
    longest = max(trial_times(spans), default=0.0)
    high = min(LONGEST_LINK_S, spans.duration_s / 10.0)
    return [time for time in log_grid(longest, high, PER_DECADE) if time > longest]
