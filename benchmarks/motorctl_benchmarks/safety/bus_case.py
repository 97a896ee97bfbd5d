"""Cases on a bus: what a session's log and its device's report say of each fault."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from motorctl.log import AxisRecording, Recording
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl_benchmarks.safety.bus_cases import BusKey
from motorctl_benchmarks.safety.bus_expectations import Promise, command_s, promise, ramp_s
from motorctl_benchmarks.safety.bus_lines import EVERY_LINE, STOP
from motorctl_benchmarks.safety.bus_session import Kept, Spell

SLACK_S = 0.02
"""From an event to its effect at the other end, beside the pauses that both sides measured."""
MEETS = {
    "shuttle": AxisState.RUNNING,
    "cruise": AxisState.RUNNING,
    "hold": AxisState.IDLE,
    "off": AxisState.OFF,
    "stop": AxisState.STOPPING,
    "homing": AxisState.HOMING,
}
"""What an axis tells in the states of the campaign."""
LOST_PLACE = ("short_reset", "long_reset", "shifted_count", "slipped_end", "lost_end")


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
    command_ms: float | None = None
    """From the detection's tick to the device's amplifiers off, at most; None where it was not the
    loop's command that did it."""
    ramp_ms: float | None = None
    """How long the reference braked."""
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
            "command_ms": self.command_ms,
            "ramp_ms": self.ramp_ms,
            "travel_mm": self.travel_mm,
            "rows_lost": self.rows_lost,
            "pause_ms": self.pause_ms,
            "refused": self.refused,
            "restart_clean": self.restart_clean,
            "failures": list(self.failures),
        }


@dataclass
class _Seen:
    """What is gathered of a case while it is judged."""

    guards: list[str] = field(default_factory=list)
    held: int | None = None
    trips: list[int] = field(default_factory=list)
    """The row of each axis' detection."""
    passed_s: float = 0.0
    """From the fault to the last sample that came in spite of it."""
    ramp_s: float | None = None
    failures: list[str] = field(default_factory=list)


def judged(kept: Kept) -> Iterator[BusOutcome]:
    """Yield what became of each fault of a session."""
    log = kept.log
    enabled = np.zeros(len(log.time_s), bool)
    for axis in log.axes.values():
        assert axis.state is not None
        enabled |= axis.state != AxisState.OFF
    began_s = float(log.time_s[np.flatnonzero(enabled)[0]])
    for spell in kept.spells:
        first = int(np.searchsorted(log.time_s, began_s + spell.at_s - 0.05))
        last = int(np.searchsorted(log.time_s, spell.status_time_s))
        yield _judge(kept, spell, slice(first, last), began_s)


def _judge(kept: Kept, spell: Spell, rows: slice, began_s: float) -> BusOutcome:
    key = spell.key
    wanted = promise(key.line, key.state, key.fault)
    assert wanted is not None
    log, line = kept.log, EVERY_LINE[key.line]
    assert log.lateness_s is not None
    steps_s = np.diff(log.time_s[rows])
    skipped_s = float(steps_s.max(initial=0.0)) - log.period_s
    loop_s = float(log.lateness_s[rows].max(initial=0.0)) + max(0.0, skipped_s)
    pause_s = max(loop_s, float(spell.told.get("longest_pause_s", 0.0)))
    seen = _Seen()
    if spell.told and not spell.told["fired"]:
        seen.failures.append("the device did not do it")
    lost = kept.rows_lost + _gaps(log.axes["x"], rows, steps_s, log.period_s)
    if lost:
        seen.failures.append(f"{lost} rows lost")
    for name in line.axes:
        if wanted.guard:
            _look_at_trip(kept, spell, wanted, name, rows, pause_s, began_s, seen)
        else:
            _look_at_rest(log.axes[name], name, rows, seen)
    off_ms, command_ms = _look_at_device(kept, spell, wanted, pause_s, seen)
    if wanted.asked and spell.refused != "still_faulty":
        asked = "start" if key.state == "off" else "reset"
        seen.failures.append(f"{asked} while the fault lasts: {spell.refused or 'obeyed'}")
    clean = not spell.reset and all(state == spell.wanted for state in spell.started.values())
    if not clean:
        seen.failures.append(f"no restart: {spell.reset or spell.started}")
    if key.state == "off" and spell.told_reset != wanted.told_reset:
        when = "only after" if spell.told_reset else "without"
        should = "only after" if wanted.told_reset else "without"
        seen.failures.append(f"started {when} a reset, should be {should} one")
    return BusOutcome(
        key,
        wanted,
        ", ".join(dict.fromkeys(seen.guards)),
        seen.held,
        line.hold_ticks + 1 if wanted.held else None,
        off_ms,
        command_ms,
        None if seen.ramp_s is None else 1e3 * seen.ramp_s,
        _travel_mm(kept, spell, rows, began_s),
        lost,
        1e3 * pause_s,
        spell.refused,
        clean,
        tuple(seen.failures),
    )


