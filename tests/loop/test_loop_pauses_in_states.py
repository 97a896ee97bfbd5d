"""A pause of the loop, or ticks without a sample, at the wrong moment: no guard is passed by."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import yaml
from beam_bench import absolute, beam, on_plant, with_dual
from loop_bench import TS, Hand, Rig, Still, gantry, homed_by, with_axes, with_driver, with_sim
from test_loop_pauses import cause_of, moving, on, read_late

from motorctl.config import load, shipped_config
from motorctl.config.guard_keys import HostFrozen, Stops
from motorctl.config.machine import Machine
from motorctl.hal import Inputs, Status
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.loop.homing import LATCH_EDGE
from motorctl.motion import point_to_point
from motorctl_sim import SimDriver

EDGE_M = -0.02
"""Where the simulated gantry's home switch opens."""
LATCH_M_S = 0.01
STOP = round(0.3 / TS)
"""Ticks of a pause in which an axis at 1 m/s would come to rest."""


class Silent(SimDriver):
    """The gantry behind a bus that the test silences for single ticks."""

    silent = False

    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        if self.silent:
            inputs.status[:] |= np.uint32(Status.STALE)


def silenced(machine: Machine) -> Machine:
    (setup,) = machine.drivers.values()
    return dataclasses.replace(machine, drivers={"gantry": dataclasses.replace(setup, cls=Silent)})


def without_sample(hand: Any) -> None:
    hand.driver.silent = True
    hand.step()
    hand.driver.silent = False


# Homing


def homing(hand: Hand, until: int) -> None:
    """Home x until a phase of it is reached."""
    hand.step()
    hand.ask(Verb.HOME)
    phase_of = hand.tick.axes["phase"]
    while phase_of[0] != until:
        hand.step()


def to_be_homed(**changes: Any) -> Machine:
    plant = {"initial_position_m": 0.0, "encoder": {"absolute": False}}
    return with_axes(
        silenced(with_sim(gantry(), plants={0: plant})),
        ["x"],
        homing=homed_by("switch", home_position_m=EDGE_M, **changes),
        guards={"host_frozen": HostFrozen(time_s=0.5)},
        limits={"following_error": {"filter_time_s": 1e3}},
    )


@pytest.mark.parametrize("latch_m_s", [LATCH_M_S, -LATCH_M_S], ids=["leaving", "coming"])
@pytest.mark.parametrize("paused", [True, False], ids=["paused", "silent"])
def test_an_edge_that_passed_in_a_pause_is_met_again(latch_m_s, paused):
    with Hand(to_be_homed(latch_velocity_m_s=latch_m_s)) as hand:
        homing(hand, LATCH_EDGE)
        true = hand.driver.true_state
        outside = latch_m_s > 0.0
        while (true().position_m[0] - EDGE_M) * (1 if outside else -1) < -2 * LATCH_M_S * TS:
            hand.step()
        if paused:
            hand.step(400)  # 0.8 mm
        else:
            hand.driver.silent = True
            hand.steps(3)
            hand.driver.silent = False
        while hand.status()["state"] == AxisState.HOMING:
            hand.step()
        assert cause_of(hand) is FaultCause.NONE
        assert hand.status()["homed"]
        hand.step()
        assert abs(hand.row()["position_m"] - true().position_m[0]) < 1.5 * LATCH_M_S * TS


def test_homing_ends_on_a_computer_that_skips_every_other_period():
    with Hand(to_be_homed()) as hand:
        hand.step()
        hand.ask(Verb.HOME)
        while hand.status()["state"] == AxisState.HOMING:
            hand.step(2)
        assert cause_of(hand) is FaultCause.NONE
        assert hand.status()["homed"]
        hand.step()
        assert abs(hand.row()["position_m"] - hand.driver.true_state().position_m[0]) < 1e-5


