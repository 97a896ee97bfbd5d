"""Faults of one end of a beam with two motors: its encoder, its amplifier, its motor, a push."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from motorctl.hal import Status
from motorctl_benchmarks.safety.fault_kind import (
    BOTH,
    ENABLED,
    EVERY,
    MOVING,
    FaultKind,
    Numbers,
    ahead,
    jump,
    reports,
    shift,
)
from motorctl_benchmarks.safety.faulty_gantry import DeviceFault
from motorctl_benchmarks.safety.setting import Setting

DUAL = ("dual",)
PUSH_S = 8e-3
"""How long one end is pushed. Shorter: it may end before the skew has come to its limit; longer:
the beam is thrown askew further than any machine's could be. Twice what the skew takes."""


def _push(rng: np.random.Generator, case: Setting) -> Numbers:
    """Draw a push on one end, against its motion, that the motors cannot balance."""
    side = -case.direction if case.state == "cruise" else float(rng.choice((-1.0, 1.0)))
    push_v = side * float(rng.uniform(22.0, 30.0))
    return {"push_v": push_v, "push_ticks": float(round(case.limits.ticks(PUSH_S)))}


def _search(_rng: np.random.Generator, _case: Setting) -> Numbers:
    return {"search_m_s": 0.05}


END_FAULTS: Mapping[str, FaultKind] = {
    "end_encoder_lost": FaultKind(
        "one end's encoder loses its signal, the driver says so",
        EVERY,
        DUAL,
        one_end=True,
        device=reports(Status.ENCODER_LOST, freezes=True),
    ),
    "end_amplifier_fault": FaultKind(
        "one end's amplifier reports a fault and switches off",
        EVERY,
        DUAL,
        one_end=True,
        device=reports(Status.AMPLIFIER_FAULT, off=True),
    ),
    "end_silence": FaultKind(
        "no new sample of one end comes any more",
        ENABLED,
        DUAL,
        one_end=True,
        device=reports(Status.STALE, freezes=True),
    ),
    "end_encoder_jump": FaultKind(
        "one end's count jumps, for good",
        (*ENABLED, "stop", "reaction"),
        DUAL,
        one_end=True,
        draw=jump,
        device=lambda case: DeviceFault(offset_counts=shift(case)),
    ),
    "end_encoder_stuck": FaultKind(
        "one end's count stands still, nobody says so",
        ("cruise", "homing"),
        DUAL,
        "skew",
        BOTH,
        clean=True,
        one_end=True,
        device=lambda _case: DeviceFault(freezes=True),
    ),
    "end_limit_switch": FaultKind(
        "the limit switch ahead is pressed at one end",
        MOVING,
        DUAL,
        "limit_switch",
        BOTH,
        one_end=True,
        device=ahead,
    ),
    "end_dead_output": FaultKind(
        "one end's output stage gives nothing, nobody says so",
        ("accelerate",),
        DUAL,
        "skew",
        clean=True,
        one_end=True,
        device=lambda _case: DeviceFault(gain=0.0),
    ),
    "end_push": FaultKind(
        "a push on one end that the motors cannot balance",
        ("hold", "cruise", "dwell"),
        DUAL,
        "skew",
        BOTH,
        clean=True,
        one_end=True,
        draw=_push,
        device=lambda case: DeviceFault(
            force_v=case.drawn["push_v"], force_ticks=int(case.drawn["push_ticks"])
        ),
    ),
    "end_home_switch": FaultKind(
        "one end's home switch is never seen",
        ("search",),
        DUAL,
        one_end=True,
        draw=_search,
        device=lambda _case: DeviceFault(masks=int(Status.HOME_SWITCH)),
    ),
}
