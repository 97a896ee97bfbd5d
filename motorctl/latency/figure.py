"""A figure: one measured number, what it is compared with, and whether it is good enough."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal


@dataclass(frozen=True)
class Target:
    """What a figure should be."""

    of: Literal["value", "ratio"]
    relation: Literal[">=", "<=", "<"]
    limit: float

    def met_by(self, number: float) -> bool:
        """Tell whether a number is as it should be."""
        if self.relation == ">=":
            return number >= self.limit
        return number <= self.limit if self.relation == "<=" else number < self.limit

    def __str__(self) -> str:
        return f"{self.of} {self.relation} {self.limit:g}"


@dataclass(frozen=True)
class Figure:
    """One figure. `ratio` says how many times better than its peer the value is."""

    name: str
    title: str
    value: float
    unit: str
    peer: str | None = None
    peer_value: float | None = None
    """In the same unit; None where the peer was not measured."""
    ratio: float | None = None
    target: Target | None = None

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None where there is no target or nothing to judge it by."""
        if self.target is None:
            return None
        number = self.value if self.target.of == "value" else self.ratio
        return None if number is None or math.isnan(number) else self.target.met_by(number)

    def document(self) -> dict[str, Any]:
        """Return the figure as plain data."""
        target = self.target
        return {
            "name": self.name,
            "title": self.title,
            "value": self.value,
            "unit": self.unit,
            "peer": self.peer,
            "peer_value": self.peer_value,
            "ratio": self.ratio,
            "target": None
            if target is None
            else {"of": target.of, "relation": target.relation, "limit": target.limit},
            "met": self.met,
        }


def missed(figures: tuple[Figure, ...]) -> list[str]:
    """Say in one plain sentence each which targets are not met."""
    sentences = []
    for figure in figures:
        if figure.met is False:
            assert figure.target is not None
            of_ratio = figure.target.of == "ratio"
            number = figure.ratio if of_ratio else figure.value
            unit = "x" if of_ratio else figure.unit
            wanted = f"{figure.target.relation} {figure.target.limit:g} {unit}"
            sentences.append(f"{figure.title}: {number:.4g} {unit}, should be {wanted}")
    return sentences
