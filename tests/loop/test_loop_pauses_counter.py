"""A pause that a narrow counter does not stand is told as the pause, never as the encoder's fault.

A counter of 16 bits and 0.1 µm a count goes round every 6.6 mm: an axis at its top speed of 1.5 m/s
does that in 3.6 ms.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from loop_bench import Hand, gantry, with_axes, with_sim
from test_loop_pauses import Watched, cause_of, moving, on, read_late

from motorctl.config.guard_keys import HostFrozen
from motorctl.config.machine import Machine
from motorctl.daemon.axis_faults import faults_of
from motorctl.hal import Inputs, Status
from motorctl.log.sample import FaultCause
from motorctl.loop import Reply, Verb

NARROW = {"counter_bits": 16, "resolution_m": 0.1e-6}
AXES = ("x", "y")
DEVICES: dict[str, dict[str, Any]] = {
    "asks": {},
    "exchanges": {"exchanges": True},
    "obeys later": {"obeys_later": True},
}
RATE_HZ = 5000.0


def narrow(device: str, *, hold_ticks: int = 100) -> Machine:
    """Put the gantry, with both counters narrow, behind a device that has no watchdog."""
    machine = with_axes(
        with_sim(gantry()), AXES, encoder=NARROW, guards={"host_frozen": HostFrozen(time_s=0.2)}
    )
    return on(machine, 0, hold_ticks=hold_ticks, watchdog_s=None, **DEVICES[device])


def resting(machine: Machine) -> Hand:
    """Let both axes hold where they are."""
    hand = Hand(machine)
    hand.steps(5)
    for axis in AXES:
        assert hand.ask(Verb.START, axis) is Reply.OK
    hand.steps(200)
    return hand


def causes(hand: Hand) -> list[FaultCause]:
    return [FaultCause(int(hand.status(axis)["fault"])) for axis in AXES]


@pytest.mark.parametrize("device", DEVICES)
def test_two_axes_at_rest_ride_out_a_pause_or_tell_it(device: str) -> None:
    """After 8.5 ms an axis cannot have gone round from rest; after 100 ms it may have."""
    with resting(narrow(device)) as hand:
        hand.step(1 + round(8.5e-3 * RATE_HZ))
        hand.steps(20)
        assert set(causes(hand)) <= {FaultCause.NONE, FaultCause.HOST_FROZEN}
        hand.step(1 + round(0.1 * RATE_HZ))
        hand.steps(20)
        assert causes(hand) == [FaultCause.HOST_FROZEN] * 2
        for axis, fault in faults_of(hand.tick.machine, hand.memory.axis_status).items():
            assert fault is not None
            assert fault["message"].startswith("the loop was stalled for ")
            assert f"`motorctl reset {axis}` clears the fault" in fault["message"]
            for blamed in ("jumped", "gone round", "check the encoder"):
                assert blamed not in fault["message"]


def test_a_pause_that_the_counter_does_not_stand_says_so_with_its_number() -> None:
    with moving(narrow("asks")) as hand:
        hand.step(1 + round(8.5e-3 * RATE_HZ))
        hand.steps(3)
        fault = faults_of(hand.tick.machine, hand.memory.axis_status)["x"]
    assert fault is not None
    assert fault["cause"] == "host_frozen"
    # A quarter of 6.5536 mm at 1.2 times 1.5 m/s.
    assert (
        "stalled for 42 ticks (8.4 ms); limit 4 ticks (0.8 ms), in which the counter may"
        in (fault["message"])
    )
    assert "the encoder is in order, and more encoder.counter_bits stand" in fault["message"]


pauses = st.lists(
    st.tuples(st.sampled_from(["skipped", "read late"]), st.integers(1, 200), st.integers(1, 8)),
    min_size=1,
    max_size=4,
)


@given(
    device=st.sampled_from(sorted(DEVICES)),
    moves=st.booleans(),
    several=pauses,
    hold_ticks=st.sampled_from([3, 20, 300]),
)
def test_no_pause_is_ever_told_as_a_fault_of_a_narrow_encoder(
    device: str, moves: bool, several: list[tuple[str, int, int]], hold_ticks: int
) -> None:
    begin = moving if moves else resting
    with begin(narrow(device, hold_ticks=hold_ticks)) as hand:
        for how, periods, between in several:
            if how == "skipped":
                hand.step(1 + periods)
            else:
                read_late(hand, periods)
            hand.steps(between)
        hand.steps(5)
        assert set(causes(hand)) <= {FaultCause.NONE, FaultCause.HOST_FROZEN}


class Jumping(Watched):
    """Its count of x can be made to jump."""

    jump_counts = 0

    def _sample(self, inputs: Inputs) -> None:
        super()._sample(inputs)
        inputs.counts[0] = (inputs.counts[0] + self.jump_counts) % (1 << 16)


@pytest.mark.parametrize("device", DEVICES)
def test_a_count_that_jumps_without_a_pause_is_still_the_encoders_fault(device: str) -> None:
    machine = narrow(device)
    cls = type("Device", (Jumping, machine.drivers["gantry"].cls), {})
    setup = dataclasses.replace(machine.drivers["gantry"], cls=cls)
    with resting(dataclasses.replace(machine, drivers={"gantry": setup})) as hand:
        hand.driver.jump_counts = 30_000
        hand.steps(3)
        assert causes(hand) == [FaultCause.ENCODER_JUMP, FaultCause.NONE]


@pytest.mark.parametrize("paused", [20, 30])
def test_ticks_without_a_sample_beside_a_pause_do_not_make_it_a_jump(paused: int) -> None:
    with moving(narrow("asks", hold_ticks=40)) as hand:
        hand.driver.broken = int(Status.STALE)
        hand.steps(4)
        assert hand.status()["held_ticks"] == 4
        hand.step(1 + paused)
        hand.driver.broken = 0
        hand.steps(3)
        assert cause_of(hand) is FaultCause.HOST_FROZEN
