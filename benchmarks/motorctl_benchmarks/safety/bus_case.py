"""Cases on a bus: what a session's log and its device's report say of each fault."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from motorctl.errors import MotorctlError, UsageError
from motorctl.latency.progress import Progress
from motorctl.log import AxisRecording
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl_benchmarks.safety.bus_lines import LINES, SMALL, WATCHDOG_S, WIRE, Promise, promise
from motorctl_benchmarks.safety.bus_session import AXES, Kept, Session, Spell, run_session
from motorctl_benchmarks.safety.cases import Size

BUS = "bus"
PARTS = 5
SLACK_S = 0.02
"""From an event to its effect at the other end, beside the pauses that both sides measured."""


@dataclass(frozen=True)
class BusKey:
    """What runs a case again: in a session of its own."""

    line: str
    controller: str
    fault: str
    seed: int

    def __str__(self) -> str:
        return f"{BUS}:{self.line}:{self.controller}:{self.fault}:{self.seed}"


@dataclass(frozen=True)
class BusOutcome:
    """What became of a fault on a bus."""

    key: BusKey
    promise: Promise
    guard: str = ""
    held_ticks: int | None = None
    """From the last sample to the detection."""
    allowed_ticks: int | None = None
    off_ms: float | None = None
    """From the fault to the device's amplifiers off."""
    travel_mm: float | None = None
    """From the fault to the reset; None where the place was lost with the count."""
    rows_lost: int = 0
    pause_ms: float = 0.0
    """The longest that this computer made meanwhile."""
    refused: str = ""
    restart_clean: bool = False
    failures: tuple[str, ...] = ()

    @property
    def right(self) -> bool:
        """Whether everything was as promised."""
        return not self.failures

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "case": str(self.key),
            "expected": {"guard": self.promise.guard, "off_s": self.promise.off_s},
            "guard": self.guard,
            "held_ticks": self.held_ticks,
            "allowed_ticks": self.allowed_ticks,
            "off_ms": self.off_ms,
            "travel_mm": self.travel_mm,
            "rows_lost": self.rows_lost,
            "pause_ms": self.pause_ms,
            "refused": self.refused,
            "restart_clean": self.restart_clean,
            "failures": list(self.failures),
        }


def bus_keys(size: Size, seed: int) -> list[BusKey]:
    """Return every case on a bus; those of one bus and controller make a session."""
    lines = SMALL if size == "small" else tuple(LINES)
    laws = ("C2",) if size == "small" else ("C2", "C1")
    return [
        BusKey(line, law, fault, seed)
        for law in laws
        for line in lines
        for fault in WIRE
        if promise(line, fault) is not None
    ]


def parse_bus(text: str) -> BusKey:
    """Read a key. Raises UsageError where it is none."""
    parts = text.split(":")
    if len(parts) == PARTS and parts[4].isdecimal():
        key = BusKey(parts[1], parts[2], parts[3], int(parts[4]))
        if key in bus_keys("full", key.seed):
            return key
    raise UsageError(f"{text}: no case on a bus; bus:LINE:CONTROLLER:FAULT:SEED, as in "
                     "bus:can-udp:C2:silence:1")  # fmt: skip


def run_bus_cases(keys: list[BusKey], progress: Progress) -> list[BusOutcome]:
    """Run sessions one after the other, in real time."""
    outcomes: list[BusOutcome] = []
    groups = dict.fromkeys((key.line, key.controller, key.seed) for key in keys)
    for k, (line, law, seed) in enumerate(groups):
        own = [key for key in keys if (key.line, key.controller, key.seed) == (line, law, seed)]
        session = Session(line, law, tuple(key.fault for key in own), seed)

        def part(share: float, k: int = k) -> None:
            progress((k + share) / len(groups))

        try:
            outcomes += judged(run_session(session, part), own)
        except MotorctlError as error:
            outcomes += [_not_run(key, str(error)) for key in own]
        part(1.0)
    return outcomes


def _not_run(key: BusKey, why: str) -> BusOutcome:
    wanted = promise(key.line, key.fault)
    assert wanted is not None
    return BusOutcome(key, wanted, failures=(f"could not be run: {why}",))


def judged(kept: Kept, keys: list[BusKey]) -> Iterator[BusOutcome]:
    """Yield what became of each fault of a session."""
    log = kept.log
    enabled = np.zeros(len(log.time_s), bool)
    for axis in log.axes.values():
        assert axis.state is not None
        enabled |= axis.state != AxisState.OFF
    began_s = float(log.time_s[np.flatnonzero(enabled)[0]])
    for key, spell in zip(keys, kept.spells, strict=True):
        first = int(np.searchsorted(log.time_s, began_s + spell.at_s - 0.1))
        last = int(np.searchsorted(log.time_s, spell.status_time_s))
        yield _judge(kept, key, spell, slice(first, last), began_s)


