"""The reliability diagram: how often names were right, over the confidence they were given with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import beta

from motorctl.errors import UsageError
from motorctl.picture_style import colour, panels_in_file
from motorctl_benchmarks.diagnosis.outcome_report import Scored
from motorctl_benchmarks.diagnosis.score import BIN_EDGES, Bin, calibration

INTERVAL = 0.68
"""Of the bars: that of one standard deviation. Convention."""
ALL = "all"


def draw_reliability(path: Path, outcomes: Mapping[str, Sequence[Scored]]) -> None:
    """Draw the share of right names over the stated confidence, and how many names there are.

    Parameters
    ----------
    path
        The picture, PNG.
    outcomes
        What was answered, by the name of a group of cases.

    Raises
    ------
    UsageError
        The file cannot be written.
    """
    every = [outcome for group in outcomes.values() for outcome in group]
    groups = {ALL: every} | (dict(outcomes) if len(outcomes) > 1 else {})
    try:
        with panels_in_file(2, path, height=3.4) as (_, (shares, counts)):
            shares.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linewidth=1.0, linestyle="--")
            shares.text(0.13, 0.08, "as stated", color="0.45")
            for k, (name, group) in enumerate(groups.items()):
                bins, error = calibration([(o.truth, o.answer) for o in group])
                if not bins:
                    continue
                number = sum(b.count for b in bins)
                label = f"{name}: {number} names, calibration error {100.0 * error:.1f} %"
                shares.errorbar(
                    [b.mean_confidence for b in bins],
                    [b.share_right for b in bins],
                    np.array([_bars(b) for b in bins]).T,
                    fmt="o-" if name == ALL else "o",
                    color=colour(k),
                    linewidth=1.8 if name == ALL else 0.9,
                    alpha=1.0 if name == ALL else 0.6,
                    markersize=6 if name == ALL else 4,
                    capsize=2,
                    label=label,
                )
            shares.set(ylabel="share of names that were right", ylim=(-0.03, 1.03), xlim=(0, 1.01))
            shares.legend(loc="upper left", fontsize=8)
            shares.set_title("Confidence of a name, and how often it was right", loc="left")
            stated = [named.confidence for o in every for named in o.answer.named]
            edges = np.linspace(0.0, 1.0, 21)
            counts.hist(stated, bins=edges.tolist(), color=colour(1), edgecolor="white")
            for edge in BIN_EDGES[1:-1]:
                counts.axvline(edge, color="0.7", linewidth=0.8)
            counts.set(xlabel="confidence stated", ylabel="names")
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None


def _bars(b: Bin) -> tuple[float, float]:
    """Return how far the share may be from that of many names, below and above (Jeffreys)."""
    right = round(b.count * b.share_right)
    at = beta(right + 0.5, b.count - right + 0.5)
    low, high = at.ppf(0.5 - INTERVAL / 2.0), at.ppf(0.5 + INTERVAL / 2.0)
    return max(b.share_right - float(low), 0.0), max(float(high) - b.share_right, 0.0)
