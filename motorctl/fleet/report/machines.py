"""What a store tells of each machine beside its parameters: its logs, effects and refusals."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import pyarrow as pa
import pyarrow.dataset as ds

from motorctl.fleet.findings import Refusal
from motorctl.fleet.series import Seen, seen_in

UNNAMED = "(no machine)"
"""Stands for the machine of logs that do not tell one."""
AT_ONCE = 4096
"""Rows that are objects at a time. More takes memory, fewer takes time. Chosen by hand."""
_FIRST, _LAST = ("begin_utc", "min"), ("begin_utc", "max")


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


def machines_in(rows: pa.Table, passing: Sequence[Refusal] = ()) -> dict[str, MachineSeen]:
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

    def machine_of(row: Mapping[str, Any]) -> MachineSeen:
        name = UNNAMED if row["machine"] is None else str(row["machine"])
        return found.setdefault(name, MachineSeen(name))

    used = rows.filter(ds.field("kind") != "refused")
    for row in _together(used, ["machine", "log_id"], []):
        machine_of(row).logs.add(str(row["log_id"]))
    for row in _together(used, ["machine", "axis", "program"], [_FIRST, _LAST]):
        machine = machine_of(row)
        first, last = row["begin_utc_min"], row["begin_utc_max"]
        machine.first = first if machine.first is None else min(machine.first, first)
        machine.last = last if machine.last is None else max(machine.last, last)
        machine.axes[str(row["axis"] or ""), str(row["program"] or "")] = AxisSeen()
    for row in _each(used.filter(ds.field("kind") != "parameter")):
        axis = machine_of(row).axes[str(row["axis"] or ""), str(row["program"] or "")]
        _add(axis, row)
    written = {
        row["source"]: row["written_utc_max"]
        for row in _together(rows, ["source"], [("written_utc", "max")])
    }
    for row in _each(rows.filter(ds.field("kind") == "refused")):
        # but of a copy that was torn, and is whole by now, or was torn again
        if row["written_utc"] >= written[row["source"]]:
            machine_of(row).refused.append((str(row["source"]), str(row["text"])))
    for each in passing:
        machine = found.setdefault(each.machine or UNNAMED, MachineSeen(each.machine or UNNAMED))
        machine.refused.append((each.source, each.reason))
    return dict(sorted(found.items()))


def _add(axis: AxisSeen, row: Mapping[str, Any]) -> None:
    """Add what a row tells of an axis beside its parameters."""
    if row["kind"] == "verdict":
        axis.searched += 1
        axis.verdicts[str(row["name"])] += 1
    elif row["kind"] == "nothing":
        axis.silent += 1
        axis.silent_why = str(row["text"])
    elif row["kind"] == "effect":
        effect = axis.effects.setdefault(str(row["name"]), EffectSeen(str(row["name"])))
        effect.windows += 1
        effect.last = row["begin_utc"], seen_in(row)
        effect.first = effect.first or effect.last
        effect.confidence = row["confidence"] or 0.0
        effect.explained = row["value"] or 0.0
        effect.text = str(row["text"] or "")


def _together(rows: pa.Table, names: list[str], wanted: list[Any]) -> Iterator[dict[str, Any]]:
    return _each(rows.group_by(names, use_threads=False).aggregate(wanted))


def _each(rows: pa.Table) -> Iterator[dict[str, Any]]:
    """Yield row after row, few of them as objects at a time."""
    for batch in rows.to_batches(max_chunksize=AT_ONCE):
        yield from batch.to_pylist()
