"""A loop that was stalled is the cause of what its device reports then, and is told as that."""

from __future__ import annotations

import dataclasses
import math
import time
from typing import Any, ClassVar

import numpy as np
import pytest
from beam_bench import absolute, beam
from hypothesis import given
from hypothesis import strategies as st
from loop_bench import TS, Hand, gantry, with_axes, with_sim

from motorctl.config.guard_keys import HostFrozen
from motorctl.config.keys import LateSamples
from motorctl.config.machine import Machine
from motorctl.daemon.axis_faults import faults_of
from motorctl.hal import FAULT_BITS, Driver, Inputs, Outputs, Status, error_bits
from motorctl.log.sample import FaultCause
from motorctl.loop import Reply, Verb
from motorctl.motion import point_to_point
from motorctl_sim import SimDriver

pytestmark = pytest.mark.slow

DOG_TICKS = 100
LEFT_ALONE = error_bits(0x8130)
"""What a drive on CANopen says that has missed its host's heartbeat."""
REPORTS = {
    "amplifier": Status.AMPLIFIER_FAULT | LEFT_ALONE,
    "communication": Status.COMMUNICATION_LOST | Status.STALE | Status.CORRUPT,
    "encoder lost": Status.ENCODER_LOST | Status.DEVICE_RESTARTED,
    "silence": Status.STALE,
    "nothing": Status(0),
}
OWN = {
    "amplifier": FaultCause.AMPLIFIER,
    "communication": FaultCause.COMMUNICATION,
    "encoder lost": FaultCause.ENCODER_LOST,
    "silence": FaultCause.NO_NEW_SAMPLE,
}
WORDS = {
    "amplifier": "since then the amplifier reports a fault",
    "communication": "since then communication with the device is lost",
    "encoder lost": "since then the encoder's signal is lost",
}


