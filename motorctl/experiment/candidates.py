"""Short motions among which the most telling one is chosen: each shows one thing well.

The pieces are those of the recipes that a report advises (`motion_advice`), cut short and at
several places, speeds and accelerations, so that each can be weighed by itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from motorctl.identify.diagnose.report.motion_advice import (
    Reach,
    Stroke,
    duration_s,
    program_keys,
    roam,
)
from motorctl.motion import Moves, Trajectory

PLACES = (0.2, 0.5, 0.8)
"""Shares of the travel at which short motions are tried. More take time to weigh, fewer miss what
acts at one end. By hand."""
REVERSAL_SPEEDS = (0.7, 0.3)
"""Of the speed, in reversals at full acceleration. By hand."""
REVERSALS = 4
"""Pairs of them in one candidate: about a second. By hand."""
CROSSINGS = (1.0, 0.4, 0.1)
"""Speeds at which most of the travel is crossed, as parts of the speed. By hand."""
SLOW_SPEEDS = (0.003, 0.01, 0.03, 0.1)
"""Speeds of short strokes to and fro, as parts of the speed. By hand."""
SLOW_S = 0.5
"""Each of these lasts about so long [s]: shorter ones are all turning round. By hand."""
GENTLE = 0.25
"""Smaller of two accelerations over the same way, as a part of the acceleration. By hand."""
ROAMING = 5
"""Moves at random in one candidate: about two seconds. By hand."""
LONGEST_S = 6.0
"""Longer motions are not weighed [s], but for the shortest of each kind: several short ones, each
chosen anew, tell more. By hand."""
LONGEST_OF_ALL_S = 600.0
"""Longer than this not even that one is [s]. Larger takes memory and minutes to weigh it, smaller
leaves more open on slow machines. By hand."""
PROBE_S = 2.0
"""Of such moves, in the motion to begin with [s]: cut to 3 s, the rich motion named most effects of
simulated gantries. Larger moves for what is known already, smaller leaves the first diagnosis too
few rows. By hand."""
HALVED = 8
"""How often the travel of these moves is halved at most, where they would last too long. More lets
slower machines begin with moves of micrometres. By hand."""
BEGINS = (0.11, 0.47, 0.83)
"""Of these moves: other places, speeds and accelerations each. By hand."""
MANY = 100.0
"""Speeds from this on are told without decimals [mm/s]; only looks depend on it."""
SETTLED_S = 0.15
"""Rest before and after a motion that is weighed [s]: what filters take from the ends. By hand."""


@dataclass(frozen=True)
class Candidate:
    """A motion that could be run."""

    kind: str
    """Of what pieces it is, in a word or two."""
    words: str
    """What it does, with numbers."""
    strokes: Mapping[str, tuple[Stroke, ...]]
    """By axis; an axis that is not named stands."""

    def program(self, axis: str, reach: Reach) -> dict[str, object]:
        """Return the keys of a program file of one of its axes; it ends where it starts."""
        return program_keys(axis, reach, self.strokes[axis])

    def trajectories(self, reaches: Mapping[str, Reach]) -> dict[str, Trajectory]:
        """Return the motion of each axis, those that stand included, all of one length."""
        moving = {
            axis: Moves.model_validate({**self.program(axis, reaches[axis]), "name": axis})
            for axis in self.strokes
        }
        paths = {axis: program.trajectories()[axis] for axis, program in moving.items()}
        longest_s = max(path.duration_s for path in paths.values())
        found = {}
        for axis, reach in reaches.items():
            path = paths.get(axis)
            if path is None:
                path = Trajectory.at_rest(float(f"{reach.at(0.5):.6g}"))
            before = Trajectory.at_rest(path.start_m, SETTLED_S)
            found[axis] = before.then(path).hold(SETTLED_S + longest_s - path.duration_s)
        return found

    def lasts_s(self, reaches: Mapping[str, Reach]) -> float:
        """Return how long it takes, with the way back to where it started."""
        paths = self.trajectories({axis: reaches[axis] for axis in self.strokes})
        return max(path.duration_s for path in paths.values()) - 2.0 * SETTLED_S


def candidates(axis: str, reaches: Mapping[str, Reach]) -> list[Candidate]:
    """Return motions that could tell something of an axis, within what each axis may use.

    Those that last no longer than LONGEST_S, and the shortest of each kind.
    """
    lasting = [(each.lasts_s(reaches), each) for each in _every(axis, reaches)]
    shortest: dict[str, float] = {}
    for seconds, each in lasting:
        shortest[each.kind] = min(seconds, shortest.get(each.kind, LONGEST_OF_ALL_S))
    return [each for seconds, each in lasting if seconds <= max(LONGEST_S, shortest[each.kind])]


def kinds(axis: str, reaches: Mapping[str, Reach]) -> frozenset[str]:
    """Return the kinds of motions that there are for an axis, however long they last."""
    return frozenset(each.kind for each in _every(axis, reaches))


def _every(axis: str, reaches: Mapping[str, Reach]) -> list[Candidate]:
    own = [
        Candidate(kind, words, {axis: tuple(strokes)})
        for kind, words, strokes in _of_one(reaches[axis])
    ]
    for other, reach in reaches.items():
        if other == axis:
            continue
        strokes = tuple(_reversals(reach, 0.5, REVERSAL_SPEEDS[0]))
        words = f"axis {other} turns round at full acceleration while {axis} "
        own.append(Candidate("other axis", words + "stands", {other: strokes}))
        slow = tuple(_to_and_fro(reaches[axis], 0.5, SLOW_SPEEDS[-1], REVERSALS))
        words += f"goes to and fro at {_speed(SLOW_SPEEDS[-1] * reaches[axis].speed)}"
        own.append(Candidate("other axis", words, {other: strokes, axis: slow}))
    return own


def probe(reaches: Mapping[str, Reach], most_s: float = math.inf) -> Candidate:
    """Return the motion to begin with, before anything is known: moves at random on every axis.

    Over less of the travel, where it would last longer than `most_s` otherwise.
    """
    found = _probe(reaches, 1.0)
    for halved in range(1, HALVED + 1):
        if found.lasts_s(reaches) <= most_s:
            break
        found = _probe(reaches, 0.5**halved)
    return found


def _probe(reaches: Mapping[str, Reach], part: float) -> Candidate:
    """Return it over a part of the travel, around its middle."""
    strokes = {}
    for k, (axis, reach) in enumerate(reaches.items()):
        begin = BEGINS[k % len(BEGINS)]
        strokes[axis] = (
            *_lasting(reach, [_nearer(s, part) for s in roam(reach, ROAMING, begin)], PROBE_S),
            *_reversals(reach, 0.5, REVERSAL_SPEEDS[0], 1),
            *_to_and_fro(reach, 0.5, SLOW_SPEEDS[0], 1),
        )
    return Candidate("probe", "moves at random, fast and slow reversals, on every axis", strokes)


def _nearer(stroke: Stroke, part: float) -> Stroke:
    """Return a stroke to a place nearer to the middle of the travel."""
    return replace(stroke, to=0.5 + part * (stroke.to - 0.5))


def _lasting(reach: Reach, strokes: list[Stroke], seconds: float) -> list[Stroke]:
    """Return the first strokes, at least two, that together last about so long."""
    counts = range(2, len(strokes) + 1)
    enough = (k for k in counts if duration_s(reach, strokes[:k]) >= seconds)
    return strokes[: next(enough, len(strokes))]


def _of_one(reach: Reach) -> Iterator[tuple[str, str, list[Stroke]]]:
    for speed in REVERSAL_SPEEDS:
        for place in PLACES:
            strokes = list(_reversals(reach, place, speed))
            words = f"reversals over {_way(strokes, reach)} around {_place(place, reach)} at "
            words += f"{_speed(speed * reach.speed)} and {reach.acceleration:.3g} m/s^2"
            yield "fast reversals", reach.units.words(words), strokes
    for speed in CROSSINGS:
        strokes = [Stroke(1.0, speed, 0.8), Stroke(0.0, speed, 0.8), Stroke(0.5, speed, 0.8)]
        words = f"the whole way at {_speed(speed * reach.speed)}, there and back"
        yield "crossing", reach.units.words(words), strokes
    for low, high in ((0.1, 0.9), (0.3, 0.7)):
        strokes = [
            Stroke(to, 0.8, share) for share in (1.0, GENTLE) for to in (high, low, high, low)
        ]
        words = f"{_place(low, reach)} to {_place(high, reach)} and back with "
        words += f"{reach.acceleration:.3g} and {GENTLE * reach.acceleration:.3g} m/s^2"
        yield "two accelerations", reach.units.words(words), strokes
    for speed in SLOW_SPEEDS:
        for place in PLACES:
            strokes = list(_to_and_fro(reach, place, speed))
            words = f"to and fro over {_way(strokes, reach)} around {_place(place, reach)} at "
            words += _speed(speed * reach.speed)
            yield "slow reversals", reach.units.words(words), strokes
    ladder = [stroke for speed in SLOW_SPEEDS for stroke in _to_and_fro(reach, 0.5, speed, pairs=1)]
    speeds = ", ".join(_speed(share * reach.speed) for share in SLOW_SPEEDS)
    words = f"to and fro around {_place(0.5, reach)} at {speeds}"
    yield "slow reversals", reach.units.words(words), ladder
    for begin in BEGINS:
        strokes = list(roam(reach, ROAMING, begin))
        seconds = duration_s(reach, strokes)
        yield "roaming", f"{ROAMING} moves at random over the travel, {seconds:.2g} s", strokes


def _reversals(
    reach: Reach, place: float, speed: float, pairs: int = REVERSALS
) -> Iterator[Stroke]:
    """Turn round with full acceleration and jerk around a place."""
    way = min(0.3, 1.2 * (speed * reach.speed) ** 2 / reach.acceleration / reach.travel)
    yield Stroke(place - way / 2, speed, 1.0)
    for _ in range(pairs):
        yield Stroke(place + way / 2, speed, 1.0)
        yield Stroke(place - way / 2, speed, 1.0)


def _to_and_fro(reach: Reach, place: float, speed: float, pairs: int = 2) -> Iterator[Stroke]:
    """Go slowly to and fro around a place."""
    way = min(0.15, SLOW_S * speed * reach.speed / reach.travel)
    yield Stroke(place - way / 2, 0.5, 0.5)
    for _ in range(pairs):
        yield Stroke(place + way / 2, speed, 0.2)
        yield Stroke(place - way / 2, speed, 0.2)


def _way(strokes: list[Stroke], reach: Reach) -> str:
    places = [stroke.to for stroke in strokes]
    return f"{1e3 * (max(places) - min(places)) * reach.travel:.3g} mm"


def _place(share: float, reach: Reach) -> str:
    return f"{1e3 * reach.at(share):.0f} mm"


def _speed(m_s: float) -> str:
    mm_s = 1e3 * m_s
    return f"{mm_s:.0f} mm/s" if mm_s >= MANY else f"{mm_s:.3g} mm/s"
