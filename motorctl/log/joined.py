"""Recordings of one machine made one after the other, as one recording with gaps in its time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import pairwise
from typing import Any

import numpy as np

from motorctl.errors import DataError
from motorctl.log.recording import AxisRecording, Recording


def joined(recordings: Sequence[Recording]) -> Recording:
    """Return recordings, in order of time, as one; nothing is said of the time between them.

    Raises
    ------
    DataError
        Where they are not of the same axes at one rate, or one begins before another has ended.
    """
    first = recordings[0]
    if len(recordings) == 1:
        return first
    for before, after in pairwise(recordings):
        if set(after.axes) != set(first.axes) or after.sample_rate_hz != first.sample_rate_hz:
            raise DataError(f"{after.source}: its axes or its rate are not those of {first.source}")
        if after.time_s[0] <= before.time_s[-1]:
            raise DataError(
                f"{after.source} begins at {after.time_s[0]:g} s, before {before.source} ends, at "
                f"{before.time_s[-1]:g} s: they are not of one run"
            )
    axes = {
        name: replace(axis, theta_hat={}, **_together([each.axes[name] for each in recordings]))
        for name, axis in first.axes.items()
    }
    parts = _together(list(recordings))
    metadata = recordings[-1].metadata
    return replace(first, axes=axes, metadata=metadata, **parts)


def _together(parts: Sequence[AxisRecording] | Sequence[Recording]) -> dict[str, Any]:
    """Return the arrays that all parts have, end to end; None for those that only some have."""
    together: dict[str, Any] = {}
    for each in fields(parts[0]):
        values = [getattr(part, each.name) for part in parts]
        if any(isinstance(value, np.ndarray) for value in values):
            whole = all(isinstance(value, np.ndarray) for value in values)
            together[each.name] = np.concatenate(values) if whole else None
    return together
