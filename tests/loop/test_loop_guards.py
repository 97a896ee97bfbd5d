"""Guards of encoder, command, motor and computer: what trips them, what does not, what is told."""

from itertools import product

import numpy as np
import pytest
from loop_bench import TS, Hand, Rig, Still, gantry, homed_by, with_axes, with_driver, with_sim

from motorctl.config import load
from motorctl.config.guard_keys import EncoderNoise, Saturation, Thermal
from motorctl.daemon.axis_faults import faults_of
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.loop.faults import lasting_words
from motorctl.motion import point_to_point

RESOLUTION_M = 0.5e-6
PATIENT = {"following_error": {"filter_time_s": 1e3}}
"""Limits of an axis that never trips on its following error."""


def still(limits=None, **guards) -> Rig:
    """Return the gantry on a device whose counts the test moves, both axes enabled at 0."""
    machine = with_axes(gantry(), limits=PATIENT | (limits or {}), guards=guards)
    rig = Rig(with_driver(machine, Still))
    rig.tick.open(virtual=True)
    rig.start()
    return rig


def told(rig) -> str:
    return faults_of(rig.machine, rig.memory.axis_status)["x"]["message"]


# Encoder


@pytest.mark.parametrize("at_s", [0.05, 0.3])
def test_an_encoder_that_sticks_in_motion_trips_before_the_following_error(at_s):
    fault = {"kind": "encoder_stuck", "at_s": at_s, "channel": 0}
    with Rig(with_sim(gantry(), faults=[fault])) as rig:
        rig.start()
        rig.move("x", 0.3)
        rig.seconds(0.6)
        assert rig.fault_of("x") is FaultCause.ENCODER_STUCK
        assert rig.state("x")["fault_value"] == pytest.approx(0.001, abs=2e-4)
        assert "the count did not change" in told(rig)
        assert "limit 1 mm" in told(rig)
        assert np.abs(rig.rows("x")["following_error_m"]).max() < 0.0013


def test_an_axis_that_holds_may_hold_its_count():
    rig = still()
    rig.seconds(3.0)
    assert rig.state_of("x") is AxisState.IDLE


def test_a_count_that_flickers_by_one_stands_still():
    rig = still()
    rig.move("x", 0.1)
    for k in range(1000):
        rig.driver.counts[0] = k % 2
        rig.advance(1)
    assert rig.fault_of("x") is FaultCause.ENCODER_STUCK


def test_slow_motion_is_no_stuck_encoder():
    with Rig(with_sim(gantry())) as rig:
        rig.start()
        rig.follow({"x": point_to_point(0.0, 0.004, 0.002, 5.0, 500.0)})
        rig.seconds(2.2)
        rig.raise_faults()
        assert rig.last("x")["position_m"] == pytest.approx(0.004, abs=1e-5)


def test_noise_that_no_motion_makes_trips_at_rest():
    plants = {0: {"encoder": {"noise_rms_m": 10e-6}}}
    machine = with_axes(
        with_sim(gantry(), plants=plants), guards={"encoder_noise": EncoderNoise(rms_m=10e-6)}
    )
    with Rig(machine) as rig:
        rig.start()
        rig.seconds(0.5)
        assert rig.fault_of("x") is FaultCause.ENCODER_NOISE
        assert rig.state_of("y") is AxisState.IDLE
        assert "um rms" in told(rig)
        assert "limit 10 um" in told(rig)


def test_an_encoder_that_still_trembles_is_not_reset_and_one_that_is_calm_again_is():
    rig = still(encoder_noise=EncoderNoise(rms_m=10e-6))
    for k in range(2000):
        rig.driver.counts[0] = 40 * (k % 2)
        rig.advance(1)
    assert rig.fault_of("x") is FaultCause.ENCODER_NOISE
    assert rig.ask(Verb.RESET) is Reply.CAUSE_LASTS
    assert "trembles" in lasting_words(FaultCause.ENCODER_NOISE)
    rig.seconds(0.5)
    assert rig.ask(Verb.RESET) is Reply.OK
    assert rig.state_of("x") is AxisState.OFF