@pytest.mark.parametrize("latch_m_s", [0.005, -0.005], ids=["leaving", "coming"])
def test_a_beam_is_not_squared_by_edges_that_passed_in_a_pause(latch_m_s):
    frozen = {"host_frozen": HostFrozen(time_s=0.9)}
    changes: dict[str, Any] = {
        "homing": {"latch_velocity_m_s": latch_m_s},
        "guards": frozen,
        "limits": {"following_error": {"filter_time_s": 1e3}},
    }
    still = beam().loop.model_copy(update={"without_realtime": "degrade"})
    machine = dataclasses.replace(with_axes(on_plant(beam()), ["x"], **changes), loop=still)
    with Hand(machine) as hand:
        homing(hand, LATCH_EDGE)
        pressed = hand.tick.duals
        latched = False
        while not latched:
            before = [int(pressed[0][end]["done"]) for end in ("first", "second")]
            hand.step()
            latched = any(before)
        # Both edges lie 0.4 mm apart: the other one passes in this pause, 1.5 mm long.
        hand.step(1500)
        while hand.status()["state"] == AxisState.HOMING:
            hand.step()
        hand.steps(5000)
        assert cause_of(hand) is FaultCause.NONE
        true = hand.driver.true_state().position_m
        assert abs(float(true[0] - true[1])) < 5e-6