def _judge(kept: Kept, key: BusKey, spell: Spell, rows: slice, began_s: float) -> BusOutcome:
    wanted = promise(key.line, key.fault)
    assert wanted is not None
    log, line = kept.log, LINES[key.line]
    assert log.lateness_s is not None
    steps_s = np.diff(log.time_s[rows])
    skipped_s = float(steps_s.max(initial=0.0)) - log.period_s
    loop_s = float(log.lateness_s[rows].max(initial=0.0)) + max(0.0, skipped_s)
    pause_s = max(loop_s, float(spell.told["longest_pause_s"]))
    failures = [] if spell.told["fired"] else ["the device did not do it"]
    axis = log.axes["x"]
    assert axis.flags is not None
    skips = (axis.flags[rows][1:] & SampleFlag.SKIPPED) > 0
    lost = kept.rows_lost + int(((steps_s > 1.5 * log.period_s) & ~skips).sum())
    if lost:
        failures.append(f"{lost} rows lost")
    guards, held = [], None
    for name in AXES:
        guard, ticks = _tripped(log.axes[name], rows, name, failures)
        guards.append(guard)
        if ticks is None:
            continue
        if guard != wanted.guard:
            failures.append(f"axis {name}: {guard}, should be {wanted.guard}")
        elif wanted.held:
            flags = log.axes[name].flags
            assert flags is not None
            fresh = np.flatnonzero((flags[: ticks + 1] & SampleFlag.HELD) == 0)[-1]
            held = round((log.time_s[ticks] - log.time_s[fresh]) * line.rate_hz)
            pauses = int(np.ceil(pause_s * line.rate_hz)) + 1
            if abs(held - line.hold_ticks - 1) > pauses:
                failures.append(f"axis {name}: {held} ticks without a sample, may be "
                                f"{line.hold_ticks}")  # fmt: skip
        moment_s = float(log.time_s[ticks]) - began_s
        if moment_s < spell.at_s - SLACK_S - pause_s:
            failures.append(f"axis {name}: tripped before the fault")
    off_s = spell.told["off_after_s"]
    late_s = SLACK_S + 3 * log.period_s + 2 * pause_s
    if off_s is None:
        failures.append("an amplifier was still on")
    elif off_s > wanted.off_s + late_s:
        failures.append(f"amplifiers off after {1e3 * off_s:.0f} ms, should be "
                        f"{1e3 * (wanted.off_s + late_s):.0f}")  # fmt: skip
    trips = int(spell.told["watchdog_trips"])
    if wanted.off_s == WATCHDOG_S and trips != 1:
        failures.append(f"the device's watchdog tripped {trips} times, should be once")
    if wanted.asked and spell.refused != "still_faulty":
        failures.append(f"reset while the fault lasts: {spell.refused or 'obeyed'}")
    clean = not spell.reset and all(state == "running" for state in spell.started.values())
    if not clean:
        failures.append(f"no restart: {spell.reset or spell.started}")
    return BusOutcome(
        key,
        wanted,
        ", ".join(dict.fromkeys(guards)),
        held,
        line.hold_ticks + 1 if wanted.held else None,
        None if off_s is None else 1e3 * off_s,
        _travel_mm(kept, key, spell, rows, began_s),
        lost,
        1e3 * pause_s,
        spell.refused,
        clean,
        tuple(failures),
    )


def _tripped(
    axis: AxisRecording, rows: slice, name: str, failures: list[str]
) -> tuple[str, int | None]:
    """Return the cause and the row of an axis' trip, and note what is wrong after it."""
    assert axis.state is not None
    assert axis.fault is not None
    found = np.flatnonzero(axis.state[rows] == AxisState.FAULT)
    if not len(found):
        failures.append(f"axis {name}: missed")
        return "nothing", None
    row = rows.start + int(found[0])
    if not (axis.state[row : rows.stop] == AxisState.FAULT).all():
        failures.append(f"axis {name}: did not stay in fault")
    if not (axis.command[row : rows.stop] == 0.0).all():
        failures.append(f"axis {name}: volts after the trip")
    return FaultCause(int(axis.fault[row])).name.lower(), row


def _travel_mm(kept: Kept, key: BusKey, spell: Spell, rows: slice, began_s: float) -> float | None:
    """Return the longer way of the two axes; where the count began anew nobody knows it."""
    if key.fault.endswith("reset") or key.fault == "shifted_count":
        return None
    log = kept.log
    first = int(np.searchsorted(log.time_s, began_s + spell.at_s))
    ways = [abs(axis.position[rows.stop - 1] - axis.position[first]) for axis in log.axes.values()]
    return 1e3 * float(max(ways))
