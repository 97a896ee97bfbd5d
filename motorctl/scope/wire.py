"""Arrays on their way to the page: one JSON line of what they are, and their numbers behind it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

NUMBER = np.dtype("<f8")


@dataclass(frozen=True)
class Answer:
    """What is told, and arrays of numbers."""

    told: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]

    def encoded(self) -> bytes:
        """Return a line of JSON, blank up to a multiple of 8 bytes, then float64, little-endian."""
        arrays = {name: np.asarray(values, NUMBER) for name, values in self.arrays.items()}
        lengths = [[name, len(values)] for name, values in arrays.items()]
        head = json.dumps({**self.told, "arrays": lengths}, allow_nan=False).encode()
        head += b" " * (-(len(head) + 1) % NUMBER.itemsize) + b"\n"
        return head + b"".join(values.tobytes() for values in arrays.values())