def test_motion_and_a_knock_are_no_noise():
    knock = {"kind": "force_step", "at_s": 1.2, "duration_s": 0.002, "channel": 0, "force_v": 5.0}
    machine = with_axes(
        with_sim(gantry(), faults=[knock]), guards={"encoder_noise": EncoderNoise(rms_m=4e-6)}
    )
    with Rig(machine) as rig:
        rig.start()
        rig.move("x", 0.3)
        rig.seconds(1.5)
        rig.raise_faults()


# Command


def test_a_command_at_its_limit_for_too_long_trips():
    time_s = 0.05
    rig = still({"max_voltage_v": 3.0}, saturation=Saturation(time_s=time_s))
    rig.driver.counts[0] = 400
    rig.seconds(0.2)
    assert rig.fault_of("x") is FaultCause.SATURATION
    rows = rig.rows("x")
    at_limit = (np.abs(rows["command_v"]) == 3.0).sum()
    assert at_limit == pytest.approx(time_s / TS + 1, abs=1)
    assert "limits.max_voltage_v" in told(rig)
    assert "limit 0.05 s" in told(rig)


def test_a_command_that_leaves_its_limit_now_and_then_is_forgiven():
    rig = still({"max_voltage_v": 3.0}, saturation=Saturation(time_s=0.05))
    for _ in range(4):
        rig.driver.counts[0] = 400
        rig.seconds(0.045)
        rig.driver.counts[0] = 0
        rig.seconds(0.05)
    assert rig.state_of("x") is AxisState.IDLE


def oscillating(lag_s, limits=None, **guards) -> Rig:
    """Return a gantry whose x has so much more lag than its model that its loop is unstable."""
    machine = with_sim(gantry(), plants={0: {"input_lag": {"time_s": lag_s}}})
    rig = Rig(with_axes(machine, ["x"], limits=limits or {}, guards=guards))
    rig.start()
    rig.move("x", 0.2)
    return rig


