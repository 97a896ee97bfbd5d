"""After the fault: whether a reset is refused while the cause lasts, and the start after it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from motorctl.log.sample import AxisState
from motorctl.loop import Reply, Verb
from motorctl_benchmarks.safety.expectations import REFUSED_WHILE
from motorctl_benchmarks.safety.expected import Expected
from motorctl_benchmarks.safety.machines import KINDS
from motorctl_benchmarks.safety.watch import STANDS_M_S, Watch

AGAIN_S = 0.1
"""From the start on the axis is watched for so long."""
GONE_S = 0.05
"""From the repair to the reset."""
COOLS_S = {"overheating": 0.2, "encoder_noise": 1.0}
"""The same for causes that fade. A motor that tripped on its heat is at 90 % of it after 0.21 time
constants, of half a second; the mean square of noise of five times its limit is below it after 1.6
time constants, of half a second at most."""
STILL_S = 4.0
LARGEST_FORCE_V = 1.0
"""What may push an axis at rest, cogging and friction together; twice that with the overshoot."""
COUNTS = 12
FIRST_V = 0.1
"""The first command after a start: nothing, and what a count or two of motion ask for."""
LOSE_PLACE = (
    "encoder_lost",
    "encoder_blinks",
    "encoder_jump",
    "encoder_glitch",
    "end_encoder_lost",
    "end_encoder_jump",
)
"""An axis whose encoder counts from where it was switched on does not know its place then."""


@dataclass(frozen=True)
class Restart:
    """What came after."""

    refused: str = ""
    """The answer to a reset while the cause lasted; empty: it is none that lasts."""
    clean: bool | None = None
    """None: a restart is not part of the case."""
    first_v: float = 0.0
    """The first command."""
    moved_um: float = 0.0
    """How far the carriage went meanwhile."""
    failures: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "refused": self.refused,
            "restart_clean": self.clean,
            "restart_first_v": self.first_v,
            "restart_moved_um": self.moved_um,
        }


def refused_by(watch: Watch, *, at_once: bool) -> str:
    """Ask for a reset, or for a start where the axis is off, while the cause is there.

    Heat and speed are asked for at once, as they go by themselves; the others once the axis stands.
    """
    made = watch.made
    wanted = REFUSED_WHILE.get(made.key.fault, "")
    if not wanted or (wanted == "CAUSE_LASTS") is not at_once:
        return ""
    if made.key.fault == "push_too_fast" and made.key.reaction == "quick_stop":
        return ""  # the ramp takes the speed away
    if at_once:
        while watch.state() is AxisState.STOPPING:
            watch.step()
    verb = Verb.START if watch.state() is AxisState.OFF else Verb.RESET
    reply = watch.ask(verb, made.axis)
    return "no answer" if reply is None else reply.name


def start_again(watch: Watch, expected: Expected) -> Restart:
    """Repair what is broken, reset and start."""
    made, key = watch.made, watch.made.key
    stand, limits = made.stand, made.setting.limits
    if not key.kind.restarts or (not expected.guards and key.state != "off"):
        return Restart()
    failures = []
    homes = KINDS[key.machine].homes
    if homes and key.fault in LOSE_PLACE and stand.status(made.axis)["homed"]:
        failures.append("the axis still counts as homed")
    stand.device.repair()
    stand.advance(round(limits.ticks(COOLS_S.get(key.fault, GONE_S))))
    for _ in range(round(limits.ticks(STILL_S))):
        if float(np.abs(stand.device.speeds_m_s).max()) < STANDS_M_S:
            break
        stand.step()
    for name in stand.names:
        if stand.state(name) is AxisState.FAULT:
            reply = stand.ask(Verb.RESET, name)
            if reply is not Reply.OK:
                failures.append(f"axis {name}: reset refused after the repair: {reply.name}")
    reply = Reply.STILL_MOVING
    for _ in range(round(limits.ticks(STILL_S))):
        reply = stand.ask(Verb.START, made.axis)
        if reply is not Reply.STILL_MOVING:
            break
    if reply is not Reply.OK:
        failures.append(f"start refused after the reset: {reply.name}")
        return Restart(clean=False, failures=tuple(failures))
    channels = list(made.channels)
    first_v = float(np.abs(stand.device.asked_v[channels]).max())
    begin = stand.device.places_m[channels]
    stand.advance(round(limits.ticks(AGAIN_S)))
    moved_m = float(np.abs(stand.device.places_m[channels] - begin).max())
    per_count = limits.ks_v_s_m * limits.count_m * (1.0 / limits.period_s + limits.k1_1_s)
    if first_v > FIRST_V + 2.0 * per_count:
        failures.append(f"a jolt of {first_v:.3g} V at the start")
    stiffness = limits.ks_v_s_m * limits.k1_1_s
    most_m = 2.0 * LARGEST_FORCE_V / stiffness + COUNTS * limits.count_m
    most_m += 0.5 * limits.squaring_m_s * AGAIN_S  # each end of a beam that is led to square
    if moved_m > most_m:
        failures.append(f"moved by {1e6 * moved_m:.3g} um after the start")
    if stand.state(made.axis) is not AxisState.IDLE:
        failures.append(f"{stand.state(made.axis).name.lower()} after the start")
    return Restart("", not failures, first_v, 1e6 * moved_m, tuple(failures))
