"""The motions of the campaign, within the limits of a configuration's axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

from motorctl.motion import point_to_point
from motorctl_benchmarks.diagnosis.draw import Draw

Motion = Literal["rich", "repeated", "synchronised"]
Options = dict[str, Any]

DURATION_S = 24.0
LONGEST_JERK_TIME_S = 0.020
END_MARGIN_M = 0.005
START_GRID_M = 1e-6
"""Starts lie on encoder counts, so that an axis starts its program where it stands."""


@dataclass(frozen=True)
class Reach:
    """Where an axis may go, and how fast."""

    low_m: float
    high_m: float
    velocity_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float

    @classmethod
    def of(cls, limits: Mapping[str, Any]) -> Reach:
        """Take the limits of an axis in a configuration; keeps a little off its ends."""
        low, high = limits["travel_m"]
        return cls(
            low + END_MARGIN_M,
            high - END_MARGIN_M,
            limits["max_velocity_m_s"],
            limits["max_acceleration_m_s2"],
            limits["max_jerk_m_s3"],
        )

    @property
    def span_m(self) -> float:
        """Length of the way."""
        return self.high_m - self.low_m

    def within(self, other: Reach) -> Reach:
        """Return this reach, slowed down until `other` can do the same on its own scale."""
        scale = other.span_m / self.span_m
        return Reach(
            self.low_m,
            self.high_m,
            min(self.velocity_m_s, other.velocity_m_s / scale),
            min(self.acceleration_m_s2, other.acceleration_m_s2 / scale),
            min(self.jerk_m_s3, other.jerk_m_s3 / scale),
        )


def draw_programs(seed: int, motion: Motion, reaches: Mapping[str, Reach]) -> dict[str, Options]:
    """Draw a program for each axis, as a configuration writes it.

    - ``rich``: moves of different distance, speed and acceleration all over the travel: fast ones
      that use 60 to 100 % of the limits, medium ones, slow ones of 2 to 20 mm/s, small reversals;
      dwells between; each axis on its own
    - ``repeated``: one move back and forth, again and again, with one speed and period an axis
    - ``synchronised``: the moves of ``rich``, drawn once; every axis does them at the same time,
      scaled to its own travel
    """
    if motion == "repeated":
        periods: list[float] = []
        programs = {}
        for axis, reach in reaches.items():
            programs[axis] = _repeated(Draw(seed, motion, axis), axis, reach, periods)
            periods.append(programs[axis]["period_s"])
        return programs
    if motion == "rich":
        return {axis: _rich(Draw(seed, motion, axis), axis, r) for axis, r in reaches.items()}
    (lead, common), *others = reaches.items()
    for _, other in others:
        common = common.within(other)
    program = _rich(Draw(seed, motion), lead, common)
    return {axis: _scaled(program, axis, common, reach) for axis, reach in reaches.items()}


def _rich(draw: Draw, axis: str, reach: Reach) -> Options:
    start = place = _on_grid(draw.uniform(reach.low_m, reach.high_m))
    moves: list[Options] = []
    elapsed = 0.0
    while elapsed < DURATION_S:
        kind = draw.pick((_fast, _medium, _slow, _reversals), (5, 3, 2, 1))
        stops = [place]
        for target, velocity, acceleration in kind(draw, reach, place):
            stops.append(min(max(target, reach.low_m), reach.high_m))
            jerk = acceleration / draw.uniform(
                reach.acceleration_m_s2 / reach.jerk_m_s3, LONGEST_JERK_TIME_S
            )
            limits = velocity, acceleration, jerk
            dwell = draw.uniform(0.02, 0.4) if draw.chance(0.7) else 0.0
            elapsed += point_to_point(stops[-2], stops[-1], *limits).duration_s + dwell
            moves.append(
                {
                    "target_m": stops[-1],
                    "max_velocity_m_s": velocity,
                    "max_acceleration_m_s2": acceleration,
                    "max_jerk_m_s3": jerk,
                    "dwell_s": dwell,
                }
            )
        place = stops[-1]
    return {"kind": "moves", "axis": axis, "start_m": start, "moves": moves}


Wish = tuple[float, float, float]
"""Target [m], velocity [m/s], acceleration [m/s^2]."""


def _far(draw: Draw, reach: Reach, place: float, share: float) -> float:
    """Draw a target at least that share of the travel away."""
    room_up, room_down = reach.high_m - place, place - reach.low_m
    way = share * reach.span_m
    up = room_up > room_down if min(room_up, room_down) < way else draw.chance(0.5)
    return place + draw.uniform(way, room_up) if up else place - draw.uniform(way, room_down)


def _fast(draw: Draw, reach: Reach, place: float) -> list[Wish]:
    velocity = draw.uniform(0.5, 1.0) * reach.velocity_m_s
    acceleration = draw.uniform(0.6, 1.0) * reach.acceleration_m_s2
    return [(_far(draw, reach, place, 0.25), velocity, acceleration)]


def _medium(draw: Draw, reach: Reach, place: float) -> list[Wish]:
    velocity = draw.log_uniform(0.05, 0.5) * reach.velocity_m_s
    acceleration = draw.uniform(0.1, 0.6) * reach.acceleration_m_s2
    lasting_s = draw.uniform(0.3, 1.2)
    way = min(velocity * lasting_s, 0.45 * reach.span_m)
    return [(_towards_more_room(draw, reach, place, way), velocity, acceleration)]


def _slow(draw: Draw, reach: Reach, place: float) -> list[Wish]:
    velocity = draw.log_uniform(0.002, 0.020)
    acceleration = draw.log_uniform(0.05, 1.0)
    way = velocity * draw.uniform(0.6, 1.8)
    return [(_towards_more_room(draw, reach, place, way), velocity, acceleration)]


def _reversals(draw: Draw, reach: Reach, place: float) -> list[Wish]:
    way = draw.log_uniform(0.1e-3, 3e-3)
    velocity = draw.log_uniform(0.005, 0.05)
    acceleration = draw.log_uniform(0.2, 3.0)
    there = _towards_more_room(draw, reach, place, way)
    pairs = draw.whole(1, 3)
    return [(target, velocity, acceleration) for target in (there, place) * pairs]


def _towards_more_room(draw: Draw, reach: Reach, place: float, way: float) -> float:
    room_up, room_down = reach.high_m - place, place - reach.low_m
    up = room_up > room_down if min(room_up, room_down) < way else draw.chance(0.5)
    return place + way if up else place - way


def _repeated(draw: Draw, axis: str, reach: Reach, taken_s: list[float]) -> Options:
    distance = draw.uniform(0.4, 0.95) * reach.span_m
    start = _on_grid(draw.uniform(reach.low_m, reach.high_m - distance))
    velocity = draw.uniform(0.3, 1.0) * reach.velocity_m_s
    acceleration = draw.uniform(0.3, 1.0) * reach.acceleration_m_s2
    jerk_time = draw.uniform(reach.acceleration_m_s2 / reach.jerk_m_s3, LONGEST_JERK_TIME_S)
    way_s = distance / velocity + velocity / acceleration + jerk_time
    period = round(2.0 * way_s * draw.uniform(1.1, 1.8), 3)
    while any(abs(period / other - 1.0) < 0.02 for other in taken_s):
        period = round(1.05 * period, 3)
    return {
        "kind": "back_and_forth",
        "axis": axis,
        "start_m": start,
        "distance_m": distance,
        "max_velocity_m_s": velocity,
        "max_acceleration_m_s2": acceleration,
        "jerk_time_s": jerk_time,
        "period_s": period,
        "cycles": int(DURATION_S / period) + 1,
    }


def _scaled(program: Options, axis: str, drawn: Reach, reach: Reach) -> Options:
    scale = reach.span_m / drawn.span_m
    start = _on_grid(reach.low_m + scale * (program["start_m"] - drawn.low_m))
    # From the grid on by scaled differences: a rounded start must not change the first move's time.
    stops = [program["start_m"], *(move["target_m"] for move in program["moves"])]
    place, moves = start, []
    for (before, after), move in zip(pairwise(stops), program["moves"], strict=True):
        place += scale * (after - before)
        limits = {key: scale * move[key] for key in move if key.startswith("max_")}
        moves.append({"target_m": place, **limits, "dwell_s": move["dwell_s"]})
    return {"kind": "moves", "axis": axis, "start_m": start, "moves": moves}


def _on_grid(position_m: float) -> float:
    return round(position_m / START_GRID_M) * START_GRID_M
