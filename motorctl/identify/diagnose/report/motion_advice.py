"""The motion that would show what a recording could not show, as the keys of a program file.

Two effects look alike where the motion ties what they depend on together. So each recipe unties
one pair: two speeds part time from place, two accelerations part the command from place, slow
reversals part what friction does within micrometres from what it does with speed, and moves at
random part everything a little.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.axis_units import LINEAR, AxisUnits
from motorctl.identify.columns.measured import Measured
from motorctl.model import Effect, Spans
from motorctl.model.knowledge import Motion

Array = NDArray[np.float64]
Program = dict[str, object]

CLEARANCE = 0.02
"""Part of the travel that is kept free at either end. Larger shows less of the travel, smaller
risks the soft limits by an overshoot. Chosen by hand."""
BELOW = 0.999
"""Factor on limits before they are rounded to four digits, so that what is written does not exceed
what was used. Rounding adds at most half a unit of the fourth digit, 0.05 %; arithmetic. Smaller
wastes speed."""
RISE_S = 0.02
"""Time in which the acceleration rises where the recording does not tell the jerk [s]. Smaller
excites flexible modes, larger makes moves too gentle to tell inertia. Chosen by hand."""
SHORTEST_RISE_S = 0.004
"""Shortest such time that is taken from a recording [s]. Smaller takes noise of the reference for
jerk, larger slows hard machines. Chosen by hand."""
LONGEST_RISE_S = 10.0
"""Longest such time [s]: a smaller jerk in the recording is taken for none. Smaller ignores very
gentle references, larger lets rounding set the jerk. Chosen by hand."""
ROAMING_MOVES = 24
"""Moves at random in a recommended motion. Fewer visit too few places, more take time. Chosen by
hand."""
LONG_RUNS = 3.0
"""A slow change shows in a run that is this many times longer than the recording. Smaller may not
show it, larger takes the machine's time. Chosen by hand."""
LONGEST_S = 900.0
"""Longest run that is recommended [s]: a quarter of an hour. Larger takes the machine's time,
smaller may miss warming up. Chosen by hand."""
GOLDEN = 0.6180339887498949
"""Golden ratio's fraction, (sqrt(5) - 1) / 2: its multiples fill the range from 0 to 1 evenly and
never repeat. Larger or smaller ones leave places out. Arithmetic."""
STRIDES = (1.0, 2.3, 3.7, 5.1)
"""Multiples of the golden ratio by which target, speed, acceleration and pause go on from move to
move. Nearer to each other, or in whole ratios, they tie what the moves are to part. Chosen by
hand."""
LONGEST_PAUSE_S = 0.4
"""Longest pause after a move at random [s]. Longer takes the machine's time, shorter shows little
of what happens at rest. Chosen by hand."""
MOVES_PER_PAUSE = 3
"""One move at random in so many has a pause after it. More shows less of what happens at rest,
fewer takes the machine's time. Chosen by hand."""
SLOWEST_SHARE = 0.15
"""Slowest move at random, as a part of the speed. Larger ties place to time, smaller takes the
machine's time. Chosen by hand."""
GENTLEST_SHARE = 0.3
"""Gentlest move at random, as a part of the acceleration. Larger ties the command to place, smaller
hardly tells inertia. Chosen by hand."""
LEANING = 0.5
"""Exponent on what is drawn for the acceleration, from 0 to 1. Nearer to 1 makes more gentle moves,
which tell inertia less, smaller leaves hardly any. Chosen by hand."""
CROSSING_SPEEDS = (1.0, 0.5, 0.1)
"""Speeds at which the travel is crossed, as parts of the speed. Nearer to each other they do not
part time from place, more of them or slower ones take the machine's time. Chosen by hand."""
CROSSING_ACCELERATION = 0.8
"""Acceleration of these crossings, as a part of the acceleration. Larger is as hard as the
recording ever was, smaller leaves less of the way at full speed. Chosen by hand."""
CROSSING_DWELL_S = 0.1
"""Rest after each crossing back [s]. Longer takes the machine's time, shorter lets one crossing's
oscillation into the next. Chosen by hand."""
COMMANDS = (1.0, 0.25)
"""Accelerations with which the same places are crossed, as parts of the acceleration. Nearer to
each other they do not part the command from place, smaller ones are lost in friction. Chosen by
hand."""
COMMAND_SPEED = 0.8
"""Speed of these moves, as a part of the speed. Larger is as fast as the recording ever was,
smaller spends less of the way on accelerating. Chosen by hand."""
COMMAND_PLACES = (1.0, 0.0, 0.55, 0.1, 0.7, 0.3)
"""Shares of the travel at which these moves end, one after the other. More takes the machine's
time, fewer passes the same places with too few commands. Chosen by hand."""