def _gaps(axis: AxisRecording, rows: slice, steps_s: Any, period_s: float) -> int:
    """Count rows that are missing though the loop skipped no period."""
    assert axis.flags is not None
    skips = (axis.flags[rows][1:] & SampleFlag.SKIPPED) > 0
    return int(((steps_s > 1.5 * period_s) & ~skips).sum())


def _look_at_trip(
    kept: Kept,
    spell: Spell,
    wanted: Promise,
    name: str,
    rows: slice,
    pause_s: float,
    began_s: float,
    seen: _Seen,
) -> None:
    """Note an axis' cause, whether it came in the state and in its time, and what came after."""
    log, line = kept.log, EVERY_LINE[spell.key.line]
    axis, why = log.axes[name], seen.failures
    row = _tripped(axis, rows)
    if row is None:
        seen.guards.append("nothing")
        why.append(f"axis {name}: missed")
        return
    assert axis.state is not None
    assert axis.fault is not None
    seen.trips.append(row)
    guard = FaultCause(int(axis.fault[row])).name.lower()
    seen.guards.append(guard)
    met = AxisState(int(axis.state[row - 1]))
    if met is not MEETS[spell.key.state]:
        why.append(f"axis {name}: was {met.name.lower()}, should be in {spell.key.state}")
    end = row
    if wanted.off_by == "ramp":
        end = _look_at_ramp(log, name, row, rows.stop, seen)
    if not (axis.state[end : rows.stop] == AxisState.FAULT).all():
        why.append(f"axis {name}: did not stay in fault")
    if not (axis.command[end : rows.stop] == 0.0).all():
        why.append(f"axis {name}: volts after the trip")
    if guard != wanted.guard:
        why.append(f"axis {name}: {guard}, should be {wanted.guard}")
    elif wanted.held:
        assert axis.flags is not None
        fresh = np.flatnonzero((axis.flags[: row + 1] & SampleFlag.HELD) == 0)[-1]
        if wanted.passes:
            seen.passed_s = max(seen.passed_s, float(log.time_s[fresh]) - began_s - spell.at_s)
        seen.held = round((log.time_s[row] - log.time_s[fresh]) * line.rate_hz)
        pauses = int(np.ceil(pause_s * line.rate_hz)) + 1
        if abs(seen.held - line.hold_ticks - 1) > pauses:
            why.append(f"axis {name}: {seen.held} ticks without a sample, may be "
                       f"{line.hold_ticks}")  # fmt: skip
    moment_s = float(log.time_s[row]) - began_s
    if moment_s < spell.at_s - SLACK_S - pause_s:
        why.append(f"axis {name}: tripped before the fault")


def _tripped(axis: AxisRecording, rows: slice) -> int | None:
    """Return the row in which a guard tripped an axis: from there on it has a cause."""
    assert axis.fault is not None
    found = np.flatnonzero(axis.fault[rows] != FaultCause.NONE)
    return rows.start + int(found[0]) if len(found) else None


