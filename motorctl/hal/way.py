"""How far a channel's carriage can go and what it meets there, where a driver knows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Way:
    """What a simulated machine knows of the way of one channel, in the positions of its encoder.

    What is pressed beyond a place on one side has infinity for the other.
    """

    reach_m: tuple[float, float]
    """Beyond which no command brings it, end stops that give way included."""
    limit_switches_m: tuple[float, float] | None
    """At and below the first, and at and above the second, a limit switch is pressed."""
    home_switch_m: tuple[float, float] | None
    """Between which the home switch is pressed."""
    index_marks_m: tuple[float, ...]
    """Where the index marks are."""
    absolute: bool
    """Whether the encoder knows its position at power-on; else only homing tells it."""
