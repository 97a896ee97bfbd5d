"""One linear parameter of an effect: its name, symbol and unit, bounds, and what it begins with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """One linear parameter theta of an effect."""

    name: str
    """Unique within the effect; empty where the effect has this parameter only."""
    symbol: str
    unit: str
    lower: float
    """Widest bounds that make physical sense, unless the configuration gives narrower ones."""
    upper: float
    initial: float
    covariance: float
    """Default initial diagonal of Gamma: how far from `initial` the truth may lie, squared."""