def _look_at_ramp(log: Recording, name: str, row: int, stop: int, seen: _Seen) -> int:
    """Judge the ramp that begins with a trip; return the row in which the axis is let go."""
    axis = log.axes[name]
    assert axis.state is not None
    assert axis.reference_velocity is not None
    found = np.flatnonzero(axis.state[row:stop] == AxisState.FAULT)
    if not len(found) or axis.state[row] != AxisState.STOPPING:
        seen.failures.append(f"axis {name}: no ramp, or one without an end")
        return row
    end = row + int(found[0])
    speed = axis.reference_velocity[row : end + 1]
    took_s = float(log.time_s[end] - log.time_s[row])
    least_s, most_s = ramp_s(float(speed[0]), *STOP.values())
    seen.ramp_s = max(took_s, seen.ramp_s or 0.0)
    unsure_s = SLACK_S + 3 * log.period_s
    if not least_s - unsure_s <= took_s <= most_s + unsure_s:
        seen.failures.append(
            f"axis {name}: braked for {1e3 * took_s:.0f} ms, should be {1e3 * least_s:.0f} to "
            f"{1e3 * most_s:.0f}"
        )
    if (np.diff(np.abs(speed)) > 1e-9).any():
        seen.failures.append(f"axis {name}: became faster on the ramp")
    return end


def _look_at_rest(axis: AxisRecording, name: str, rows: slice, seen: _Seen) -> None:
    """Note what an axis did that was off, and has to be off all the while."""
    assert axis.state is not None
    assert axis.fault is not None
    causes = axis.fault[rows][axis.fault[rows] != FaultCause.NONE]
    if len(causes):
        seen.guards.append(FaultCause(int(causes[0])).name.lower())
        seen.failures.append(f"axis {name}: false trip: {seen.guards[-1]}")
    if not (axis.state[rows] == AxisState.OFF).all():
        seen.failures.append(f"axis {name}: was not off all the while")
    if not (axis.command[rows] == 0.0).all():
        seen.failures.append(f"axis {name}: volts without power")


def _look_at_device(
    kept: Kept, spell: Spell, wanted: Promise, pause_s: float, seen: _Seen
) -> tuple[float | None, float | None]:
    """Judge when the amplifiers were off, by the device's own report: from the fault, and from
    the detection. Returns both [ms]."""
    log, why = kept.log, seen.failures
    off_s = spell.told.get("off_after_s")
    late_s = SLACK_S + 3 * log.period_s + 2 * pause_s + seen.passed_s
    if spell.told:
        if off_s is None:
            why.append("an amplifier was still on")
        elif off_s > wanted.off_s + late_s:
            why.append(f"amplifiers off after {1e3 * off_s:.0f} ms, should be "
                       f"{1e3 * (wanted.off_s + late_s):.0f}")  # fmt: skip
        trips, should = int(spell.told["watchdog_trips"]), int(wanted.off_by == "watchdog")
        if trips != should and wanted.off_by in ("command", "watchdog"):
            why.append(f"the device's watchdog tripped {trips} times, should be {should}")
    command_ms = None
    if wanted.off_by in ("command", "ramp") and len(seen.trips) == len(log.axes):
        row = max(seen.trips)
        if wanted.off_by == "ramp":
            states = [axis.state for axis in log.axes.values()]
            ends = [np.flatnonzero(s[row:] == AxisState.FAULT) for s in states if s is not None]
            row += max(int(end[0]) if len(end) else 0 for end in ends)
        since_s = kept.origin_s + float(log.time_s[row])
        offs = [off for off, on in kept.off_s if on is None or on > since_s]
        if not offs:
            why.append("an amplifier was still on")
        else:
            command_ms = 1e3 * (offs[0] - since_s)
            most_ms = 1e3 * (command_s(spell.key.line, log.period_s) + pause_s + kept.unsure_s)
            if command_ms > most_ms:
                why.append(f"volts at the device until {command_ms:.1f} ms after the detection, "
                           f"should be {most_ms:.1f} at most")  # fmt: skip
    return None if off_s is None else 1e3 * off_s, command_ms


def _travel_mm(kept: Kept, spell: Spell, rows: slice, began_s: float) -> float | None:
    """Return the longer way of the two axes; where the count began anew nobody knows it."""
    if spell.key.fault in LOST_PLACE:
        return None
    log = kept.log
    first = int(np.searchsorted(log.time_s, began_s + spell.at_s))
    ways = [abs(axis.position[rows.stop - 1] - axis.position[first]) for axis in log.axes.values()]
    return 1e3 * float(max(ways))
