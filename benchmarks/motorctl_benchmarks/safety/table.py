"""The campaign's tables: a line a fault, a line a machine, and the hours without a fault."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from motorctl_benchmarks.findings import TextTable
from motorctl_benchmarks.safety.expectations import FIRST_CAUSE
from motorctl_benchmarks.safety.fault_free import Quiet
from motorctl_benchmarks.safety.kinds import FAULTS
from motorctl_benchmarks.safety.run_case import Outcome

NONE = "-"
FAULT_TITLE = "Faults in virtual time, over every state that they can meet"
STATE_TITLE = "As promised, by the state that the fault found"
QUIET_TITLE = "Virtual time without a fault"


def fault_table(outcomes: Sequence[Outcome]) -> TextTable:
    """Return a line for each fault: what detected it, how fast, and what came after."""
    rows = []
    for fault in dict.fromkeys(outcome.key.fault for outcome in outcomes):
        rows.append(_line(FAULTS[fault].title, [o for o in outcomes if o.key.fault == fault]))
    columns = (
        "fault",
        "cases",
        "detected by",
        "after ticks",
        "may be",
        "then 0 V, ramp",
        "peak after, V",
        "travel, mm",
        "rows lost",
        "reset refused",
        "restart clean",
        "as promised",
    )
    return TextTable(FAULT_TITLE, columns, tuple(rows))


def _line(title: str, cases: Sequence[Outcome]) -> tuple[str, ...]:
    # In a state that begins with another fault, or without drive, there is nothing to detect.
    own = [o for o in cases if o.expected.guards and o.key.state not in FIRST_CAUSE]
    seen = [o.measured for o in own if o.measured is not None]
    causes = dict.fromkeys(m.guard or "nothing" for m in seen)
    ticks = [m.ticks for m in seen if m.ticks is not None]
    least = min((o.expected.least for o in own), default=0)
    most = max((o.expected.most for o in own), default=0)
    off = [m.reaction_ticks for m in seen if m.ramp_ms is None and m.reaction_ticks is not None]
    ramp = [
        m.reaction_ticks for m in seen if m.ramp_ms is not None and m.reaction_ticks is not None
    ]
    peaks = [m.peak_v for m in seen if m.ramp_ms is not None]
    travel = sorted(m.travel_mm for m in seen)
    refused = [o.restart.refused for o in cases if o.restart and o.restart.refused]
    restarts = [o.restart.clean for o in cases if o.restart and o.restart.clean is not None]
    return (
        title,
        str(len(cases)),
        ", ".join(causes) or "nothing, as it should",
        _span(ticks),
        f"{least}..{most}" if own else NONE,
        f"{_span(off)}, {_span(ramp)}" if own else NONE,
        f"0, {max(peaks):.1f}" if peaks else ("0" if off else NONE),
        f"{travel[len(travel) // 2]:.1f} (max {travel[-1]:.0f})" if travel else NONE,
        str(sum(o.rows_lost for o in cases)),
        f"{sum(r in ('STILL_FAULTY', 'CAUSE_LASTS') for r in refused)} of {len(refused)}"
        if refused
        else NONE,
        f"{sum(restarts)} of {len(restarts)}" if restarts else NONE,
        f"{sum(o.right for o in cases)} of {len(cases)}",
    )


def _span(numbers: Sequence[int]) -> str:
    if not numbers:
        return NONE
    return str(numbers[0]) if len(set(numbers)) == 1 else f"{min(numbers)}..{max(numbers)}"


def state_table(outcomes: Sequence[Outcome]) -> TextTable:
    """Return how many cases were as promised, by state, for each machine and controller."""
    machines = list(dict.fromkeys((o.key.machine, o.key.controller) for o in outcomes))
    states = list(dict.fromkeys(o.key.state for o in outcomes))
    rows = tuple(
        (state, *(_share(o for o in outcomes if _is(o, state, *m)) for m in machines))
        for state in states
    )
    total = (
        "all",
        *(_share(o for o in outcomes if (o.key.machine, o.key.controller) == m) for m in machines),
    )
    columns = ("state", *(f"{machine} {law}" for machine, law in machines))
    return TextTable(STATE_TITLE, columns, (*rows, total))


def _is(outcome: Outcome, state: str, machine: str, law: str) -> bool:
    key = outcome.key
    return (key.state, key.machine, key.controller) == (state, machine, law)


def _share(outcomes: Iterable[Outcome]) -> str:
    chosen = list(outcomes)
    return f"{sum(o.right for o in chosen)} of {len(chosen)}" if chosen else NONE


def quiet_table(spells: Sequence[Quiet]) -> TextTable:
    """Return the hours of each machine without a fault."""
    rows = []
    for machine in dict.fromkeys(quiet.spell.machine for quiet in spells):
        of = [quiet for quiet in spells if quiet.spell.machine == machine]
        rows.append(_hours(machine, of))
    columns = ("machine", "hours", "moves", "starts", "false trips")
    return TextTable(QUIET_TITLE, columns, (*rows, _hours("all", spells)))


def _hours(name: str, spells: Sequence[Quiet]) -> tuple[str, ...]:
    return (
        name,
        f"{sum(quiet.hours for quiet in spells):.2f}",
        str(sum(quiet.moves for quiet in spells)),
        str(sum(quiet.starts for quiet in spells)),
        str(sum(bool(quiet.trip) for quiet in spells)),
    )
