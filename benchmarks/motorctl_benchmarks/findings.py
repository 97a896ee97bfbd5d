"""What a subject of the bench found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from motorctl.latency.figure import Figure


@dataclass(frozen=True)
class Findings:
    """Figures, and what to know of them."""

    figures: tuple[Figure, ...]
    notes: tuple[str, ...]
    mistakes: tuple[Mapping[str, str], ...] = ()
    """Cases that came out wrong: case, truth and answer."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """What else is told, as plain data by name."""
