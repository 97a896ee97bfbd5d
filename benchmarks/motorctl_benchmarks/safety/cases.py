"""Which cases there are: machines x controllers x faults x states x reactions, by their keys."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from motorctl.errors import UsageError
from motorctl_benchmarks.safety.fault_kind import FaultKind
from motorctl_benchmarks.safety.kinds import FAULTS
from motorctl_benchmarks.safety.machines import KINDS

Size = Literal["small", "full"]

MACHINES: dict[Size, tuple[tuple[str, str], ...]] = {
    "small": (("gantry", "C2"), ("serial", "C1"), ("stage", "C2"), ("dual", "C2")),
    "full": tuple((machine, law) for machine in KINDS for law in ("C1", "C2")),
}
PARTS = 6


@dataclass(frozen=True)
class CaseKey:
    """What draws a case again."""

    machine: str
    controller: str
    state: str
    fault: str
    reaction: str
    """Of the fault's guard; empty: its default."""
    seed: int

    def __str__(self) -> str:
        reaction = self.reaction or "default"
        parts = (self.machine, self.controller, self.state, self.fault, reaction, str(self.seed))
        return ":".join(parts)

    @property
    def kind(self) -> FaultKind:
        """The fault."""
        return FAULTS[self.fault]

    def random(self) -> np.random.Generator:
        """Return the numbers that this case is drawn from."""
        return np.random.default_rng([self.seed, zlib.crc32(str(self).encode())])


def parse_case(text: str) -> CaseKey:
    """Read a key. Raises UsageError where it is none."""
    parts = text.split(":")
    if len(parts) == PARTS and parts[5].isdecimal():
        reaction = "" if parts[4] == "default" else parts[4]
        machine, controller, state, fault = parts[:4]
        key = CaseKey(machine, controller, state, fault, reaction, int(parts[5]))
        if key in set(keys_of(key.machine, key.controller, key.seed)):
            return key
    raise UsageError(
        f"{text}: no case; MACHINE:CONTROLLER:STATE:FAULT:REACTION:SEED, as in "
        "gantry:C2:cruise:encoder_stuck:default:1"
    )


def keys(size: Size, seed: int) -> list[CaseKey]:
    """Return every case of a size, in the order of the table."""
    return [key for machine, law in MACHINES[size] for key in keys_of(machine, law, seed)]


def keys_of(machine: str, controller: str, seed: int) -> Iterator[CaseKey]:
    """Yield every case of a machine; none where there is no such machine."""
    if machine not in KINDS or controller not in ("C1", "C2"):
        return
    for fault, kind in FAULTS.items():
        if machine not in kind.machines:
            continue
        for state in kind.states:
            homes = KINDS[machine].homes
            if (state == "ring" and homes) or (state == "homing" and not homes):
                continue
            for reaction in kind.reactions:
                yield CaseKey(machine, controller, state, fault, reaction, seed)
