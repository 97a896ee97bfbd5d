"""Homing that always ends in a fault on the way of a simulated machine, which knows what is where.

The sequence is that of `motorctl.loop.homing`: towards the switch's near edge; from there, or from
wherever the axis is, at the latching velocity to an index mark.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from motorctl.config.axis_keys import Homing
from motorctl.config.validation import Finding
from motorctl.hal import Way

FAILS = "would always end in a fault"


def check_homing_way(homing: Homing, ways: Sequence[Way]) -> Iterator[Finding]:
    """Look for what homing seeks and cannot reach, on any of an axis' ends.

    Parameters
    ----------
    homing
        How the zero is found.
    ways
        Of its end, or of the first and the second.

    Yields
    ------
    Finding
        At most one.
    """
    for way in ways:
        found = _switch(homing, way) or _mark(homing, way)
        if found is not None:
            yield found
            return


def _switch(homing: Homing, way: Way) -> Finding | None:
    """Look whether a search meets the near edge of the home switch."""
    velocity, switch = homing.search_velocity_m_s, way.home_switch_m
    if homing.method not in ("switch", "switch_index") or not velocity or switch is None:
        return None
    side, sign = _towards(velocity)
    near_m, behind_m, ahead_m = switch[1 - side], way.reach_m[1 - side], way.reach_m[side]
    search = f"the search at {velocity:g} m/s"
    if sign * near_m <= sign * behind_m and sign * switch[side] >= sign * ahead_m:
        return (
            ("homing", "method"),
            f"found '{homing.method}', {FAILS}: the simulated plant's home switch is pressed "
            "wherever the axis can be, so it has no edge there; move it",
        )
    if sign * near_m <= sign * behind_m:
        return (
            ("homing", "search_velocity_m_s"),
            f"found {velocity:g}, {FAILS}: it leads away from the simulated plant's home switch, "
            f"which is pressed from {switch[side]:g} m on the other way; search the other way",
        )
    if sign * near_m > sign * ahead_m:
        return (
            ("homing", "method"),
            f"found '{homing.method}', {FAILS}: {search} comes no further than the simulated "
            f"plant's end stop lets it, {ahead_m:.4g} m, and its home switch is pressed from "
            f"{near_m:g} m on; move the switch",
        )
    if way.limit_switches_m is not None and sign * near_m > sign * way.limit_switches_m[side]:
        return (
            ("homing", "method"),
            f"found '{homing.method}', {FAILS}: {search} meets the simulated plant's limit switch "
            f"at {way.limit_switches_m[side]:g} m before its home switch, which is pressed from "
            f"{near_m:g} m on; move one of them, or search the other way",
        )
    return None


def _mark(homing: Homing, way: Way) -> Finding | None:
    """Look whether an index mark comes, and in time."""
    velocity = homing.latch_velocity_m_s
    if homing.method not in ("index", "switch_index") or not velocity or not way.index_marks_m:
        return None
    side, sign = _towards(velocity)
    begin_m = way.reach_m[1 - side]
    if homing.method == "switch_index":
        if way.home_switch_m is None or not homing.search_velocity_m_s:
            return None
        begin_m = way.home_switch_m[1 - _towards(homing.search_velocity_m_s)[0]]
    end_m = way.reach_m[side]  # a limit switch stops only what moves towards it
    if way.limit_switches_m is not None:
        end_m = sign * min(sign * end_m, sign * way.limit_switches_m[side])
    ahead = [sign * (mark - begin_m) for mark in way.index_marks_m if sign * mark < sign * end_m]
    ahead = [way_m for way_m in ahead if way_m >= 0.0]
    after = "" if homing.method == "index" else f" from the home switch's edge at {begin_m:g} m"
    if not ahead:
        return (
            ("homing", "latch_velocity_m_s"),
            f"found {velocity:g}, {FAILS}: that way{after} the simulated plant has no index mark "
            f"before {end_m:.4g} m, where its way ends; move a mark, or latch the other way",
        )
    takes_s = min(ahead) / abs(velocity)
    if homing.method == "switch_index" and homing.timeout_s and takes_s > homing.timeout_s:
        return (
            ("homing", "timeout_s"),
            f"found {homing.timeout_s:g}, should be above {takes_s:.3g} s: {min(ahead):.3g} m"
            f"{after} to the simulated plant's index mark at {abs(velocity):g} m/s",
        )
    return None


def _towards(velocity: float) -> tuple[int, float]:
    """Return at which end a velocity leads, 0 or 1, and its sign."""
    return (0, -1.0) if velocity < 0.0 else (1, 1.0)
