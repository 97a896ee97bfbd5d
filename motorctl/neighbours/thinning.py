"""Fewer rows that lose no peak: of each stretch of rows the least and the greatest value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
TIME = "time_s"


def stretch_rows(row_rate_hz: float, message_rate_hz: float) -> int:
    """Return of how many rows two messages are made; 1: each row is one.

    Parameters
    ----------
    row_rate_hz, message_rate_hz
        Of the rows that there are, and at most of the messages that are wanted.
    """
    if message_rate_hz >= row_rate_hz:
        return 1
    return max(2, int(np.ceil(2.0 * row_rate_hz / message_rate_hz - 1e-9)))


def thinned(columns: Mapping[str, Array], rows: int) -> dict[str, Array]:
    """Return two rows for each stretch of rows, with the extremes of each column in their order.

    Numbers have their least and greatest value, in the order in which they came; of words of bits,
    which are unsigned, the first row has all that were set in the first half, the second row those
    of the second. The times are those at a quarter and at three quarters.

    Parameters
    ----------
    columns
        Shape (N,) each, `time_s` among them.
    rows
        Of a stretch, from `stretch_rows`; what is over N's last whole one is left.

    Returns
    -------
    dict
        Shape (2 N // rows,) each; with rows of 1 (N,).
    """
    if rows == 1:
        return dict(columns)
    whole = len(columns[TIME]) // rows
    return {
        name: _extremes(name, values[: whole * rows].reshape(whole, rows))
        for name, values in columns.items()
    }


def _extremes(name: str, values: Array) -> Array:
    rows = values.shape[1]
    if name == TIME:
        return values[:, [rows // 4, 3 * rows // 4]].ravel()
    if values.dtype.kind == "u":
        halves = (values[:, : rows // 2], values[:, rows // 2 :])
        return np.column_stack([np.bitwise_or.reduce(half, axis=1) for half in halves]).ravel()
    low, high = np.fmin.reduce(values, axis=1), np.fmax.reduce(values, axis=1)
    falls = _first(values, low) > _first(values, high)
    pairs = np.where(falls[:, None], np.column_stack([high, low]), np.column_stack([low, high]))
    return pairs.ravel()


def _first(values: Array, wanted: Array) -> Array:
    return np.asarray(np.argmax(values == wanted[:, None], axis=1))
