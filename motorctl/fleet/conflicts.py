"""What is wrong between logs: clocks that were set back, two machines with one name."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import pairwise

from motorctl.fleet.findings import Refusal
from motorctl.fleet.head import LogHead

CLOCK_SLACK = timedelta(minutes=1)
"""What clocks and ends of logs may be off. Larger overlooks clocks that were set back a little,
smaller trips over slow starts. Chosen by hand."""
TURNS_WITHIN = timedelta(days=7)
"""Within so long computers that record one name must change three times to be told for two
machines. Longer takes repairs for them, shorter misses machines that record seldom. Chosen by
hand: a computer that is lent and given back changes twice."""
EARLIEST = datetime(2000, 1, 1, tzinfo=UTC)
"""No log is older: a clock that was never set begins at 1970. By definition."""
_SHOWN = "%Y-%m-%d %H:%M:%S"


def conflicts_of(heads: Sequence[LogHead], now: datetime | None = None) -> list[Refusal]:
    """Return the logs that cannot be what they say beside the others, and why.

    What was simulated in virtual time is measured by no clock, and only looked at for its name.
    """
    by_machine: dict[str, list[LogHead]] = defaultdict(list)
    for head in heads:
        by_machine[head.machine].append(head)
    found: dict[str, Refusal] = {}
    for machine, logs in by_machine.items():
        real = sorted((h for h in logs if not h.virtual), key=lambda h: (h.begin_utc, h.source))
        for refusal in (
            *_ahead(real, now or datetime.now(UTC)),
            *_never_set(real),
            *_set_back(real),
            *_two_machines(machine, real),
        ):
            found.setdefault(refusal.source, refusal)
    return list(found.values())


def _ahead(logs: Iterable[LogHead], now: datetime) -> Iterator[Refusal]:
    for log in logs:
        if log.begin_utc > now + CLOCK_SLACK:
            yield _refusal(
                log, f"says that it began at {_at(log)}, which is still to come: its clock is wrong"
            )


def _never_set(logs: Iterable[LogHead]) -> Iterator[Refusal]:
    for log in logs:
        if log.begin_utc < EARLIEST:
            yield _refusal(log, f"says that it began at {_at(log)}: its clock was never set")


def _set_back(logs: Iterable[LogHead]) -> Iterator[Refusal]:
    """Find parts of a run that began before the part before them."""
    runs: dict[str, list[LogHead]] = defaultdict(list)
    for log in logs:
        if log.run is not None and log.part is not None:
            runs[log.run].append(log)
    for run, parts in runs.items():
        for before, part in pairwise(sorted(parts, key=lambda log: log.part or 0)):
            if part.begin_utc < before.end_utc - CLOCK_SLACK:
                yield _refusal(
                    part,
                    f"part {part.part} of the run {run} says that it began at {_at(part)}, and "
                    f"part {before.part} lasted until {before.end_utc:{_SHOWN}}: the clock was set "
                    "back between them",
                )


def _two_machines(machine: str, logs: Sequence[LogHead]) -> Iterator[Refusal]:
    """Find logs of one name that overlap, or come from computers in turns."""
    last: LogHead | None = None
    for log in logs:
        if last is not None and _both_at_once(last, log):
            hint = "two machines have one name, or a clock was set back; give each its own"
            for one, other in ((last, log), (log, last)):
                yield _refusal(
                    one,
                    f"machine {machine} recorded {other.source} (on {other.host}) at the same "
                    f"time, from {_at(other)}: {hint}",
                )
        if last is None or log.end_utc > last.end_utc:
            last = log
    changes = [k for k in range(1, len(logs)) if logs[k - 1].host != logs[k].host]
    in_turns: set[int] = set()
    for first, then, last_change in zip(changes, changes[1:], changes[2:], strict=False):
        hosts = {logs[k].host for k in (first - 1, first, then, last_change)}
        if len(hosts) < 4 and logs[last_change].begin_utc - logs[first].begin_utc <= TURNS_WITHIN:
            in_turns.update(range(first - 1, last_change + 1))
    if in_turns:
        named = ", ".join(sorted({logs[k].host for k in in_turns}))
        for k in sorted(in_turns):
            log = logs[k]
            yield _refusal(
                log,
                f"logs of machine {machine} come from {named} in turns: two machines have one "
                "name; give each its own",
            )


def _both_at_once(first: LogHead, then: LogHead) -> bool:
    of_one_run = then.run is not None and then.run == first.run
    return not of_one_run and then.begin_utc < first.end_utc - CLOCK_SLACK


def _refusal(log: LogHead, reason: str) -> Refusal:
    return Refusal(log.source, f"{log.source}: {reason}", lasting=False, machine=log.machine)


def _at(log: LogHead) -> str:
    return f"{log.begin_utc:{_SHOWN}}"