@dataclass(frozen=True)
class Reach:
    """What a motion may use: in m, m/s, m/s^2 and m/s^3, of a rotary axis in rad."""

    low: float
    high: float
    speed: float
    acceleration: float
    jerk: float
    units: AxisUnits = LINEAR

    @property
    def travel(self) -> float:
        """Length of the way."""
        return self.high - self.low

    def at(self, share: float) -> float:
        """Return the position at a share of the travel."""
        return self.low + min(max(share, 0.0), 1.0) * self.travel


@dataclass(frozen=True)
class Stroke:
    """A move to rest at a share of the travel, with shares of speed and acceleration."""

    to: float
    speed: float = 1.0
    acceleration: float = 1.0
    dwell_s: float = 0.0


Recipe = Callable[[Reach], Iterator[Stroke]]


def roam(_: Reach, moves: int = ROAMING_MOVES, begin: float = 0.0) -> Iterator[Stroke]:
    """Move at random through the travel, with speeds, accelerations and pauses of their own."""
    for k in range(1, moves + 1):
        share = [(begin + k * GOLDEN * stride) % 1.0 for stride in STRIDES]
        pause_s = LONGEST_PAUSE_S * share[3] if k % MOVES_PER_PAUSE == 0 else 0.0
        speed = SLOWEST_SHARE + (1.0 - SLOWEST_SHARE) * share[1]
        acceleration = GENTLEST_SHARE + (1.0 - GENTLEST_SHARE) * share[2] ** LEANING
        yield Stroke(share[0], speed, acceleration, pause_s)


def two_speeds(_: Reach) -> Iterator[Stroke]:
    """Cross the travel at full, half and a tenth of the speed: time against place."""
    for speed in CROSSING_SPEEDS:
        yield Stroke(1.0, speed, CROSSING_ACCELERATION)
        yield Stroke(0.0, speed, CROSSING_ACCELERATION, CROSSING_DWELL_S)


def two_accelerations(_: Reach) -> Iterator[Stroke]:
    """Cross the same places with full and a quarter of the command: command against place."""
    for acceleration in COMMANDS:
        for to in COMMAND_PLACES:
            yield Stroke(to, COMMAND_SPEED, acceleration)


def slow_reversals(reach: Reach) -> Iterator[Stroke]:
    """Turn round slowly after short ways, at three places: micrometres against speed."""
    for middle in (0.2, 0.5, 0.8):
        yield Stroke(middle, 0.5, 0.5, 0.1)
        for speed in (0.003, 0.01, 0.03, 0.1):
            # A second or less each way, so that most of the time belongs to the reversals.
            way = min(0.05, 0.6 * speed * reach.speed / reach.travel)
            for _ in range(2):
                yield Stroke(middle + way / 2, speed, 0.2)
                yield Stroke(middle - way / 2, speed, 0.2)


def fast_reversals(reach: Reach) -> Iterator[Stroke]:
    """Turn round with full acceleration and jerk: fast dynamics against slow ones."""
    for speed in (0.7, 0.4, 0.2):
        way = min(0.9, 1.2 * (speed * reach.speed) ** 2 / reach.acceleration / reach.travel)
        for middle in (0.5, 0.5 - way / 4, 0.5 + way / 4):
            yield Stroke(middle + way / 2, speed, 1.0)
            yield Stroke(middle - way / 2, speed, 1.0)


