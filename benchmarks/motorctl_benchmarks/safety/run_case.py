"""One case: the fault is brought about, and what the loop does is measured and judged."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

from motorctl.errors import MotorctlError
from motorctl.hal import Status
from motorctl.loop import Verb
from motorctl_benchmarks.safety.cases import CaseKey
from motorctl_benchmarks.safety.expectations import (
    EXPECTED,
    FIRST_CAUSE,
    QUICK_BY_DEFAULT,
    REFUSED_WHILE,
)
from motorctl_benchmarks.safety.expected import NOTHING, Expected
from motorctl_benchmarks.safety.faulty_gantry import DeviceFault
from motorctl_benchmarks.safety.measures import Measured, measure
from motorctl_benchmarks.safety.plan import draw
from motorctl_benchmarks.safety.prepare import Ready, ready
from motorctl_benchmarks.safety.restart import Restart, refused_by, start_again
from motorctl_benchmarks.safety.watch import Watch

QUIET_S = 0.4
"""For so long nothing may trip, where nothing has to."""
MORE_S = 0.1
"""A guard that comes too late is waited for, to tell how late."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case."""

    key: CaseKey
    expected: Expected
    reaction: str
    """What should happen: disable or quick_stop."""
    measured: Measured | None = None
    restart: Restart | None = None
    rows_lost: int = 0
    failures: tuple[str, ...] = ()
    """What is not as it has to be, in words."""

    @property
    def right(self) -> bool:
        """Whether everything was as expected."""
        return not self.failures

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        expected = {
            "guards": list(self.expected.guards),
            "ticks": [self.expected.least, self.expected.most],
            "reaction": self.reaction,
        }
        return {
            "case": str(self.key),
            "expected": expected,
            **({} if self.measured is None else self.measured.document()),
            **({} if self.restart is None else self.restart.document()),
            "rows_lost": self.rows_lost,
            "failures": list(self.failures),
        }


def run_case(key: CaseKey) -> Outcome:
    """Run a case; whatever happens is its outcome."""
    try:
        return _run(key)
    except (MotorctlError, ValueError) as error:
        return Outcome(key, NOTHING, "", failures=(f"could not be run: {error}",))


def _run(key: CaseKey) -> Outcome:
    plan = draw(key)
    with ready(plan) as made:
        expected, reaction = _wanted(made)
        watch = Watch(made)
        watch.begin()
        _bring_about(watch, expected)
        refusal = refused_by(watch, at_once=True)
        watch.until_rest()
        measured = measure(watch, expected, reaction)
        refusal = refusal or refused_by(watch, at_once=False)
        restart = replace(start_again(watch, expected), refused=refusal)
        lost = made.stand.rows_lost() + made.stand.ring_lost
    failures = [*measured.failures, *restart.failures]
    if refusal and refusal != REFUSED_WHILE[key.fault]:
        failures.append(f"reset while the cause lasts: {refusal}, not {REFUSED_WHILE[key.fault]}")
    if lost:
        failures.append(f"{lost} rows lost")
    return Outcome(key, expected, reaction, measured, restart, lost, tuple(failures))


def _wanted(made: Ready) -> tuple[Expected, str]:
    key = made.key
    expected = EXPECTED[key.fault](made.setting)
    reaction = key.reaction or ("quick_stop" if key.fault in QUICK_BY_DEFAULT else "disable")
    if key.state in FIRST_CAUSE:  # what came first stays, and nothing is ramped any more
        first = replace(expected, guards=(FIRST_CAUSE[key.state],))
        return first, "disable"
    if key.state == "off" and key.fault != "estop_command":
        return NOTHING, ""
    if {"homing_failed", "not_square"} & set(expected.guards):
        reaction = "disable"
    return expected, reaction if expected.guards else ""


def _bring_about(watch: Watch, expected: Expected) -> None:
    """Let the fault happen, and tick until it is detected or should have been."""
    made, key = watch.made, watch.made.key
    stand, period_s = made.stand, made.setting.limits.period_s
    if key.kind.device is not None:
        stand.device.break_down(
            replace(key.kind.device(made.setting), channels=made.broken), made.seed
        )
    if key.fault == "short_silence":
        stale = DeviceFault(made.broken, bits=int(Status.STALE), freezes=True)
        stand.device.break_down(stale)
    if key.fault == "encoder_stuck" and made.move is not None:
        stand.follow({made.axis: made.move})
        stand.step()
        watch.begin()
    if key.fault == "estop_command":
        stand.memory.post(Verb.ESTOP)
    if key.fault == "learned_nan":
        stand.memory.post(Verb.START, stand.names.index(made.axis))
    if key.state == "search":
        stand.memory.post(Verb.HOME, stand.names.index(made.axis))
    wait_s = QUIET_S if not expected.guards else MORE_S
    waited = 3 * expected.most + round(wait_s / period_s)
    for passed in itertools.count():
        if key.fault == "short_silence" and passed == made.setting.limits.hold_ticks:
            stand.device.repair()
        _tick(watch, passed)
        # In fault already, or the second of two: it is the state that counts.
        detected = watch.faulty and key.state not in FIRST_CAUSE
        if (
            detected
            or passed >= waited
            or (key.state in FIRST_CAUSE and passed >= QUIET_S / period_s)
        ):
            return


def _tick(watch: Watch, passed: int) -> None:
    """Do a tick as the computer of this case does it."""
    fault, limits = watch.made.key.fault, watch.made.setting.limits
    if fault in ("host_pause", "short_pause") and passed == 0:
        watch.step(1 + round(watch.made.setting.drawn["skipped"]))
    elif fault == "late_ticks":
        watch.step(overran=True)
    elif fault == "late_now_and_then":
        watch.step(overran=passed % 2 == 0)
    elif fault == "supervisor_dead":
        watch.step(beat=False)
    elif fault == "supervisor_slow":
        watch.step(beat=passed * limits.period_s > 0.45)
    else:
        watch.step()
