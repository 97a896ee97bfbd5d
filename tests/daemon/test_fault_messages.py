"""What a user reads when an axis has tripped: what happened, value and limit, what to do."""

from __future__ import annotations

import numpy as np
import pytest

from motorctl.daemon.axis_faults import fault_of
from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.axis_records import STALL_LIMIT_SHIFT, StallLimit
from motorctl.loop.layout import axis_status

PERIOD_S = 0.2e-3
CAUSES = [cause for cause in FaultCause if cause is not FaultCause.NONE]


def told(cause: FaultCause, value: float = 0.0, limit: float = 0.0, device: int = 0) -> str:
    status = np.zeros(1, axis_status(6))[0]
    status["state"], status["fault"] = AxisState.FAULT, cause
    status["fault_value"], status["fault_limit"], status["fault_time_s"] = value, limit, 12.5
    status["fault_status"] = device
    fault = fault_of("x", status, PERIOD_S)
    assert fault is not None
    assert fault["cause"] == cause.name.lower()
    return fault["message"]


@pytest.mark.parametrize("cause", CAUSES)
def test_every_fault_tells_when_it_was_and_the_command_that_clears_it(cause):
    message = told(cause)
    assert "at 12.500 s" in message
    assert message.endswith("`motorctl reset x` clears the fault")


def test_a_stalled_loop_tells_ticks_time_limit_and_what_measures_the_computer():
    message = told(FaultCause.OVERRUN, 42, 3)
    for part in ("stalled", "42 ticks (8.4 ms)", "limit 3", "`motorctl latency`"):
        assert part in message


@pytest.mark.parametrize("limit", StallLimit)
def test_a_stalled_loop_tells_the_one_limit_that_acted(limit):
    keys = {
        StallLimit.HOST_FROZEN: "guards.host_frozen.time_s",
        StallLimit.WATCHDOG: "watchdog, beyond",
        StallLimit.COMMANDS_APART: "watchdog less 2 periods",
        StallLimit.HOLD_TICKS: "late.hold_ticks",
        StallLimit.COUNTER: "encoder.counter_bits",
    }
    message = told(FaultCause.OVERRUN, 42, 3, device=limit << STALL_LIMIT_SHIFT)
    assert [key for key in keys.values() if key in message] == [keys[limit]]
    assert "limit 3 ticks (0.6 ms), " in message
    assert "late ticks" not in message  # which have the same cause


@pytest.mark.parametrize(
    ("cause", "value", "limit", "parts"),
    [
        (FaultCause.NO_NEW_SAMPLE, 51, 50, ("51 ticks (10.2 ms)", "limit 50", "hold_ticks")),
        (FaultCause.OVERRUN, 0.0, 10, ("10 more overruns", "bucket_size", "`motorctl latency`")),
        (FaultCause.FOLLOWING_ERROR, 2.5e-3, 1e-3, ("2.5 mm", "limit 1 mm")),
        (FaultCause.SOFT_LIMIT, 0.61, 0.6, ("610 mm", "limit 600 mm")),
        (FaultCause.OVERSPEED, 1.3, 1.2, ("1.3 m/s", "limit 1.2 m/s")),
        (FaultCause.ENCODER_JUMP, -0.03, 1.2e-3, ("jumped by -30 mm", "limit 1.2 mm")),
        (FaultCause.ENCODER_JUMP, 1e-3, 1.2e-3, ("may have gone round",)),
        (FaultCause.HOMING_FAILED, 30.01, 30.0, ("30.01 s", "limit 30 s", "homing.timeout_s")),
        (FaultCause.HOMING_FAILED, 0.46, 0.0, ("ran onto a limit switch", "460 mm")),
        (FaultCause.SUPERVISOR_LOST, 0.5002, 0.0, ("no sign of life for 0.5 s",)),
    ],
)
def test_a_passed_limit_is_told_with_the_value(cause, value, limit, parts):
    message = told(cause, value, limit)
    assert all(part in message for part in parts)


@pytest.mark.parametrize(
    ("device", "words"),
    [(Status.LIMIT_NEGATIVE, "the negative limit switch"), (Status.LIMIT_POSITIVE, "the positive"),
     (Status(0), "the limit switch")],
)  # fmt: skip
def test_a_limit_switch_is_told_with_its_end_and_the_position(device, words):
    message = told(FaultCause.LIMIT_SWITCH, 0.46, 0.45, device=int(device))
    assert words in message
    assert "position 460 mm" in message


def test_what_the_device_reported_stands_beside_the_cause():
    restarted = told(FaultCause.ENCODER_LOST, device=int(Status.DEVICE_RESTARTED))
    assert "encoder" in restarted
    assert "restarted" in restarted
    assert restarted.endswith("`motorctl reset x` opens it anew and clears the fault")


def test_an_axis_without_fault_has_no_message():
    assert fault_of("x", np.zeros(1, axis_status(6))[0], PERIOD_S) is None
