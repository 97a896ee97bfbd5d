"""The campaign's groups of cases: which are drawn, from which seeds, and how many."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from motorctl.errors import UsageError
from motorctl_benchmarks.diagnosis.cases import Case, clean_case, draw_case
from motorctl_benchmarks.diagnosis.known_effects import KNOWN
from motorctl_benchmarks.diagnosis.unknown_effects import UNKNOWN

Size = Literal["small", "full"]

HELD_OUT_SEED = 50_000
"""No case from here on was looked at while the diagnosis was developed."""
SEEDS_OF_A_GROUP = 10_000
"""The groups' seeds lie so far apart."""
A_FIFTH = 0.2


@dataclass(frozen=True)
class Group:
    """Cases that one figure is about."""

    name: str
    title: str
    draw: Callable[[int], Case]
    """By seed alone: consecutive seeds go through the effects in turn."""
    count: Mapping[Size, int]


@dataclass(frozen=True)
class CaseKey:
    """What draws a case again."""

    group: str
    seed: int

    def __str__(self) -> str:
        return f"{self.group}:{self.seed}"


def _known(seed: int) -> str:
    return tuple(KNOWN)[seed % len(KNOWN)]


def _one(seed: int) -> Case:
    return draw_case(seed, effects=(_known(seed),))


def _weak(seed: int) -> Case:
    return draw_case(seed, effects=(_known(seed),), strength=A_FIFTH)


def _several(seed: int) -> Case:
    return draw_case(seed, effects=2 + seed % 2)


def _unknown(seed: int) -> Case:
    names = tuple(UNKNOWN)
    return draw_case(seed, effects=(names[seed % len(names)],))


def _poor(seed: int) -> Case:
    """Draw one effect on a repeated move or synchronised axes, in turn.

    Coupling is drawn with the repeated move alone: between axes that move in step it is nothing
    but more mass, so that complete is the right answer there and nothing could be scored.
    """
    name = _known(seed)
    motion = "synchronised" if seed % 2 and name != "cross_axis" else "repeated"
    return draw_case(seed, effects=(name,), motion=motion)  # type: ignore[arg-type]


GROUPS: dict[str, Group] = {
    group.name: group
    for group in (
        Group("one", "one effect", _one, {"small": 17, "full": 102}),
        Group("weak", "one effect at a fifth", _weak, {"small": 17, "full": 102}),
        Group("clean", "clean logs", clean_case, {"small": 12, "full": 100}),
        Group("unknown", "effect outside the list", _unknown, {"small": 14, "full": 70}),
        Group("several", "two or three effects", _several, {"small": 14, "full": 100}),
        Group("poor", "poor motion", _poor, {"small": 17, "full": 102}),
    )
}


def draw(key: CaseKey) -> Case:
    """Draw the case again."""
    return GROUPS[key.group].draw(key.seed)


def keys(size: Size, cases: int | None, first_seed: int) -> list[CaseKey]:
    """Return the cases of a campaign, group by group; `cases` overrides the number in each."""
    return [
        CaseKey(group.name, first_seed + k * SEEDS_OF_A_GROUP + i)
        for k, group in enumerate(GROUPS.values())
        for i in range(group.count[size] if cases is None else cases)
    ]


def parse_key(text: str) -> CaseKey:
    """Read GROUP:SEED. Raises UsageError, naming the groups there are."""
    name, _, seed = text.partition(":")
    if name not in GROUPS or not seed.isdecimal():
        raise UsageError(
            f"case '{text}': should be GROUP:SEED, as one:{HELD_OUT_SEED}; groups are "
            f"{', '.join(GROUPS)}"
        )
    return CaseKey(name, int(seed))
