"""What a store tells of each machine beside its parameters: its logs, effects and refusals."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from motorctl.fleet.findings import Refusal
from motorctl.fleet.series import Seen, seen_in

UNNAMED = "(no machine)"
"""Stands for the machine of logs that do not tell one."""


@dataclass
class EffectSeen:
    """An effect that the model of an axis lacks, over all windows that were searched."""

    name: str
    windows: int = 0
    first: tuple[datetime, Seen] | None = None
    last: tuple[datetime, Seen] | None = None
    confidence: float = 0.0
    """In the last window."""
    explained: float = 0.0
    text: str = ""


@dataclass
class AxisSeen:
    """What was found of an axis under a program."""

    searched: int = 0
    """Windows that were searched for what the model lacks."""
    verdicts: Counter[str] = field(default_factory=Counter)
    effects: dict[str, EffectSeen] = field(default_factory=dict)
    silent: int = 0
    """Windows or logs that tell nothing of it."""
    silent_why: str = ""


@dataclass
class MachineSeen:
    """What was found of a machine."""

    name: str
    logs: set[str] = field(default_factory=set)
    first: datetime | None = None
    last: datetime | None = None
    refused: list[tuple[str, str]] = field(default_factory=list)
    """Log and reason."""
    axes: dict[tuple[str, str], AxisSeen] = field(default_factory=lambda: defaultdict(AxisSeen))
    """By axis and program."""


def _last_written(rows: Sequence[Mapping[str, Any]]) -> dict[str, datetime]:
    """Return when what was last found of each file was written."""
    last: dict[str, datetime] = {}
    for row in rows:
        kept = last.get(row["source"], row["written_utc"])
        last[row["source"]] = max(kept, row["written_utc"])
    return last


def machines_in(
    rows: Sequence[Mapping[str, Any]], passing: Sequence[Refusal] = ()
) -> dict[str, MachineSeen]:
    """Return what findings tell of each machine, by name.

    A refusal counts until something newer is known of the same file.

    Parameters
    ----------
    rows
        Of the store, in order of time.
    passing
        Logs that could not be used the last time, though that does not lie in them alone.
    """
    found: dict[str, MachineSeen] = {}
    written = _last_written(rows)
    for row in rows:
        # a copy that was torn, and is whole by now, or was torn again
        if row["kind"] == "refused" and row["written_utc"] < written[row["source"]]:
            continue
        name = UNNAMED if row["machine"] is None else str(row["machine"])
        machine = found.setdefault(name, MachineSeen(name))
        if row["kind"] == "refused":
            machine.refused.append((str(row["source"]), str(row["text"])))
            continue
        machine.logs.add(str(row["log_id"]))
        begin = row["begin_utc"]
        machine.first = begin if machine.first is None else min(machine.first, begin)
        machine.last = begin if machine.last is None else max(machine.last, begin)
        axis = machine.axes[str(row["axis"] or ""), str(row["program"] or "")]
        if row["kind"] == "verdict":
            axis.searched += 1
            axis.verdicts[str(row["name"])] += 1
        elif row["kind"] == "nothing":
            axis.silent += 1
            axis.silent_why = str(row["text"])
        elif row["kind"] == "effect":
            effect = axis.effects.setdefault(str(row["name"]), EffectSeen(str(row["name"])))
            effect.windows += 1
            effect.last = begin, seen_in(row)
            effect.first = effect.first or effect.last
            effect.confidence = row["confidence"] or 0.0
            effect.explained = row["value"] or 0.0
            effect.text = str(row["text"] or "")
    for each in passing:
        machine = found.setdefault(each.machine or UNNAMED, MachineSeen(each.machine or UNNAMED))
        machine.refused.append((each.source, each.reason))
    return dict(sorted(found.items()))
