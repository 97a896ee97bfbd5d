"""A learning as the JSON document of ``learn --json``."""

from __future__ import annotations

from typing import Any

from motorctl.json_values import plain
from motorctl.learn.learning import Learning


def learning_document(learning: Learning) -> dict[str, Any]:
    """Return the document: trials, filters and what is kept, with units in the keys."""
    filters = learning.filters
    document: dict[str, Any] = plain(
        {
            "axis": learning.axis,
            "program": learning.program,
            "trials": [
                {
                    **trial.noted.model_dump(),
                    "does_not_repeat_rms_m": trial.repetition.left_over_rms_m,
                    "noise_of_mean_rms_m": trial.repetition.noise_of_mean_m,
                    "cycles": len(trial.repetition.error),
                }
                for trial in learning.trials
            ],
            "best": learning.best,
            "ended": learning.ended,
            "corner_hz": filters.corner_hz,
            "bound_by": filters.bound_by,
            "largest_left_over": float(filters.shrinks_at_worst.max()),
            "limit_v": learning.limit_v,
            "at_limit": learning.at_limit,
            "learned_peak_v": max(map(abs, learning.volts)),
        }
    )
    return document