def longest_s(so) -> float:
    """Return for how long it was so at once, at most [s]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], so, [0]])))
    return float(np.diff(edges)[::2].max() * TS)


def test_an_axis_that_shakes_at_its_full_voltage_trips_though_no_swing_lasts_long():
    window = {"following_error": {"minimum_m": 5e-3, "filter_time_s": 0.01}}
    with oscillating(4e-3, window) as rig:
        rig.seconds(2.0)
        assert rig.fault_of("x") is FaultCause.SATURATION
        at_limit = np.abs(rig.rows("x")["command_v"]) == 10.0
        assert longest_s(at_limit) < 0.05  # of the 0.5 s that are allowed
        assert "longer than below it" in told(rig)


def test_an_axis_that_swings_through_its_reference_is_too_far_from_it_all_the_same():
    window = {"following_error": {"minimum_m": 4e-4, "filter_time_s": 0.016}}
    with oscillating(4e-3, window, saturation=None) as rig:
        rig.seconds(2.0)
        assert rig.fault_of("x") is FaultCause.FOLLOWING_ERROR
        error = np.abs(rig.rows("x")["following_error_m"])
        assert longest_s(error > 4e-4) < 0.016


def hot() -> Rig:
    """Return a machine whose x pushes with 3 V, where its motor stands 1 V."""
    guard = Thermal(continuous_voltage_v=1.0, time_constant_s=0.5)
    rig = still({"max_voltage_v": 3.0}, thermal=guard, saturation=None)
    rig.driver.counts[0] = 400
    return rig


def test_a_motor_that_is_driven_beyond_its_continuous_command_trips_when_it_is_warm():
    rig = hot()
    rig.seconds(0.2)
    assert rig.fault_of("x") is FaultCause.THERMAL
    pushed_s = (np.abs(rig.rows("x")["command_v"]) == 3.0).sum() * TS
    assert pushed_s == pytest.approx(-0.5 * np.log(1 - 1 / 9), rel=0.03)
    assert "limit 1 V" in told(rig)


def test_a_warm_motor_is_not_reset_before_it_has_cooled_down():
    rig = hot()
    rig.seconds(0.1)
    assert rig.ask(Verb.RESET) is Reply.CAUSE_LASTS
    assert rig.state_of("x") is AxisState.FAULT
    rig.seconds(0.12)
    assert rig.ask(Verb.RESET) is Reply.OK


def test_a_motor_stands_its_continuous_command_for_ever():
    guard = Thermal(continuous_voltage_v=3.001, time_constant_s=0.1)
    rig = still({"max_voltage_v": 3.0}, thermal=guard, saturation=None)
    rig.driver.counts[0] = 400
    rig.seconds(2.0)
    assert rig.state_of("x") is AxisState.IDLE


def test_an_axis_that_is_still_too_fast_is_not_reset():
    rig = still()
    step = round(1.85 * TS / RESOLUTION_M)
    for _ in range(10):
        rig.driver.counts[0] += step
        rig.advance(1)
    assert rig.fault_of("x") is FaultCause.OVERSPEED
    rig.driver.counts[0] += step
    assert rig.ask(Verb.RESET) is Reply.CAUSE_LASTS
    assert rig.ask(Verb.RESET) is Reply.OK  # the counts stand


# Computer


def test_a_computer_that_stood_still_for_too_long_is_the_cause():
    with Hand(with_sim(gantry())) as hand:
        hand.steps(5)
        assert hand.ask(Verb.START) is Reply.OK
        hand.follow("x", point_to_point(0.0, 0.4, 0.5, 5.0, 500.0))
        hand.steps(500)
        hand.step(round(0.1 / TS) + 2)
        status = hand.status()
        assert FaultCause(int(status["fault"])) is FaultCause.HOST_FROZEN
        assert (status["fault_value"], status["fault_limit"]) == (501, 500)
        assert hand.row()["command_v"] == 0.0


@pytest.mark.parametrize("elapsed", [30, 60, 200, 2000])
def test_a_pause_of_the_computer_is_never_told_as_the_encoders_fault(elapsed):
    # 16 bits of half a micrometre are 33 mm.
    machine = with_axes(with_sim(gantry()), ["x"], encoder={"counter_bits": 16})
    machine = with_axes(machine, ["x"], homing=homed_by("index"))
    with Hand(machine) as hand:
        hand.steps(5)
        hand.tick.axes["homed"][0] = 1
        assert hand.ask(Verb.START) is Reply.OK
        hand.follow("x", point_to_point(0.0, 0.4, 1.2, 20.0, 4000.0))
        hand.steps(900)
        assert hand.row()["velocity_m_s"] > 1.1
        hand.step(elapsed)
        hand.steps(20)
        fault = FaultCause(int(hand.status()["fault"]))
        assert fault not in (
            FaultCause.ENCODER_JUMP,
            FaultCause.ENCODER_STUCK,
            FaultCause.ENCODER_LOST,
            FaultCause.ENCODER_NOISE,
        )
        if elapsed >= 200:
            assert fault is FaultCause.HOST_FROZEN
            assert hand.status()["fault_value"] == elapsed - 1


# Ordinary motion


SHIPPED = ("published_gantry", "small_stage", "dual_gantry", "can_gantry", "canopen_gantry",
           "serial_gantry", "modbus_gantry")  # fmt: skip
SIMULATED = ("small_stage", "dual_gantry")
"""Of these, what moves by a plant of its own; the others are tried with the published gantry's."""
FEW = [("published_gantry", "C1"), ("published_gantry", "C2"), ("small_stage", "C2")]
"""Each compiles a tick of its own, unless other tests share it."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "controller"),
    [
        pytest.param(*pair, marks=() if pair in FEW else pytest.mark.long)
        for pair in product(SHIPPED, ("C1", "C2"))
    ],
)
def test_the_shipped_configurations_move_without_tripping(name, controller):
    machine = load(name, controller)
    if name not in SIMULATED:
        machine = with_sim(machine, preset="published_gantry")
    with VirtualRows(machine) as rig:
        rig.start()
        rig.follow_programs(machine.followed_programs)
        rig.advance(round(10.0 * machine.rate_hz))
        rig.raise_faults()
        for axis, setting in zip(machine.axes.values(), rig.tick.settings, strict=True):
            assert setting["stuck_distance_m"] == axis.limits.following_error.minimum_m
            assert setting["saturation_ticks"] * axis.divisor == 0.5 * machine.rate_hz


class VirtualRows(Rig):
    """A rig that drops its rows: ten seconds of them are many."""

    def __init__(self, machine) -> None:
        super().__init__(machine)
        self.chunks = Forgetful()


class Forgetful(list):
    def append(self, rows) -> None:
        self[:] = [rows]
