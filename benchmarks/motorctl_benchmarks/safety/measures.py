"""What is measured of a case, and whether it is as expected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.log.sample import AxisState, FaultCause
from motorctl_benchmarks.safety.expectations import ALL_AXES, FIRST_CAUSE
from motorctl_benchmarks.safety.expected import Expected
from motorctl_benchmarks.safety.prepare import Ready
from motorctl_benchmarks.safety.setting import Limits
from motorctl_benchmarks.safety.watch import Watch

SOON_TICKS = 1
"""Zero volts, or the ramp begun, within so many ticks of the detection."""
END_TICKS = 3
"""A ramp ends with a whole tick, and the state changes in the next."""


@dataclass(frozen=True)
class Measured:
    """What the loop did."""

    guard: str
    """The cause that it tells; empty: none."""
    ticks: int | None
    """From the fault to the detection; None: not detected."""
    reaction_ticks: int | None
    """From the detection to zero volts, or to the ramp's begin."""
    ramp_ms: float | None
    """From the detection to zero volts, where there was a ramp."""
    peak_v: float
    """Largest command to the axis after the detection."""
    travel_mm: float
    """Of the carriage, from the fault to standstill."""
    failures: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "guard": self.guard,
            "ticks": self.ticks,
            "reaction_ticks": self.reaction_ticks,
            "ramp_ms": self.ramp_ms,
            "peak_v": self.peak_v,
            "travel_mm": self.travel_mm,
        }


def measure(watch: Watch, expected: Expected, reaction: str) -> Measured:
    """Measure a case from its rows and from the device's side, and compare."""
    made = watch.made
    every = made.stand.rows()
    rows = every[watch.first :, made.stand.names.index(made.axis)]
    before = every[watch.first - 1, made.stand.names.index(made.axis)]
    channels = list(made.channels)
    # Of two motors on one beam the one that still has more, and the end that went further.
    asked = np.abs(np.array(watch.asked_v)[:, channels]).max(axis=1)
    enabled = np.array(watch.enabled)[:, channels].max(axis=1)
    places = np.array(watch.places_m)[:, channels]
    travel_mm = 1e3 * float(np.abs(places[-1] - places[0]).max())
    tripped = rows["state"] == AxisState.FAULT
    told = tripped if made.key.state in FIRST_CAUSE else rows["fault"] != FaultCause.NONE
    failures = _others(watch, every[watch.first :], reaction if expected.guards else "")
    failures += _silent_amplifier(rows, asked, enabled)
    if not told.any():
        if expected.guards:
            wanted = " or ".join(expected.guards)
            failures.insert(0, f"missed: {wanted} did not trip within {len(rows)} ticks")
        peak = float(np.abs(asked).max())
        return Measured("", None, None, None, peak, travel_mm, tuple(failures))
    ticks = int(np.argmax(told))
    guard = FaultCause(int(rows["fault"][ticks])).name.lower()
    after_v = float(np.abs(asked[ticks:]).max())
    silent = (asked[ticks:] == 0.0) & (enabled[ticks:] == 0.0)
    zero = int(np.argmax(silent)) if silent.any() else len(silent)
    failures += _detection(expected, guard, ticks)
    if int(rows["fault"][-1]) != int(rows["fault"][ticks]):
        last = FaultCause(int(rows["fault"][-1])).name.lower()
        failures.append(f"the first cause, {guard}, gave way to {last}")
    if reaction == "quick_stop":
        begun = _ramp_begins(made.setting.limits, rows, ticks)
        failures += _ramp(made, rows, ticks, begun, zero)
        ramp_ms = 1e3 * zero * made.setting.limits.period_s
        return Measured(guard, ticks, begun, ramp_ms, after_v, travel_mm, tuple(failures))
    if expected.guards and zero > SOON_TICKS:
        failures.append(f"zero volts {zero} ticks after the detection")
    if expected.guards and float(np.abs(asked[ticks + zero :]).max(initial=0.0)) > 0.0:
        failures.append("volts after the axis was disabled")
    if made.key.state in FIRST_CAUSE and not bool(before["fault"]):
        failures.append("the first fault had not been detected")
    return Measured(guard, ticks, zero, None, after_v, travel_mm, tuple(failures))


def _detection(expected: Expected, guard: str, ticks: int) -> list[str]:
    if not expected.guards:
        return [f"false trip: {guard} after {ticks} ticks"]
    failures = []
    if guard not in expected.guards:
        failures.append(f"detected by {guard}, should be {' or '.join(expected.guards)}")
    if not expected.least <= ticks <= expected.most:
        failures.append(
            f"detected after {ticks} ticks, should be {expected.least} to {expected.most}"
        )
    return failures


