"""Values as JSON can hold them, which has neither infinity nor NaN nor arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def finite(value: float | np.floating[Any] | None) -> float | None:
    """Return a number as JSON can hold it: None for what is not finite, and for None."""
    return float(value) if value is not None and math.isfinite(value) else None


def plain(value: Any) -> Any:
    """Return a document of mappings, sequences and arrays whose numbers JSON can hold."""
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return finite(value) if isinstance(value, float) else value
