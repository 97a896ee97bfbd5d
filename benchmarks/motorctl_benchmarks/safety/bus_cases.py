"""Which cases there are on buses, by their keys: each fault of the wire, and draws of states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from motorctl.errors import UsageError
from motorctl_benchmarks.safety.bus_expectations import STATES, is_possible
from motorctl_benchmarks.safety.bus_faults import ENDS, KILLS, ORDERS, PAUSE, WIRE
from motorctl_benchmarks.safety.bus_lines import BEAM_LINES, EVERY_LINE, LINES, SMALL, Setup
from motorctl_benchmarks.safety.cases import Size

BUS = "bus"
PARTS = 7
LAWS = ("C2", "C1")
SHUTTLE, CRUISE = "shuttle", "cruise"
RESTING = ("hold", "off")
"""States that cost no session of their own: they come after the faults in motion."""
DRAWN_RESTING = 1
"""Faults drawn for each line and controller, for each of these states."""
DRAWN_APART = 2
"""Faults drawn for each line in each state that needs a session of its own, with one controller."""


@dataclass(frozen=True)
class BusKey:
    """What runs a case again: in a session of its own."""

    line: str
    controller: str
    state: str
    fault: str
    reaction: str
    """Of the fault's guard; empty: its default."""
    seed: int

    def __str__(self) -> str:
        reaction = self.reaction or "default"
        words = (self.line, self.controller, self.state, self.fault, reaction, str(self.seed))
        return ":".join((BUS, *words))

    @property
    def setup(self) -> Setup:
        """What its session is configured for."""
        if self.state in ("stop", CRUISE):
            return "ramps"
        return "homes" if self.state == "homing" else "plain"


def bus_keys(size: Size, seed: int) -> list[BusKey]:
    """Return every case on a bus.

    full: every fault of the wire in motion, on every line and with both controllers; every fault of
    one end of a beam, on those that have one; and a draw of
    the other states, so that each line meets each state, and each state each fault, where this is
    possible. small: of these some lines with C2, a state at rest each, and a line with ramps.
    """
    every = [*_in_motion(seed), *_drawn(seed), *_of_the_computer(seed)]
    return every if size == "full" else _few(every)


def _in_motion(seed: int) -> Iterator[BusKey]:
    for law in LAWS:
        for line in LINES:
            for fault in WIRE:
                if is_possible(line, SHUTTLE, fault):
                    yield BusKey(line, law, SHUTTLE, fault, "", seed)
        for line in BEAM_LINES:
            for fault in ENDS:
                if is_possible(line, SHUTTLE, fault):
                    yield BusKey(line, law, SHUTTLE, fault, "", seed)


def _drawn(seed: int) -> Iterator[BusKey]:
    rng = np.random.default_rng([seed, len(STATES)])
    for state in RESTING:
        yield from _dealt(rng, state, [(line, law) for law in LAWS for line in LINES],
                          DRAWN_RESTING, seed)  # fmt: skip
    for state in STATES:
        if state not in (SHUTTLE, CRUISE, *RESTING):
            yield from _dealt(rng, state, _one_law_each(seed), DRAWN_APART, seed)


def _of_the_computer(seed: int) -> Iterator[BusKey]:
    for line, law in _one_law_each(seed):
        yield BusKey(line, law, CRUISE, PAUSE, "quick_stop", seed)
        for fault in KILLS:
            yield BusKey(line, law, SHUTTLE, fault, "", seed)


def _one_law_each(seed: int) -> list[tuple[str, str]]:
    """Return a controller for each line, in turn; the next seed has the other one."""
    return [(line, LAWS[(k + seed + 1) % len(LAWS)]) for k, line in enumerate(LINES)]


def _dealt(
    rng: np.random.Generator, state: str, slots: Sequence[tuple[str, str]], each: int, seed: int
) -> Iterator[BusKey]:
    """Deal faults to lines: none twice to a line, and first what came least and fits fewest."""
    order = [str(fault) for fault in rng.permutation(list(WIRE))]
    fits = {f: sum(is_possible(line, state, f) for line in LINES) for f in order}
    came = dict.fromkeys(order, 0)
    taken: set[tuple[str, str]] = set()
    for line, law in slots:
        for _ in range(each):
            free = [f for f in order if is_possible(line, state, f) and (line, f) not in taken]
            fault = min(free, key=lambda f: (came[f], fits[f]))
            came[fault] += 1
            taken.add((line, fault))
            yield BusKey(line, law, state, fault, "", seed)


def _few(every: Sequence[BusKey]) -> list[BusKey]:
    small, met = [], set()
    for key in every:
        resting = key.state in RESTING and (key.line, key.state) not in met
        plain = key.state == SHUTTLE and key.fault in ORDERS
        apart = key.line == SMALL[0] and key.state not in RESTING and not plain
        if apart or (key.line in SMALL and key.controller == "C2" and (plain or resting)):
            small.append(key)
            met.add((key.line, key.state))
    return small


def parse_bus(text: str) -> BusKey:
    """Read a key: of any case that is possible, drawn or not. Raises UsageError for any other."""
    parts = text.split(":")
    if len(parts) == PARTS and parts[6].isdecimal():
        line, law, state, fault, reaction, seed = parts[1:]
        key = BusKey(line, law, state, fault, "" if reaction == "default" else reaction, int(seed))
        if _is_a_case(key):
            return key
    raise UsageError(f"{text}: no case on a bus; bus:LINE:CONTROLLER:STATE:FAULT:REACTION:SEED, "
                     "as in bus:can-udp:C2:shuttle:silence:default:1")  # fmt: skip


def _is_a_case(key: BusKey) -> bool:
    if key.line not in EVERY_LINE or key.controller not in LAWS or key.state not in STATES:
        return False
    if key.fault in KILLS:
        return key.line in LINES and (key.state, key.reaction) == (SHUTTLE, "")
    if key.fault == PAUSE:
        return key.line in LINES and (key.state, key.reaction) == (CRUISE, "quick_stop")
    possible = key.fault in ORDERS and is_possible(key.line, key.state, key.fault)
    return possible and key.reaction == ""