def _ramp_begins(limits: Limits, rows: NDArray[np.void], ticks: int) -> int:
    """Return how many ticks after the detection the reference brakes, or stands.

    It brakes with the jerk of a stop at least; half of that tells it from any program's. What that
    jerk takes away within a tick or two is rest. An axis whose program brakes it already goes on to
    do so once it is being stopped: there is no more jerk to see.
    """
    jerk_m_s3, period_s = limits.stop_jerk_m_s3, limits.period_s
    speed, acceleration = rows["reference_velocity_m_s"], rows["reference_acceleration_m_s2"]
    for k in range(len(rows) - ticks - 1):
        if (
            abs(speed[ticks + k]) <= jerk_m_s3 * period_s**2
            or rows["state"][ticks + k] == AxisState.FAULT
        ):
            return k
        brakes = speed[ticks + k] * acceleration[ticks + k] < 0.0
        if brakes and rows["state"][ticks + k] == AxisState.STOPPING:
            return k
        change = acceleration[ticks + k + 1] - acceleration[ticks + k]
        if change * np.sign(speed[ticks + k]) <= -0.5 * jerk_m_s3 * period_s:
            return k + 1
    return len(rows) - ticks


def _ramp(made: Ready, rows: NDArray[np.void], ticks: int, begun: int, zero: int) -> list[str]:
    failures = []
    if begun > SOON_TICKS:
        failures.append(f"the ramp began {begun} ticks after the detection")
    limits = made.setting.limits
    v = abs(float(rows["reference_velocity_m_s"][ticks]))
    a = abs(float(rows["reference_acceleration_m_s2"][ticks]))
    hardest, jerk = limits.stop_acceleration_m_s2, limits.stop_jerk_m_s3
    longest_s = (v + a * a / (2.0 * jerk)) / hardest + hardest / jerk + 2.0 * a / jerk
    most = round(limits.ticks(longest_s)) + END_TICKS
    if zero > most:
        failures.append(f"zero volts {zero} ticks after the detection, the ramp takes {most}")
    return failures


def _silent_amplifier(
    rows: NDArray[np.void], asked: NDArray[np.float64], enabled: NDArray[np.float64]
) -> list[str]:
    """Find volts or an enable where the axis is off or in fault."""
    off = (rows["state"] == AxisState.FAULT) | (rows["state"] == AxisState.OFF)
    wrong = off & ((asked != 0.0) | (enabled != 0.0))
    return [f"volts or enable in {int(wrong.sum())} ticks without drive"] if wrong.any() else []


def _others(watch: Watch, rows: NDArray[np.void], reaction: str) -> list[str]:
    """Find what another axis did that it should not, or did not that it should."""
    made, failures = watch.made, []
    for k, name in enumerate(made.stand.names):
        if name == made.axis:
            continue
        causes = {FaultCause(int(c)).name.lower() for c in set(rows[:, k]["fault"])} - {"none"}
        wanted: set[str] = set()
        if reaction and made.key.state == "ring" and made.key.fault not in ALL_AXES:
            wanted = {"partner"}
        elif made.key.state in FIRST_CAUSE:
            wanted = {FIRST_CAUSE[made.key.state]}
        elif reaction and made.key.fault in ALL_AXES:
            wanted = {
                FaultCause(int(rows[-1, made.stand.names.index(made.axis)]["fault"])).name.lower()
            }
        if causes != wanted:
            told = ", ".join(sorted(causes)) or "nothing"
            failures.append(f"axis {name}: {told}, should be {', '.join(wanted) or 'nothing'}")
        if wanted == {"partner"}:
            failures += _partner(made, rows, k, name)
    return failures


def _partner(made: Ready, rows: NDArray[np.void], k: int, name: str) -> list[str]:
    own = rows[:, made.stand.names.index(made.axis)]["fault"] != FaultCause.NONE
    other = rows[:, k]["fault"] != FaultCause.NONE
    late = int(np.argmax(other)) - int(np.argmax(own))
    failures = [f"axis {name} was told {late} ticks after its partner"] if late > SOON_TICKS else []
    begun = _ramp_begins(made.setting.limits, rows[:, k], int(np.argmax(own)))
    if begun > SOON_TICKS:
        failures.append(f"the ramp of axis {name} began {begun} ticks after its partner's fault")
    if rows[-1, k]["state"] != AxisState.FAULT:
        failures.append(f"axis {name} has not come to rest in fault")
    return failures