RECIPES: Mapping[Motion, Recipe] = {
    "two_speeds": two_speeds,
    "two_accelerations": two_accelerations,
    "slow_reversals": slow_reversals,
    "fast_reversals": fast_reversals,
}
"""Besides these there is always some roaming; a longer run repeats it all."""


def advise(effects: Sequence[type[Effect]], data: Measured, spans: Spans) -> Program:
    """Return the keys of a program file that would show `effects` and tell them apart.

    One axis, within the travel, speed and acceleration that the recording used; other axes should
    follow programs of their own meanwhile, begun at another time. Empty where the axis did not
    move.
    """
    reach = _reach(data, spans)
    if reach is None:
        return {}
    motions = dict.fromkeys(motion for cls in effects for motion in cls.revealed_by)
    recipes = [RECIPES[motion] for motion in motions if motion in RECIPES]
    strokes = [*roam(reach), *(stroke for recipe in recipes for stroke in recipe(reach))]
    program = program_keys(data.axis, reach, strokes)
    if "longer_run" in motions:
        wanted_s = min(LONG_RUNS * spans.duration_s, LONGEST_S)
        program["cycles"] = max(1, math.ceil(wanted_s / duration_s(reach, strokes)))
    return program


def program_keys(axis: str, reach: Reach, strokes: Sequence[Stroke]) -> Program:
    """Write strokes as the keys of a program of moves that ends where it starts."""
    start = _rounded(reach.at(0.5), reach)
    moves = [
        {
            "target_m": _rounded(reach.at(stroke.to), reach),
            "max_velocity_m_s": _below(stroke.speed * reach.speed),
            "max_acceleration_m_s2": _below(stroke.acceleration * reach.acceleration),
            "max_jerk_m_s3": _below(reach.jerk),
            "dwell_s": round(stroke.dwell_s, 3),
        }
        for stroke in (*strokes, Stroke(0.5, 0.5, 0.5, 0.2))
    ]
    moves[-1]["target_m"] = start
    return {"kind": "moves", "axis": axis, "start_m": start, "moves": moves}


def duration_s(reach: Reach, strokes: Sequence[Stroke]) -> float:
    """Return about how long the strokes take."""
    total, at = 0.0, 0.5
    for stroke in strokes:
        distance = abs(stroke.to - at) * reach.travel
        speed = max(stroke.speed * reach.speed, 1e-12)
        acceleration = stroke.acceleration * reach.acceleration
        speed = min(speed, math.sqrt(distance * acceleration) or speed)
        total += distance / speed + speed / acceleration + stroke.dwell_s
        at = stroke.to
    return total


def _reach(data: Measured, spans: Spans) -> Reach | None:
    low, high = spans.position_m
    speed, acceleration = spans.speed_m_s, spans.acceleration_m_s2
    numbers = (low, high, speed, acceleration)
    if not (all(map(math.isfinite, numbers)) and high > low and min(speed, acceleration) > 0.0):
        return None
    jerk = acceleration / RISE_S
    if data.reference_velocity is not None and len(data.reference_velocity) > 2:
        told = np.abs(np.diff(data.reference_velocity, 2))[data.usable[2:]] / data.period_s**2
        told = told[told > acceleration / LONGEST_RISE_S]
        if len(told):
            # Not the largest: where a reference was broken off, it stepped.
            jerk = min(float(np.quantile(told, 0.9)), acceleration / SHORTEST_RISE_S)
    free = CLEARANCE * (high - low)
    return Reach(low + free, high - free, speed, acceleration, jerk)


def _below(value: float) -> float:
    return float(f"{BELOW * value:.4g}")


def _rounded(position: float, reach: Reach) -> float:
    digits = max(0, 4 - math.floor(math.log10(reach.travel)))
    return round(position, digits)