class Marked(SimDriver):
    """A beam whose first end's mark is told once, in a tick in which the second has no sample."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.told = False

    def read(self, inputs: Inputs) -> None:
        super().read(inputs)
        if inputs.status[0] & int(Status.INDEX_LATCHED):
            inputs.status[1] |= np.uint32(Status.STALE)
            self.told = True


def test_a_mark_of_one_end_is_kept_where_the_other_brings_no_sample_in_that_tick():
    ends = {
        0: {"encoder": {"index_marks_m": [-0.07]}},
        1: {"encoder": {"index_marks_m": [-0.0707]}},
    }
    homed = {"method": "switch_index", "home_position_m": -0.07035}
    machine = with_dual(
        with_axes(on_plant(beam(), plants=ends), ["x"], homing=homed), square_offset_m=0.7e-3
    )
    (setup,) = machine.drivers.values()
    setup = dataclasses.replace(setup, cls=Marked)
    with Rig(dataclasses.replace(machine, drivers={"gantry": setup})) as rig:
        rig.order(Verb.HOME, "x")
        rig.wait_until(lambda: rig.state_of("x") is not AxisState.HOMING)
        rig.raise_faults()
        assert rig.driver.told
        rig.seconds(0.8)
        true = rig.driver.true_state().position_m
        assert abs(float(true[0] - true[1])) < 4e-6


def test_a_beam_too_far_askew_is_not_started_in_a_tick_without_a_sample_either():
    machine = silenced(absolute(with_dual(beam(), max_out_of_square_m=None), 1.2e-3))
    with Hand(machine) as hand:
        hand.steps(5)
        number = hand.memory.post(Verb.START, 0)
        without_sample(hand)
        assert hand.memory.reply(number) is Reply.OK
        hand.steps(3)
        assert cause_of(hand) is FaultCause.SKEW
        assert hand.row()["skew_command_v"] == 0.0


@pytest.mark.slow
def test_homing_begins_without_a_bump_where_the_encoders_error_is_declared(tmp_path):
    data = yaml.safe_load(shipped_config("small_stage").read_text())
    data["axes"]["x"]["model"]["encoder_error"] = {"period_m": 0.04, "sin_m": 20e-6}
    config = tmp_path / "stage.yaml"
    config.write_text(yaml.safe_dump(data))
    with Rig(load(config)) as rig:
        rig.order(Verb.HOME, "x")
        rig.wait_until(lambda: rig.state_of("x") is not AxisState.HOMING)
        rig.move("x", 0.01, 0.1)  # where the error is largest
        rig.wait_until(lambda: rig.state_of("x") is AxisState.IDLE)
        rig.seconds(0.2)
        rig.ask(Verb.HOME)
        rig.advance(5)
        newest = rig.rows("x")[-8:]
        assert np.ptp(newest["position_m"]) > 15e-6
        assert np.abs(np.diff(newest["command_v"])).max() < 0.1
        rig.raise_faults()


# Stopping


@pytest.mark.parametrize("reaction", ["disable", "quick_stop"])
def test_a_ramp_does_not_end_unseen_within_a_pause(reaction):
    """The axis is where nobody led it: that is told, and a ramp begins where it is."""
    frozen = {"host_frozen": HostFrozen(reaction=reaction)}
    with moving(on(with_axes(with_sim(gantry()), guards=frozen), 0, watchdog_s=None)) as hand:
        assert hand.ask(Verb.STOP) is Reply.OK
        hand.steps(50)
        hand.step(STOP)
        assert cause_of(hand) is FaultCause.HOST_FROZEN
        assert hand.driver.enabled is (reaction == "quick_stop")
        hand.steps(5000)
        assert hand.status()["state"] == AxisState.FAULT


def test_the_last_tick_of_a_ramp_looks_at_the_following_error():
    limits = {"following_error": {"minimum_m": 1e-3, "filter_time_s": 0.0}}
    machine = on(with_sim(gantry()), 0, watchdog_s=None)
    frozen = {"host_frozen": HostFrozen(time_s=0.9)}
    machine = with_axes(machine, ["x"], limits=limits, guards=frozen)
    with moving(machine) as hand:
        assert hand.ask(Verb.STOP) is Reply.OK
        hand.steps(50)
        hand.step(STOP)  # the last command has stood meanwhile
        assert cause_of(hand) is FaultCause.FOLLOWING_ERROR


def test_a_long_pause_is_told_as_one_and_not_as_late_ticks():
    guards = {"host_frozen": HostFrozen(reaction="quick_stop"), "late_ticks": Stops()}
    machine = on(with_axes(with_sim(gantry()), guards=guards), 0, watchdog_s=None)
    loop = machine.loop.model_copy(update={"overrun_policy": "stop"})
    with moving(dataclasses.replace(machine, loop=loop)) as hand:
        hand.step(STOP)
        assert cause_of(hand) is FaultCause.HOST_FROZEN
        assert hand.status()["fault_value"] == STOP - 1
        assert hand.driver.enabled
        hand.steps(2)
        assert abs(hand.row()["reference_velocity_m_s"]) > 0.1  # it ramps down from its motion


def test_a_pause_while_homing_is_told_as_the_pause():
    with Hand(to_be_homed(timeout_s=0.5)) as hand:
        hand.step()
        hand.ask(Verb.HOME)
        hand.steps(100)
        hand.step(round(0.6 / TS))
        assert cause_of(hand) is FaultCause.HOST_FROZEN


# The encoder and its samples


@pytest.mark.parametrize("stalled", [120, 450])
def test_an_encoder_is_not_stuck_where_the_pause_began_with_the_motion(stalled):
    """Friction has held the axis meanwhile: the last command was that of the motion's begin."""
    changes: dict[str, Any] = {
        "guards": {"host_frozen": HostFrozen(time_s=0.9)},
        "limits": {"following_error": {"filter_time_s": 1e3}},
    }
    with Hand(with_axes(with_driver(gantry(), Still), **changes)) as hand:
        hand.driver.counts[:] = 200_000
        hand.steps(5)
        assert hand.ask(Verb.START) is Reply.OK
        here = float(hand.status()["reference_m"])
        hand.follow("x", point_to_point(here, here + 0.1, 0.2, 5.0, 3000.0))
        hand.step(stalled + 1)
        assert abs(hand.row()["reference_m"] - here) > 1e-3
        assert cause_of(hand) is FaultCause.NONE


