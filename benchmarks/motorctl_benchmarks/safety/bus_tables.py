"""The campaign's tables of the buses: a line a fault, a line a state, and the loop's death."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from motorctl_benchmarks.findings import TextTable
from motorctl_benchmarks.safety.bus_case import BusOutcome
from motorctl_benchmarks.safety.bus_expectations import STATES
from motorctl_benchmarks.safety.bus_faults import BOTH_KILLED, LOOP_KILLED, TITLES
from motorctl_benchmarks.safety.bus_kills import KillOutcome

NONE = "-"
WIRE_TITLE = "Faults of the wire, in real time, over the states that they were tried in"
END_TITLE = "Faults of one end of a beam behind a bus, in real time"
STATE_TITLE = "As promised on the buses, by the state that the fault found"
COLUMNS = (
    "cases",
    "detected by",
    "ticks beyond those held",
    "amplifiers off, ms",
    "from detection to 0 V there at most, ms",
    "ramp, ms",
    "travel, mm",
    "rows lost",
    "reset refused",
    "restart clean",
    "longest pause here, ms",
    "as promised",
)
"""What is told of a fault."""
KILL_TITLE = "The loop is killed: until the device's amplifiers are off"


def bus_table(outcomes: Sequence[BusOutcome]) -> TextTable:
    """Return a line for each fault of the wire, over all buses."""
    faults = dict.fromkeys(outcome.key.fault for outcome in outcomes)
    rows = tuple(_line(fault, [o for o in outcomes if o.key.fault == fault]) for fault in faults)
    return TextTable(WIRE_TITLE, ("fault", *COLUMNS), rows)


def end_table(outcomes: Sequence[BusOutcome]) -> TextTable:
    """Return a line for each fault of one end of a beam, and each bus."""
    rows = []
    for fault, bus in dict.fromkeys((o.key.fault, o.key.line) for o in outcomes):
        title, *rest = _line(
            fault, [o for o in outcomes if (o.key.fault, o.key.line) == (fault, bus)]
        )
        rows.append((title, bus, *rest))
    return TextTable(END_TITLE, ("fault", "bus", *COLUMNS), tuple(rows))


def _line(fault: str, cases: Sequence[BusOutcome]) -> tuple[str, ...]:
    # Without power there is nothing to detect, and nothing to switch off.
    own = [o for o in cases if o.promise.guard]
    beyond = [o.held_ticks - o.allowed_ticks for o in own
              if o.held_ticks is not None and o.allowed_ticks is not None]  # fmt: skip
    travel = sorted(o.travel_mm for o in own if o.travel_mm is not None)
    asked = [o.refused for o in cases if o.promise.asked]
    return (
        TITLES[fault],
        str(len(cases)),
        ", ".join(dict.fromkeys(o.guard or "nothing" for o in own)) or "nothing, as it should",
        _span(beyond),
        _span([round(o.off_ms) for o in own if o.off_ms is not None]),
        _span([round(o.command_ms, 1) for o in own if o.command_ms is not None]),
        _span([round(o.ramp_ms) for o in own if o.ramp_ms is not None]),
        f"{travel[len(travel) // 2]:.1f} (max {travel[-1]:.0f})" if travel else NONE,
        str(sum(o.rows_lost for o in cases)),
        f"{sum(r == 'still_faulty' for r in asked)} of {len(asked)}" if asked else NONE,
        f"{sum(o.restart_clean for o in cases)} of {len(cases)}",
        f"{max(o.pause_ms for o in cases):.1f}",
        f"{sum(o.right for o in cases)} of {len(cases)}",
    )


def bus_state_table(outcomes: Sequence[BusOutcome]) -> TextTable:
    """Return how many cases were as promised, by state, for each bus."""
    lines = list(dict.fromkeys(o.key.line for o in outcomes))
    states = [state for state in STATES if any(o.key.state == state for o in outcomes)]
    rows = [
        (state, *(_share(o for o in outcomes if (o.key.line, o.key.state) == (line, state))
                  for line in lines))
        for state in states
    ]  # fmt: skip
    total = ("all", *(_share(o for o in outcomes if o.key.line == line) for line in lines))
    return TextTable(STATE_TITLE, ("state", *lines), (*rows, total))


def _share(outcomes: Iterable[BusOutcome]) -> str:
    cases = list(outcomes)
    return f"{sum(o.right for o in cases)} of {len(cases)}" if cases else NONE


def kill_table(outcomes: Sequence[KillOutcome]) -> TextTable:
    """Return a line for each bus: how fast the device's watchdog was, and the supervisor."""
    rows = []
    for line in dict.fromkeys(o.key.line for o in outcomes):
        of = {o.key.fault: o for o in outcomes if o.key.line == line}
        alone, loop = of.get(BOTH_KILLED), of.get(LOOP_KILLED)
        rows.append(
            (
                line,
                NONE if alone is None else f"{1e3 * alone.watchdog_s:.0f}",
                _ms(None if alone is None else alone.own_ms),
                _ms(None if alone is None else alone.kill_ms),
                _ms(None if loop is None else loop.kill_ms),
                f"{max(o.pause_ms for o in of.values()):.1f}",
                f"{sum(o.right for o in of.values())} of {len(of)}",
            )
        )
    columns = (
        "bus",
        "the device's watchdog, ms",
        "loop and supervisor killed: off after the last command, ms",
        "after the kill, ms",
        "loop alone killed: off by the supervisor, ms after the kill",
        "longest pause of the device, ms",
        "as promised",
    )
    return TextTable(KILL_TITLE, columns, tuple(rows))


def _ms(value: float | None) -> str:
    return NONE if value is None else f"{value:.1f}"


def _span(numbers: Sequence[float]) -> str:
    if not numbers:
        return NONE
    return str(numbers[0]) if len(set(numbers)) == 1 else f"{min(numbers)}..{max(numbers)}"
