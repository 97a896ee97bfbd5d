"""What the nights of a simulated fleet told, held against what was true."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from motorctl_benchmarks.fleet.fleet_machines import KINDS, Machine
from motorctl_benchmarks.fleet.fleet_nights import LACKS, Fleet, Nights, Told, first_told, new_in

STEP_DAYS = 2.0
COSTLY = 1.2
"""So many times its usual tracking error is what a drift must not reach before it is told."""


@dataclass(frozen=True)
class Outcome:
    """A machine, and what was told of it."""

    machine: str
    kind: str
    form: str
    onset_day: float | None
    told_day: float | None
    """End of the day whose night told it first."""
    first: str
    """What was to be looked at first in that night, and what a diagnosis made of it."""
    right: bool | None
    """Whether that is its name; None where nothing was to be told, or nothing was."""
    costly_day: float | None
    """When it had cost a fifth of the tracking error, if ever."""
    cost: float
    """Tracking error of the last day over that before the change."""
    in_time: bool | None
    """Of a step within two days, of a drift before it was costly; None where nothing changes."""
    false_alarms: tuple[str, ...]
    """What was told of a machine in which nothing had changed, also that it is unlike its siblings,
    and from which day on."""
    sound_days: int
    """Nights in which nothing had changed."""

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def outcome_of(machine: Machine, fleet: Fleet, nights: Nights) -> Outcome:
    """Hold what was told of a machine against what it is."""
    changes = machine.form != "none"
    sound = min(int(machine.onset_day), fleet.days) if changes else fleet.days
    tracking = np.array(nights.tracking_m[machine.name])
    usual = float(np.mean(tracking[: max(sound, 1)]))
    costly = np.flatnonzero(tracking[sound:] > COSTLY * usual)
    costly_day = float(sound + costly[0] + 1) if changes and len(costly) else None
    night = first_told(machine, nights)
    first = new_in(machine, nights, night)[0] if night is not None else None
    told_day = None if night is None else night + 1.0
    return Outcome(
        machine=machine.name,
        kind=machine.kind,
        form=machine.form,
        onset_day=machine.onset_day if changes else None,
        told_day=told_day,
        first=_words(machine, first, nights),
        right=_right(machine, first, nights) if changes and first else None,
        costly_day=costly_day,
        cost=float(tracking[-1]) / usual,
        in_time=_in_time(machine, told_day, costly_day) if changes else None,
        false_alarms=_false_alarms(machine, nights, sound),
        sound_days=sound,
    )


def _words(machine: Machine, first: Told | None, nights: Nights) -> str:
    if first is None:
        return ""
    said = f": {nights.named[machine.name]}" if first.parameter == LACKS else ""
    return f"{first.parameter}{said} ({first.form})"


def _right(machine: Machine, first: Told, nights: Nights) -> bool:
    kind = KINDS[machine.kind]
    if first.parameter == LACKS:
        said = nights.named[machine.name].split(", ")
        return said[0] in kind.effects
    # a parameter of an effect is called after it: cogging_sin_1
    return any(
        first.parameter == name or first.parameter.startswith(f"{name}_") for name in kind.names
    )


def _in_time(machine: Machine, told_day: float | None, costly_day: float | None) -> bool:
    if told_day is None:
        return False
    if machine.form == "step":
        return told_day - machine.onset_day <= STEP_DAYS
    return costly_day is None or told_day <= costly_day


def _false_alarms(machine: Machine, nights: Nights, sound: int) -> tuple[str, ...]:
    """Return what was told of a sound machine: changes, and that it is unlike its siblings."""
    found: list[str] = []
    known: set[str] = set()
    for night in range(sound):
        names = {each.parameter for each in nights.told[night].get(machine.name, ())}
        if nights.unlike:
            apart = nights.unlike[night].get(machine.name, ())
            names |= {f"{name} unlike its siblings" for name in apart}
        found += [f"{name} on day {night + 1}" for name in sorted(names - known)]
        known = names
    return tuple(found)