def test_an_encoder_that_sticks_is_found_on_a_computer_that_skips_every_other_period():
    limits = {"following_error": {"filter_time_s": 1e3}}
    with Hand(with_axes(with_driver(gantry(), Still), limits=limits)) as hand:
        hand.driver.counts[:] = 200_000
        hand.steps(5)
        assert hand.ask(Verb.START) is Reply.OK
        here = float(hand.status()["reference_m"])
        hand.follow("x", point_to_point(here, here + 0.1, 0.1, 1.0, 50.0))
        for _ in range(500):
            hand.step(2)
            if cause_of(hand) is not FaultCause.NONE:
                break
        assert cause_of(hand) is FaultCause.ENCODER_STUCK


@pytest.mark.parametrize("ends", [1, 2], ids=["one", "beam"])
def test_a_counter_that_may_have_gone_round_in_a_pause_of_an_exchange_is_no_jump(ends):
    if ends == 1:
        encoder = {"counter_bits": 16, "resolution_m": 0.1e-6}
        machine = with_axes(with_sim(gantry()), ["x"], encoder=encoder)
    else:
        still = beam().loop.model_copy(update={"without_realtime": "degrade"})
        machine = with_axes(absolute(beam()), ["x"], encoder={"counter_bits": 14})
        machine = dataclasses.replace(machine, loop=still)
    with Hand(on(machine, 0, hold_ticks=100, exchanges=True, watchdog_s=None)) as hand:
        hand.steps(5)
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(100)
        hand.step(60)
        hand.steps(3)
        assert cause_of(hand) is FaultCause.HOST_FROZEN


def test_samples_that_the_loops_own_pauses_cost_are_not_told_as_a_silent_device():
    late = [
        (0, False, lambda hand: read_late(hand, 5)),
        (3, True, lambda hand: read_late(hand, 3)),
        (3, True, lambda hand: (hand.step(2), hand.step(2), hand.step(2))),
    ]
    frozen = {"host_frozen": HostFrozen(time_s=0.5)}
    for hold_ticks, exchanges, pause in late:
        machine = with_axes(with_sim(gantry()), guards=frozen)
        with moving(on(machine, 0, hold_ticks=hold_ticks, exchanges=exchanges)) as hand:
            pause(hand)
            assert cause_of(hand) in (FaultCause.NONE, FaultCause.HOST_FROZEN)


@pytest.mark.parametrize("enabled", [False, True])
def test_one_sample_with_a_wrong_top_bit_does_not_move_an_absolute_axis_by_a_whole_counter(enabled):
    machine = with_axes(with_driver(gantry(), Still), ["x"], encoder={"counter_bits": 24})
    with Hand(machine) as hand:
        hand.driver.counts[:] = 200_000
        hand.steps(5)
        before = float(hand.row()["position_m"])
        if enabled:
            assert hand.ask(Verb.START) is Reply.OK
        hand.driver.counts[0] ^= 1 << 23
        hand.step()
        hand.driver.counts[0] ^= 1 << 23
        hand.steps(2)
        assert cause_of(hand) is (FaultCause.ENCODER_JUMP if enabled else FaultCause.NONE)
        assert hand.row()["position_m"] == pytest.approx(before)
        if enabled:
            assert hand.ask(Verb.RESET) is Reply.OK
            hand.step()
            assert hand.row()["position_m"] == pytest.approx(before)


# Partners


def test_a_reset_right_after_a_trip_does_not_hide_it_from_the_partners():
    machine = dataclasses.replace(gantry(), stop_together=(("x", "y"),))
    with Hand(with_driver(machine, Still)) as hand:
        hand.driver.counts[:] = 200_000
        hand.steps(5)
        for name in ("x", "y"):
            assert hand.ask(Verb.START, name) is Reply.OK
        hand.steps(5)
        hand.driver.counts[0] += 2_300  # 1.15 mm: tripped in the axis' own step, after the others
        while cause_of(hand) is FaultCause.NONE:
            hand.step()
        assert cause_of(hand) is FaultCause.FOLLOWING_ERROR
        hand.ask(Verb.RESET, "x")
        assert FaultCause(int(hand.status("y")["fault"])) is FaultCause.PARTNER
