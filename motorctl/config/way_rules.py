"""What always or never trips on the way of a simulated machine, which knows where its ends are.

Of a real one nobody says where end stops and switches are, and none of this is asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from motorctl.config.axis_keys import Homing, Limits
from motorctl.config.axis_parts import AxisParts
from motorctl.config.dual_drive_keys import SECOND_END
from motorctl.config.dual_drive_rules import most_skew_m
from motorctl.config.exchange import ask_exchange
from motorctl.config.guard_keys import Guards
from motorctl.config.hardware import Wiring, channels_of
from motorctl.config.homing_way_rules import check_homing_way
from motorctl.config.machine import DriverSetup
from motorctl.config.programs import followed_program
from motorctl.config.validation import Finding
from motorctl.errors import MotorctlError, Problem
from motorctl.hal import Way
from motorctl.located_yaml import Document
from motorctl.motion import Program

Ways = Mapping[str, Sequence[Way]]
"""Of each axis, the ways of its end or of its two."""


@dataclass(frozen=True)
class _End:
    """One end of an axis: its way, and what may lie between that and the axis' positions."""

    way: Way
    shifts_m: tuple[float, ...]
    """What may have to be added; homing decides which where there are several. Never empty."""


def simulated_ways(
    drivers: Mapping[str, DriverSetup],
    wirings: Sequence[Wiring],
    rates_hz: Mapping[str, float],
) -> Ways:
    """Return the ways of the axes whose driver simulates them, where it knows those of all ends.

    Parameters
    ----------
    drivers, wirings
        Those that could be read.
    rates_hz
        Of each axis.
    """
    found: dict[str, list[Way | None]] = {}
    for name, setup in drivers.items():
        channels = channels_of(name, wirings) if setup.cls.simulated else ()
        names = [channel.axis.removesuffix(SECOND_END) for channel in channels]
        if not channels or names[0] not in rates_hz:
            continue
        try:
            ways = ask_exchange(setup, channels, 1.0 / rates_hz[names[0]]).ways
        except MotorctlError:
            continue  # which is told already
        ends = zip(channels, names, ways or (), strict=False)
        # The first end of a beam stands first, whatever its channel's number.
        for _, axis, way in sorted(ends, key=lambda end: end[0].axis.endswith(SECOND_END)):
            found.setdefault(axis, []).append(way)
    return {
        axis: [way for way in ways if way is not None]
        for axis, ways in found.items()
        if None not in ways
    }


def check_way(
    document: Document, parts: AxisParts, ways: Sequence[Way], programs: Mapping[str, Program]
) -> list[Problem]:
    """Check an axis against the way of its simulated ends.

    Parameters
    ----------
    document
        The configuration.
    parts
        What could be read of the axis.
    ways
        Of its end, or of the first and the second.
    programs
        Those that could be read.

    Returns
    -------
    list of Problem
        Of soft limits and limit switches that never trip; of a program, or homing, that always
        would.
    """
    limits, homing, dual = parts.limits, parts.homing, parts.dual
    if limits is None or homing is None or len(ways) != (1 if dual is None else 2):
        return []
    found: list[Finding] = []
    if all(direction == 1 for direction in _directions(parts)):
        found += check_homing_way(homing, ways)
        if dual is not None:
            found += _square(parts, limits, homing, ways)
    ends = [_End(way, shifts) for i, way in enumerate(ways) if (shifts := _shifts(parts, way, i))]
    if len(ends) == len(ways):
        # By so much the ends of a beam may be apart, however it is homed.
        apart_m = abs(dual.square_offset_m) + (dual.max_out_of_square_m or 0.0) if dual else 0.0
        found += _soft_limits(limits, ends, apart_m)
        found += _limit_switches(parts, ends)
        program = followed_program(document, parts.name, programs)
        if program is not None:
            range_m = program.trajectories()[parts.name].peaks().range_m
            found += _program(program.name, range_m, limits, ends, apart_m)
    return parts.problems(document, found)


def _directions(parts: AxisParts) -> tuple[int, ...]:
    """Return whether each end's encoder counts as its way does, 1, or against it, -1."""
    if parts.encoder is None:
        return ()
    first = parts.encoder.direction
    return (first,) if parts.dual is None else (first, parts.dual.encoder_direction)


