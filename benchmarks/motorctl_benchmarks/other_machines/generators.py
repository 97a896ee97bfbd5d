"""The generators of machines: which can be used here, and what draws a case again."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Protocol

from motorctl.errors import UsageError
from motorctl_benchmarks.diagnosis.groups import HELD_OUT_SEED
from motorctl_benchmarks.other_machines.clean_machines import CLEAN_KINDS
from motorctl_benchmarks.other_machines.machine_recording import MachineRecording
from motorctl_benchmarks.other_machines.mistakes import MISTAKES


class Draw(Protocol):
    """How a machine is drawn."""

    def __call__(
        self, kind: str, seed: int, friction: int | None = None, noise: int | None = None
    ) -> MachineRecording:
        """Return a machine of a kind; with the friction and noise that are given, or any."""


@dataclass(frozen=True)
class Generator:
    """What draws recordings of machines: the same for the same kind and seed."""

    kinds: tuple[str, ...]
    machine: Draw


def _energy() -> Generator:
    from motorctl_benchmarks.other_machines.energy.energy_machines import KINDS, machine

    return Generator(KINDS, machine)


def _scipy_ode() -> Generator:
    from motorctl_benchmarks.other_machines.scipy_ode.scipy_machines import KINDS, machine

    return Generator(KINDS, machine)


def _mujoco() -> Generator:
    from motorctl_benchmarks.other_machines.mujoco.mujoco_machines import KINDS, machine

    return Generator(KINDS, machine)


LOADERS: Mapping[str, Callable[[], Generator]] = {
    "energy": _energy,
    "scipy_ode": _scipy_ode,
    "mujoco": _mujoco,
}
"""By name; imported when used: they compile, and one needs a library of its own."""
NEEDS = {"mujoco": "mujoco"}
"""The module that a generator needs beside what motorctl itself has."""
HOW_TO_INSTALL = "pip install './benchmarks[machines]'"


@cache
def generator(name: str) -> Generator:
    """Return a generator that can be used here."""
    return LOADERS[name]()


def usable_generators() -> tuple[str, ...]:
    """Return the names of the generators that have what they need."""
    return tuple(
        name for name in LOADERS if name not in NEEDS or importlib.util.find_spec(NEEDS[name])
    )


@dataclass(frozen=True)
class MachineKey:
    """What draws a machine and its recording again."""

    generator: str
    kind: str
    seed: int

    def __str__(self) -> str:
        return f"{self.generator}:{self.kind}:{self.seed}"


def machine_keys(cases: int, first_seed: int) -> list[MachineKey]:
    """Return so many seeds of every kind and mistake of every generator that can be used here."""
    return [
        MachineKey(name, kind, first_seed + k)
        for name in usable_generators()
        for kind in (*generator(name).kinds, *MISTAKES)
        for k in range(cases)
    ]


def clean_keys(machines: int, first_seed: int) -> list[MachineKey]:
    """Return so many clean machines: of every generator, with each friction and noise in turn."""
    names, kinds = usable_generators(), tuple(CLEAN_KINDS)
    keys = []
    for k in range(machines):
        each, name = divmod(k, len(names))
        seed, kind = divmod(each, len(kinds))
        keys.append(MachineKey(names[name], kinds[kind], first_seed + seed))
    return keys


def parse_machine_key(text: str) -> MachineKey:
    """Read GENERATOR:KIND:SEED. Raises UsageError, naming what there is."""
    name, _, rest = text.partition(":")
    kind, _, seed = rest.partition(":")
    if name not in LOADERS or not seed.isdecimal():
        raise UsageError(
            f"case '{text}': should be GENERATOR:KIND:SEED, as energy:cogging:{HELD_OUT_SEED}; "
            f"generators are {', '.join(LOADERS)}"
        )
    if name not in usable_generators():
        raise UsageError(f"case '{text}': {NEEDS[name]} is not installed ({HOW_TO_INSTALL})")
    kinds = (*generator(name).kinds, *MISTAKES, *CLEAN_KINDS)
    if kind not in kinds:
        raise UsageError(f"case '{text}': {name} makes no '{kind}'; it makes {', '.join(kinds)}")
    return MachineKey(name, kind, int(seed))