class Watched(SimDriver):
    """The gantry behind a device that disables by itself where no command comes."""

    watchdog_s: float | None = DOG_TICKS * TS
    report: ClassVar[int] = 0
    exchanges: ClassVar[bool] = False
    """Whether what a read brings was sampled at the last write."""
    obeys_later: ClassVar[bool] = False
    """Whether it samples when it is read, and obeys a command a period later: SYNC does both."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.exchange_delay_periods = float(self.exchanges or self.obeys_later)
        self.tripped = False
        self.broken = 0
        """What it reports whatever its watchdog does."""
        self.enabled = False
        self._off = Outputs(len(self.channels))
        self._alone_ticks = 0
        self._answer = Inputs(len(self.channels))

    def open(self) -> None:
        super().open()
        self._sample(self._answer)

    def _sample(self, inputs: Inputs) -> None:
        super().read(inputs)
        inputs.status[:] |= np.uint32(self.broken | (self.report if self.tripped else 0))

    def read(self, inputs: Inputs) -> None:
        if not self.exchanges:
            self._sample(inputs)
            return
        inputs.counts[:] = self._answer.counts
        inputs.index_counts[:] = self._answer.index_counts
        inputs.status[:] = self._answer.status

    def write(self, outputs: Outputs) -> None:
        self._alone_ticks = 0
        self._sample(self._answer)
        self.enabled = bool(outputs.enable.any())
        self.tripped = self.tripped and self.enabled
        super().write(self._off if self.tripped else outputs)

    def advance(self) -> None:
        super().advance()
        self._alone_ticks += 1
        if self.enabled and self._alone_ticks >= DOG_TICKS:
            self.tripped = True
            super().write(self._off)


def on(machine: Machine, report: int, *, hold_ticks: int = 3, **members: Any) -> Machine:
    """Put a simulated machine behind such a device; its following error trips nothing."""
    machine = with_axes(machine, ["x"], limits={"following_error": {"filter_time_s": 1e3}})
    cls: type[Driver] = type("Device", (Watched,), {"report": int(report), **members})
    (setup,) = machine.drivers.values()
    late = LateSamples(hold_ticks=hold_ticks)
    setup = dataclasses.replace(setup, cls=cls, late=late)
    return dataclasses.replace(machine, drivers={"gantry": setup})


def moving(machine: Machine) -> Hand:
    """Let x move at half a metre a second."""
    hand = Hand(machine)
    hand.steps(5)
    assert hand.ask(Verb.START) is Reply.OK
    here = float(hand.status()["reference_m"])
    hand.follow("x", point_to_point(here, here + 0.3, 0.5, 5.0, 500.0))
    hand.steps(800)
    assert abs(hand.row()["velocity_m_s"]) > 0.4
    return hand


def read_late(hand: Hand, periods: int) -> None:
    """Do a tick whose read ends so many periods too late, and the next, which skips them."""
    for _ in range(1 + periods):
        hand.driver.advance()
    period_ns = round(TS * 1e9)
    for elapsed, late in ((1, periods), (periods, 0)):
        hand.number += elapsed
        hand.memory.beat()
        due_ns = time.monotonic_ns() - late * period_ns - period_ns // 4
        hand.tick.step(hand.number, elapsed, False, due_ns - (elapsed - 1) * period_ns, 0)


def cause_of(hand: Hand) -> FaultCause:
    return FaultCause(int(hand.status()["fault"]))


def told(hand: Hand) -> str:
    return faults_of(hand.tick.machine, hand.memory.axis_status)["x"]["message"]


@pytest.mark.parametrize("exchanges", [False, True], ids=["asks", "exchanges"])
@pytest.mark.parametrize("stalled", [DOG_TICKS - 1, DOG_TICKS, DOG_TICKS + 1, 300, 600])
@pytest.mark.parametrize("report", REPORTS)
def test_whatever_a_device_says_after_a_pause_that_its_watchdog_did_not_stand_the_pause_is_told(
    report, stalled, exchanges
):
    machine = on(with_sim(gantry()), REPORTS[report], hold_ticks=200, exchanges=exchanges)
    with moving(machine) as hand:
        hand.step(stalled + 1)
        enabled = hand.driver.enabled
        hand.steps(2 if report != "silence" else 250)
        if report == "nothing" and stalled <= DOG_TICKS:
            assert cause_of(hand) is FaultCause.NONE  # nobody can know yet
            return
        assert cause_of(hand) is FaultCause.HOST_FROZEN
        assert hand.status()["fault_value"] == stalled
        assert f"the loop was stalled for {stalled} ticks" in told(hand)
        assert hand.row()["command_v"] == 0.0
        assert not hand.driver.enabled
        if report in WORDS and not exchanges:
            assert not enabled  # from the tick on that read it
            assert WORDS[report] in told(hand)
        if report == "amplifier" and not exchanges:
            assert "heartbeat" in told(hand)


LIMITS = {
    "host_frozen": (
        {"watchdog_s": math.inf}, 600, "limit 500 ticks (100 ms), guards.host_frozen.time_s"
    ),
    "watchdog": (
        {"report": 0}, 300, f"limit {DOG_TICKS} ticks (20 ms), its device's watchdog, beyond which"
    ),
    "watchdog less two periods": (
        {}, DOG_TICKS - 1,
        f"limit {DOG_TICKS - 2} ticks (19.6 ms), its device's watchdog less 2 periods",
    ),
    "hold_ticks": (
        {"watchdog_s": None}, 300, "limit 200 ticks (40 ms), its driver's late.hold_ticks"
    ),
}  # fmt: skip


@pytest.mark.parametrize("limit", LIMITS)
def test_a_pause_is_told_with_the_one_limit_that_it_was_beyond_and_its_key(limit):
    members, stalled, words = LIMITS[limit]
    members = {"report": REPORTS["amplifier"], **members}
    machine = on(with_sim(gantry()), members.pop("report"), hold_ticks=200, **members)
    with moving(machine) as hand:
        hand.step(stalled + 1)
        hand.steps(2)
        assert cause_of(hand) is FaultCause.HOST_FROZEN
        assert f"stalled for {stalled} ticks" in told(hand)
        assert words in told(hand)
        others = [text for name, (*_, text) in LIMITS.items() if name != limit]
        assert not any(text.split("), ")[1] in told(hand) for text in others)


@pytest.mark.parametrize("report", OWN)
def test_without_a_pause_or_with_one_that_the_device_stands_its_own_word_is_the_cause(report):
    for stalled in (0, DOG_TICKS - 3):
        with moving(on(with_sim(gantry()), 0, hold_ticks=200)) as hand:
            hand.step(stalled + 1)
            hand.driver.broken = int(REPORTS[report])
            hand.steps(250)
            assert cause_of(hand) is OWN[report]
            assert "since then" not in told(hand)


def test_a_pause_explains_nothing_once_the_device_was_heard_to_be_well_after_it():
    frozen = HostFrozen(time_s=0.5)
    machine = with_axes(with_sim(gantry()), guards={"host_frozen": frozen})
    machine = on(machine, 0, hold_ticks=3, watchdog_s=None)
    for ticks, cause in ((1, FaultCause.AMPLIFIER), (0, FaultCause.HOST_FROZEN)):
        with moving(machine) as hand:
            hand.step(5)  # skips four, which nobody knows that the device stands
            hand.steps(ticks)
            hand.driver.broken = int(Status.AMPLIFIER_FAULT)
            hand.step()
            assert cause_of(hand) is cause


@pytest.mark.parametrize("report", WORDS)
def test_a_pause_while_the_answer_is_waited_for_is_the_cause_as_well(report):
    with moving(on(with_sim(gantry()), REPORTS[report], hold_ticks=200)) as hand:
        read_late(hand, DOG_TICKS + 10)
        assert cause_of(hand) is FaultCause.HOST_FROZEN
        assert hand.status()["fault_value"] >= DOG_TICKS + 10
        assert WORDS[report] in told(hand)


def test_an_emergency_stop_after_a_pause_is_one():
    with moving(on(with_sim(gantry()), Status.ESTOP)) as hand:
        hand.step(DOG_TICKS + 1)
        assert cause_of(hand) is FaultCause.ESTOP


def test_a_machine_without_a_watchdog_is_known_to_have_none():
    assert SimDriver.watchdog_s == math.inf
    assert Driver.watchdog_s is None


def test_a_device_that_cannot_tell_is_not_led_on_after_its_watchdog_has_fired():
    """However patient the configuration is: its amplifiers are off."""
    machine = with_axes(with_sim(gantry()), guards={"host_frozen": HostFrozen(time_s=0.9)})
    with moving(on(machine, 0, hold_ticks=1000)) as hand:
        hand.step(DOG_TICKS + 2)
        assert hand.driver.tripped is False  # the tick has disabled it
        assert cause_of(hand) is FaultCause.HOST_FROZEN
        assert hand.status()["fault_limit"] == DOG_TICKS


def test_a_ramp_that_the_pause_began_goes_on_until_the_device_says_that_it_is_off():
    guards = {"host_frozen": HostFrozen(reaction="quick_stop")}
    machine = with_axes(with_sim(gantry()), guards=guards)
    for report, goes_on in ((0, True), (REPORTS["amplifier"], False)):
        with moving(on(machine, report, hold_ticks=1000)) as hand:
            hand.step(DOG_TICKS + 2)
            assert cause_of(hand) is FaultCause.HOST_FROZEN
            assert hand.driver.enabled is goes_on


@pytest.mark.parametrize("exchanges", [False, True], ids=["asks", "exchanges"])
@pytest.mark.parametrize("reaction", ["quick_stop", "disable"])
def test_a_computer_that_stood_still_has_the_reaction_that_was_chosen_for_it_on_every_device(
    reaction, exchanges
):
    """Where samples come in one exchange a period, the sample that may be missing is the limit."""
    allowed = 40 if exchanges else 60
    frozen = HostFrozen(time_s=60 * TS, reaction=reaction)
    machine = with_axes(with_sim(gantry()), guards={"host_frozen": frozen})
    machine = on(machine, 0, hold_ticks=40, exchanges=exchanges, watchdog_s=None)
    for stalled, cause in ((allowed, FaultCause.NONE), (allowed + 1, FaultCause.HOST_FROZEN)):
        with moving(machine) as hand:
            hand.step(stalled + 1)
            assert cause_of(hand) is cause
            assert hand.driver.enabled is (cause is FaultCause.NONE or reaction == "quick_stop")
            hand.steps(3)
            assert cause_of(hand) is cause
            if cause is FaultCause.NONE:
                continue
            assert hand.status()["fault_limit"] == allowed
            hand.steps(2000)
            assert abs(hand.row()["velocity_m_s"]) < 0.01 or reaction == "disable"
            assert not hand.driver.enabled


@given(
    stalled=st.integers(1, 700),
    report=st.sampled_from(sorted(REPORTS)),
    exchanges=st.booleans(),
    ramps=st.booleans(),
    hold_ticks=st.integers(0, 800),
    before=st.integers(0, 3),
)
def test_no_pause_is_told_as_a_fault_of_device_or_encoder(
    stalled, report, exchanges, ramps, hold_ticks, before
):
    reaction = "quick_stop" if ramps else "disable"
    guards = {"host_frozen": HostFrozen(reaction=reaction)}
    machine = on(
        with_axes(with_sim(gantry()), guards=guards),
        REPORTS[report],
        hold_ticks=hold_ticks,
        exchanges=exchanges,
    )
    with moving(machine) as hand:
        hand.step(1 + before)
        hand.steps(3)
        hand.step(stalled + 1)
        hand.step()
        reported = hand.driver.tripped and REPORTS[report] & FAULT_BITS
        hand.steps(3)
        assert cause_of(hand) in (FaultCause.NONE, FaultCause.HOST_FROZEN)
        if stalled > DOG_TICKS or (stalled >= DOG_TICKS - 1 and REPORTS[report] & FAULT_BITS):
            assert cause_of(hand) is FaultCause.HOST_FROZEN
        if reported:
            assert not hand.driver.enabled
            assert hand.row()["command_v"] == 0.0


@pytest.mark.parametrize("exchanges", [False, True], ids=["asks", "exchanges"])
@pytest.mark.parametrize("stalled", [5, 20, 60])
def test_the_ends_of_a_beam_do_not_jump_in_a_pause(exchanges, stalled):
    still = beam().loop.model_copy(update={"without_realtime": "degrade"})
    machine = dataclasses.replace(absolute(beam()), loop=still)
    with moving(on(machine, 0, hold_ticks=100, exchanges=exchanges)) as hand:
        hand.step(stalled + 1)
        hand.steps(50)
        assert cause_of(hand) is FaultCause.NONE
        read_late(hand, stalled)
        hand.steps(50)
        assert cause_of(hand) is FaultCause.NONE


@pytest.mark.parametrize("device", ["exchanges", "obeys_later", "asks"])
@pytest.mark.parametrize("stalled", [3, 20, 60, 95])
def test_a_pause_between_waking_and_asking_is_no_jump_of_the_encoder(device, stalled):
    kind = {} if device == "asks" else {device: True}
    with moving(on(with_sim(gantry()), 0, hold_ticks=250, **kind)) as hand:
        read_late(hand, stalled)
        hand.steps(50)
        assert cause_of(hand) is FaultCause.NONE
        assert abs(hand.row()["velocity_m_s"] - 0.5) < 0.05


@pytest.mark.parametrize("late", [False, True], ids=["skipped", "read late"])
def test_a_ramp_after_a_pause_begins_where_the_axis_has_come_to_on_every_device(late):
    """What a device of one exchange a period tells first is older than the pause."""
    limits = {"following_error": {"minimum_m": 2e-3, "per_velocity_s": 0.0, "filter_time_s": 0.0}}
    machine = with_axes(
        with_sim(gantry()), guards={"host_frozen": HostFrozen(reaction="quick_stop")}
    )
    machine = on(machine, 0, hold_ticks=40, exchanges=True, watchdog_s=None)
    with moving(with_axes(machine, ["x"], limits=limits)) as hand:
        if late:
            read_late(hand, 42)
        else:
            hand.step(42)
        assert cause_of(hand) is FaultCause.HOST_FROZEN
        assert hand.driver.enabled
        most_v = 0.0
        while hand.driver.enabled:
            hand.step()
            most_v = max(most_v, abs(float(hand.row()["command_v"])))
        assert abs(hand.row()["velocity_m_s"]) < 0.02  # no other guard has let it go at speed
        assert most_v < 6.0