def _shifts(parts: AxisParts, way: Way, end: int) -> tuple[float, ...]:
    """Return what may have to be added to positions of a way, nothing where that is not known."""
    homing, encoder, dual = parts.homing, parts.encoder, parts.dual
    if homing is None or encoder is None:
        return ()
    if _directions(parts)[end] != 1:
        return ()
    offset_m = encoder.offset_m
    if end and dual is not None and dual.encoder_offset_m is not None:
        offset_m = dual.encoder_offset_m
    if homing.method == "absolute":
        return (offset_m,) if way.absolute else ()
    home_m = homing.home_position_m
    return () if home_m is None else tuple(home_m - place for place in _homes(homing, way))


def _homes(homing: Homing, way: Way) -> tuple[float, ...]:
    """Return where what homing latches may be."""
    if homing.method in ("index", "switch_index"):
        return way.index_marks_m
    return tuple(edge for edge in way.home_switch_m or () if math.isfinite(edge))


def _soft_limits(limits: Limits, ends: Sequence[_End], apart_m: float) -> Iterator[Finding]:
    """Look for soft limits behind both end stops.

    Behind one alone it may be what somebody puts in the way of a simulated machine. Where only the
    following error at rest, by which they trip outside the travel, brings them there, a note asks
    for the room (`guard_notes`): who wants few trips of a simulated machine writes a large error.
    """
    found: list[Finding] = []
    for side, name, sign in ((0, "lower", -1.0), (1, "upper", 1.0)):
        end_m = limits.travel_m[side]
        furthest_m = max(
            sign * (end.way.reach_m[side] + shift) for end in ends for shift in end.shifts_m
        )
        if sign * end_m - apart_m > furthest_m:
            words = (
                f"found {end_m:g}, guards.soft_limit can never trip at the {name} end: the "
                "simulated plant's end stops let its full command press the axis no further than "
                f"{sign * furthest_m:.3g} m; should lie within them"
            )
            found.append((("limits", "travel_m", side), words))
    if len(found) == 2:
        yield from found


def _limit_switches(parts: AxisParts, ends: Sequence[_End]) -> Iterator[Finding]:
    """Look for a reaction to limit switches that are all behind the end stops."""
    if parts.guards is None or parts.guards.limit_switch == Guards().limit_switch:
        return
    told = [
        (switches, end.way.reach_m)
        for end in ends
        if (switches := end.way.limit_switches_m) is not None
    ]
    if told and all(low < first and high > last for (low, high), (first, last) in told):
        yield (
            ("guards", "limit_switch"),
            f"can never trip: the simulated plant's limit switches, limit_switches_m {told[0][0]}, "
            "are behind its end stops; move them, or remove the guard here",
        )


def _program(
    name: str,
    range_m: tuple[float, float],
    limits: Limits,
    ends: Sequence[_End],
    apart_m: float,
) -> Iterator[Finding]:
    """Look whether a switch is pressed wherever an axis within its following error may be."""
    within_m = limits.following_error.minimum_m + apart_m
    for side, sign in ((0, -1.0), (1, 1.0)):
        pressed = [
            max(sign * (end.way.limit_switches_m[side] + shift) for shift in end.shifts_m)
            for end in ends
            if end.way.limit_switches_m is not None
        ]
        if pressed and sign * range_m[side] - within_m > min(pressed):
            yield (
                ("program",),
                f"found '{name}', guards.limit_switch would always trip: it goes to "
                f"{range_m[side]:.4g} m, and the simulated plant's limit switch there is pressed "
                f"from {sign * min(pressed):.4g} m on; make the program smaller, or move the "
                "switch",
            )
            return


def _square(
    parts: AxisParts, limits: Limits, homing: Homing, ways: Sequence[Way]
) -> Iterator[Finding]:
    dual = parts.dual
    if dual is None or homing.method == "absolute" or dual.max_out_of_square_m is None:
        return
    first, second = (_homes(homing, way) for way in ways)
    apart = [a - b for a in first for b in second]
    if not apart:
        return
    true_m = min(apart, key=lambda m: abs(m - dual.square_offset_m))
    off_m, most_m = abs(true_m - dual.square_offset_m), most_skew_m(dual.skew, limits)
    if off_m > most_m + dual.max_out_of_square_m:
        yield (
            ("dual_drive", "square_offset_m"),
            f"found {dual.square_offset_m:g}, homing would always end in the fault not_square: "
            f"the simulated switches or marks of the two ends are {true_m:g} m apart, "
            f"{off_m:.3g} m off that, and a beam that max_voltage_v {limits.max_voltage_v:g} V "
            f"skew by {most_m:.3g} m at most makes up for no more than that and "
            f"max_out_of_square_m {dual.max_out_of_square_m:g} m",
        )
