"""What a user reads when an axis has tripped: what happened, value and limit, what to do."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from motorctl.cli.whole_help import SECTIONS
from motorctl.config import config_schema
from motorctl.daemon.axis_faults import fault_of
from motorctl.hal import Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.axis_records import STALL_LIMIT_SHIFT, StallLimit
from motorctl.loop.layout import axis_status

PERIOD_S = 0.2e-3
CAUSES = [cause for cause in FaultCause if cause is not FaultCause.NONE]
WITHOUT_NUMBER = (
    FaultCause.NOT_A_NUMBER,
    FaultCause.ENCODER_LOST,
    FaultCause.AMPLIFIER,
    FaultCause.COMMUNICATION,
    FaultCause.ESTOP,
    FaultCause.PARTNER,
)
"""Nothing was measured: a driver or a person said so, or another axis has the number."""
NEXT = r"`motorctl |\b(look|check|see|read|push|mend|move|let)\b"
"""What tells somebody to do something."""
COMMANDS = [name for names in SECTIONS.values() for name in names]
KEYS = set(re.findall(r'"(\w+)": ', json.dumps(config_schema())))


def told(
    cause: FaultCause,
    value: float = 0.0,
    limit: float = 0.0,
    device: int = 0,
    *,
    homed: bool = True,
    remedy: bool = True,
) -> str:
    status = np.zeros(1, axis_status(6))[0]
    status["homed"] = homed
    status["state"], status["fault"] = AxisState.FAULT, cause
    status["fault_value"], status["fault_limit"], status["fault_time_s"] = value, limit, 12.5
    status["fault_status"] = device
    fault = fault_of("x", status, PERIOD_S, with_remedy=remedy)
    assert fault is not None
    assert fault["cause"] == cause.name.lower()
    return fault["message"]


@pytest.mark.parametrize("cause", CAUSES)
def test_every_fault_tells_when_it_was_and_the_command_that_clears_it(cause):
    message = told(cause)
    assert "at 12.500 s" in message
    assert message.endswith("`motorctl reset x` clears the fault")


@pytest.mark.parametrize("cause", CAUSES)
def test_every_fault_says_what_happened_with_its_number_and_then_what_to_do(cause):
    value, limit = 0.4321, 0.1234
    what, message = told(cause, value, limit, remedy=False), told(cause, value, limit)
    assert message.startswith(what)
    step = message.removeprefix(what).removesuffix("; `motorctl reset x` clears the fault")
    assert re.match(r"; \S.{20}", step), "it says no next step: motorctl/loop/next_steps.py"
    assert re.search(NEXT, step), f"it tells nobody to do anything: {step}"
    assert "{" not in step
    for command in re.findall(r"`motorctl ([a-z]+)", message):
        assert command in COMMANDS
    for key in re.findall(r"\b[a-z]\w*\.(?:\w+\.)*([a-z_]\w*)", message):
        assert key in KEYS, f"no key of a configuration ends so: {key}"
    if cause not in WITHOUT_NUMBER:
        number = what.partition(", at 12.500 s")[0]
        assert re.search(r"-?\d[\d.]* (mm|um rms|m/s|V|s|ticks|more overruns)\b", number)


@pytest.mark.parametrize("cause", [c for c in CAUSES if "ENCODER" not in c.name])
def test_no_other_fault_sends_anybody_to_the_encoder(cause):
    step = told(cause).removeprefix(told(cause, remedy=False))
    assert "check the encoder" not in step
    assert "encoder's" not in step


def test_a_pause_that_a_counter_does_not_stand_says_that_the_encoder_is_in_order():
    bits = StallLimit.COUNTER << STALL_LIMIT_SHIFT
    message = told(FaultCause.HOST_FROZEN, 42, 33, device=bits, homed=False)
    assert (
        "the loop was stalled for 42 ticks (8.4 ms); limit 33 ticks (6.6 ms), in which" in message
    )
    assert "the encoder is in order, and more encoder.counter_bits stand longer pauses" in message
    assert "`motorctl home x` after the reset" in message
    assert "jump" not in message


def test_an_axis_that_lost_its_place_is_told_to_be_homed_again():
    for cause in (FaultCause.ENCODER_LOST, FaultCause.ENCODER_JUMP, FaultCause.HOMING_FAILED):
        assert "`motorctl home x` after the reset" in told(cause, homed=False)
        assert "motorctl home" not in told(cause)
    assert "motorctl home" not in told(FaultCause.FOLLOWING_ERROR, homed=False)


def test_an_emergency_stop_of_the_hardware_is_told_to_be_released():
    assert "release the hardware's" in told(FaultCause.ESTOP, device=int(Status.ESTOP))
    assert "release" not in told(FaultCause.ESTOP)


def test_a_counter_that_may_have_gone_round_sends_to_the_bus_and_not_to_the_encoder():
    message = told(FaultCause.ENCODER_JUMP, 1e-3, 1.2e-3)
    assert "its step of 1 mm may hide whole turns" in message
    assert "look for why no sample came" in message
    assert "check the encoder" not in message


def test_a_stalled_loop_tells_ticks_time_limit_and_what_measures_the_computer():
    message = told(FaultCause.HOST_FROZEN, 42, 3)
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
    message = told(FaultCause.HOST_FROZEN, 42, 3, device=limit << STALL_LIMIT_SHIFT)
    assert [key for key in keys.values() if key in message] == [keys[limit]]
    assert "limit 3 ticks (0.6 ms), " in message
    assert "late ticks" not in message


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
        (FaultCause.SUPERVISOR_LOST, 0.502, 0.5, ("no sign of life for 0.502 s", "limit 0.5 s")),
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
