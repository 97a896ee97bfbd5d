"""A tick that finds no new sample: what is held, what is predicted, and when the axis trips."""

import dataclasses
import time

import numpy as np
import pytest
from loop_bench import TS, Hand, Rig, gantry, with_axes, with_sim

from motorctl.config.guard_keys import JUMP_SPEED_RATIO, EncoderNoise
from motorctl.config.keys import LateSamples
from motorctl.hal import Inputs, Status
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.loop import Reply, Verb
from motorctl_sim import SimDriver

pytestmark = pytest.mark.slow

HOLD = 5
SPEED_M_S = 0.8
PERIOD_COUNTS = round(SPEED_M_S * TS / 0.5e-6)
"""A period's motion: a count that is off by it is one of the next period."""


class Deaf(SimDriver):
    """A gantry that hears nothing new in the reads of `deaf`, and a wrong count in `shifts`."""

    def __init__(self, options, channels, period_s):
        super().__init__(options, channels, period_s)
        self.deaf: set[int] = set()
        self.shifts: dict[int, float] = {}
        self.reads = 0
        self.heard = Inputs(len(self.channels))

    def read(self, inputs: Inputs) -> None:
        self.reads += 1
        if self.reads - 1 not in self.deaf:
            super().read(self.heard)
            inputs.counts[:], inputs.status[:] = self.heard.counts, self.heard.status
        else:
            inputs.counts[:] = self.heard.counts
            inputs.status[:] = self.heard.status | Status.STALE
        inputs.counts += round(self.shifts.get(self.reads - 1, 0.0) * PERIOD_COUNTS)


def rig_of(
    *, predict: bool = False, hold_ticks: int = HOLD, faults=(), plants=None, guard=None
) -> Rig:
    machine = with_sim(gantry(), faults=list(faults), **({"plants": plants} if plants else {}))
    if guard is not None:
        machine = with_axes(machine, guards={"encoder_noise": guard})
    setup = dataclasses.replace(
        machine.drivers["gantry"],
        cls=Deaf,
        late=LateSamples(hold_ticks=hold_ticks, predict=predict),
    )
    return Rig(dataclasses.replace(machine, drivers={"gantry": setup}))


def run(
    missing, *, predict: bool, seconds: float = 0.4, shifted=(), periods=1, hold_ticks=40
) -> Rig:
    """Let x move; `missing` are the ticks of the move's middle without a sample."""
    rig = rig_of(predict=predict, hold_ticks=hold_ticks)
    with rig:
        rig.start()
        rig.move("x", 0.2, SPEED_M_S)
        middle = rig.ticks + round(0.15 / TS)
        rig.driver.deaf = {middle + k for k in missing}
        rig.driver.shifts = {middle + k: periods for k in shifted}
        rig.seconds(seconds)
    return rig


def test_the_last_position_and_the_last_command_are_held_while_no_sample_comes():
    rows = run(range(4), predict=False).rows("x")
    held = np.flatnonzero(rows["flags"] & SampleFlag.HELD)
    assert len(held) == 4
    before = rows[held[0] - 1]
    assert (rows["position_m"][held] == before["position_m"]).all()
    assert (rows["command_v"][held] == before["command_v"]).all()
    assert (rows["state"][held] == AxisState.RUNNING).all()


def test_the_first_sample_after_a_pause_is_no_kick():
    pause, quiet = run(range(4), predict=False).rows("x"), run((), predict=False).rows("x")
    last = np.flatnonzero(pause["flags"] & SampleFlag.HELD)[-1]
    after = slice(last + 1, last + 40)
    # Read as one period's, four periods' motion would be some 100 V of feedback.
    assert np.abs(pause["command_v"][after] - quiet["command_v"][after]).max() < 1.0
    assert pause["velocity_m_s"][last + 1] == pytest.approx(quiet["velocity_m_s"][last], abs=0.01)


@pytest.mark.parametrize("pause", [3, 15, 30])
def test_the_model_predicts_where_the_axis_is(pause):
    predicted = run(range(pause), predict=True).rows("x")
    true = run((), predict=True).rows("x")
    held = np.flatnonzero(predicted["flags"] & SampleFlag.HELD)
    assert len(held) == pause
    moved = true["position_m"][held[-1]] - true["position_m"][held[0] - 1]
    missed = np.abs(predicted["position_m"] - true["position_m"])[held].max()
    assert moved > 0.3e-3
    # One count of the encoder more or less is 2.5 mm/s, which the prediction starts from.
    assert missed < 0.01 * moved + 2.5e-3 * pause * TS


def test_a_prediction_teaches_nothing():
    rows = run(range(20), predict=True).rows("x")
    held = (rows["flags"] & SampleFlag.HELD) > 0
    assert not (rows["flags"][held] & SampleFlag.ADAPTING).any()
    first, last = np.flatnonzero(held)[[0, -1]]
    assert (rows["theta_hat"][last] == rows["theta_hat"][first - 1]).all()


@pytest.mark.parametrize(("predict", "hold"), [(False, HOLD), (True, HOLD), (False, 0)])
def test_samples_that_stay_away_trip_the_axis_after_the_configured_ticks(predict, hold):
    rig = rig_of(predict=predict, hold_ticks=hold)
    with rig:
        rig.start()
        rig.move("x", 0.2, SPEED_M_S)
        rig.seconds(0.15)
        silent = rig.ticks
        rig.driver.deaf = set(range(silent, silent + 10_000))
        rig.seconds(0.05)
        assert rig.state_of("x") is AxisState.FAULT
        assert rig.fault_of("x") is FaultCause.NO_NEW_SAMPLE
        status = rig.state("x")
        assert (status["fault_value"], status["fault_limit"]) == (hold + 1, hold)
        rows = rig.rows("x")[silent:]
        assert (rows["state"][:hold] == AxisState.RUNNING).all()
        assert (rows["command_v"][hold:] == 0.0).all()
        assert not rig.driver._states["enable"].any()


def test_an_axis_without_news_is_not_started_and_not_reset():
    rig = rig_of()
    with rig:
        rig.seconds(0.01)
        rig.driver.deaf = set(range(rig.ticks, rig.ticks + 100))
        rig.advance(HOLD + 1)
        assert rig.ask(Verb.START) is Reply.STILL_FAULTY
        rig.advance(100)
        assert rig.ask(Verb.START) is Reply.OK


def test_an_axis_that_never_had_a_sample_is_not_started():
    rig = rig_of()
    with rig:
        rig.driver.deaf = set(range(50))
        rig.advance(1)
        assert rig.ask(Verb.START) is Reply.STILL_FAULTY


def test_a_pause_that_may_hide_a_turn_of_the_counter_is_a_fault():
    machine = with_axes(with_sim(gantry()), ["x"], encoder={"counter_bits": 12})
    setup = dataclasses.replace(
        machine.drivers["gantry"], cls=Deaf, late=LateSamples(hold_ticks=10_000)
    )
    rig = Rig(dataclasses.replace(machine, drivers={"gantry": setup}))
    with rig:
        rig.start()
        rig.move("x", 0.2, SPEED_M_S)
        rig.seconds(0.15)
        rig.driver.deaf = set(range(rig.ticks, rig.ticks + 40))  # 6 mm; the counter wraps at 2
        rig.advance(60)
        assert rig.state_of("x") is AxisState.FAULT


class Paused(Deaf):
    """A simulated gantry whose next read takes as long as the test says."""

    pause_s = 0.0

    def read(self, inputs: Inputs) -> None:
        time.sleep(self.pause_s)
        self.pause_s = 0.0
        super().read(inputs)


def test_a_pause_between_waking_and_reading_is_no_speed():
    machine = with_sim(gantry())
    setup = dataclasses.replace(
        machine.drivers["gantry"], cls=Paused, late=LateSamples(hold_ticks=500, predict=True)
    )
    with Hand(dataclasses.replace(machine, drivers={"gantry": setup})) as hand:
        hand.steps(5)
        assert hand.ask(Verb.START) is Reply.OK
        assert hand.ask(Verb.START, "y") is Reply.OK
        hand.steps(5)
        hand.driver.pause_s = 3.5 * TS
        for _ in range(3):
            hand.driver.advance()  # the machine goes on while the loop pauses
        now = time.monotonic_ns()
        hand.number += 1
        hand.driver.advance()
        hand.tick.step(hand.number, 1, False, now, now)
        assert hand.row()["flags"] & SampleFlag.HELD
        hand.driver.advance()
        now = time.monotonic_ns()
        hand.number += 4
        soon = 5_000_000  # the machine that the test runs on may pause too
        hand.tick.step(hand.number, 4, True, now + soon - round(3 * TS * 1e9), now)
        assert not hand.row()["flags"] & SampleFlag.HELD
        assert AxisState(int(hand.status()["state"])) is AxisState.IDLE


def test_a_sample_of_another_period_does_not_reach_the_motor():
    rows, quiet = (run((), predict=True, shifted=k).rows("x") for k in ((0,), ()))
    held = np.flatnonzero(rows["flags"] & SampleFlag.HELD)
    assert len(held) == 1
    assert not (quiet["flags"] & SampleFlag.HELD).any()
    # Believed, it would be a speed of twice the true one: both ends of the voltage, one by one.
    assert np.abs(rows["command_v"] - quiet["command_v"]).max() < 0.5
    believed = run((), predict=False, shifted=(0,)).rows("x")
    assert np.abs(believed["command_v"] - quiet["command_v"]).max() > 5.0


@pytest.mark.parametrize(("hold_ticks", "doubted"), [(40, 1), (1, 1), (0, 0)])
def test_a_count_that_stays_where_no_motion_led_is_believed_and_trips_nothing(hold_ticks, doubted):
    rows, quiet = (
        run((), predict=True, shifted=k, periods=3, hold_ticks=hold_ticks).rows("x")
        for k in (range(9999), ())
    )
    held = np.flatnonzero(rows["flags"] & SampleFlag.HELD)
    assert len(held) == doubted
    assert not rows["fault"].any()
    after = rows["position_m"] - quiet["position_m"]
    believed = after[np.flatnonzero(after > SPEED_M_S * TS)[0]]
    assert believed == pytest.approx(3 * SPEED_M_S * TS, rel=0.05)


def test_doubted_samples_take_nothing_from_the_ticks_that_may_be_without_one():
    rows = run((1, 2, 3), predict=True, shifted=(0,), periods=3, hold_ticks=3).rows("x")
    assert np.count_nonzero(rows["flags"] & SampleFlag.HELD) == 4
    assert not rows["fault"].any()


def test_a_sample_that_is_a_little_early_is_believed_and_the_next_one_too():
    rows = run((), predict=True, shifted=(0, 7, 8, 15), periods=-0.4).rows("x")
    assert not (rows["flags"] & SampleFlag.HELD).any()


def glitched(shifts, *, predict, silent=0):
    """Let x move over samples that are off by so many periods, then none for a while."""
    rig = rig_of(predict=predict, hold_ticks=40)
    with rig:
        rig.start()
        rig.move("x", 0.2, SPEED_M_S)
        middle = rig.ticks + round(0.15 / TS)
        rig.driver.shifts = {middle + k: periods for k, periods in enumerate(shifts)}
        rig.driver.deaf = {middle + len(shifts) + k for k in range(silent)}
        rig.seconds(0.4)
    return rig.rows("x")


@pytest.mark.parametrize("shifts", [(1.0, -1.0), (3.0, -1.5), (-2.0, 1.0)])
def test_two_wrong_samples_that_disagree_are_no_speed_to_predict_a_silence_from(shifts):
    rows, quiet = (glitched(k, predict=True, silent=5) for k in (shifts, ()))
    assert not rows["fault"].any()
    off = np.abs(rows["position_m"] - quiet["position_m"]).max()
    assert off < (np.abs(shifts).max() + 1.0) * SPEED_M_S * TS


@pytest.mark.parametrize(("share", "silent"), [(-0.9, 0), (-0.7, 0), (1.5, 3)])
def test_one_wild_sample_is_left_out_and_trips_nothing(share, silent):
    """`share` is of what the counter may move in a period, which a silence makes more of."""
    reach = JUMP_SPEED_RATIO * gantry().axes["x"].limits.max_velocity_m_s / SPEED_M_S
    rig = rig_of(predict=True, hold_ticks=40)
    with rig:
        rig.start()
        rig.move("x", 0.2, SPEED_M_S)
        middle = rig.ticks + round(0.15 / TS)
        rig.driver.deaf = set(range(middle - silent, middle))
        rig.driver.shifts = {middle: share * reach}
        rig.seconds(0.2)
    rows = rig.rows("x")
    assert not rows["fault"].any()
    assert np.count_nonzero(rows["flags"] & SampleFlag.LEFT_OUT) == 1


def test_samples_that_are_left_out_again_and_again_trip_as_if_none_were():
    rows = glitched([0.0, 2.0] * 300, predict=True)
    assert FaultCause(int(rows["fault"][-1])) is not FaultCause.NONE
    left_out = (rows["flags"] & SampleFlag.LEFT_OUT) > 0
    assert 1 <= np.count_nonzero(left_out) < 0.2 * 600


def at_rest(*, predict, noise_rms_m=0.0, limit_m, wild=(), seconds=0.5):
    """Let x rest under the guard of noise; `wild` are ticks whose sample is off by 150 um."""
    plants = {0: {"encoder": {"noise_rms_m": noise_rms_m}}}
    rig = rig_of(predict=predict, hold_ticks=40, plants=plants, guard=EncoderNoise(rms_m=limit_m))
    with rig:
        rig.start()
        begin = rig.driver.reads + 500
        rig.driver.shifts = {begin + k: 150e-6 / (SPEED_M_S * TS) for k in wild}
        rig.seconds(seconds)
    return rig.rows("x")


def test_noise_trips_as_soon_where_samples_are_left_out_as_where_none_are():
    tripped = []
    for predict in (True, False):
        rows = at_rest(predict=predict, noise_rms_m=4e-6, limit_m=9e-6)  # it bends by 9.8 um
        assert FaultCause(int(rows["fault"][-1])) is FaultCause.ENCODER_NOISE
        tripped.append(int(np.argmax(rows["fault"] > 0)))
        if predict:
            left_out = (rows["flags"][: tripped[0]] & SampleFlag.LEFT_OUT) > 0
            assert np.count_nonzero(left_out) > 0.01 * tripped[0]  # that is what hid it
    assert tripped[0] == pytest.approx(tripped[1], rel=0.15)


def test_noise_below_the_limit_trips_nothing_though_samples_are_left_out():
    rows = at_rest(predict=True, noise_rms_m=4e-6, limit_m=12e-6, seconds=1.5)
    assert not rows["fault"].any()
    assert np.count_nonzero(rows["flags"] & SampleFlag.LEFT_OUT) > 10


def test_one_wild_sample_is_no_noise_and_two_soon_after_each_other_are():
    assert not at_rest(predict=True, limit_m=10e-6, wild=(0,))["fault"].any()
    assert not at_rest(predict=True, limit_m=10e-6, wild=(0, 1200), seconds=0.6)["fault"].any()
    rows = at_rest(predict=True, limit_m=10e-6, wild=(0, 60))
    assert FaultCause(int(rows["fault"][-1])) is FaultCause.ENCODER_NOISE


def test_wild_counts_while_an_axis_was_off_leave_no_speed_to_expect_samples_by():
    with rig_of(predict=True, hold_ticks=40) as rig:
        rig.start()
        for axis in rig.machine.axes:
            rig.ask(Verb.STOP, axis)
        rig.wait_until(lambda: rig.state_of("x") is AxisState.OFF)
        rig.driver.shifts = {rig.driver.reads + k: (-1) ** k * 1e4 for k in range(50)}
        rig.driver.shifts[rig.driver.reads + 50] = 2e4
        rig.seconds(53 * TS)  # and two that are right: it stands
        begin = rig.ticks
        rig.start()
        rig.seconds(0.1)
    rows = rig.rows("x")[begin:]
    assert rig.state_of("x") is AxisState.IDLE
    assert not (rows["flags"] & SampleFlag.LEFT_OUT).any()


def test_a_sample_that_was_left_out_is_flagged_and_a_silence_is_not():
    rows = run((3, 4), predict=True, shifted=(0,)).rows("x")
    held = (rows["flags"] & SampleFlag.HELD) > 0
    left_out = (rows["flags"] & SampleFlag.LEFT_OUT) > 0
    assert np.count_nonzero(held) == 3
    assert np.count_nonzero(left_out) == 1
    assert held[left_out].all()


@pytest.mark.parametrize("force_v", [-8.0, -15.0, -25.0, 25.0])
@pytest.mark.parametrize("duration_s", [0.001, 0.002])
def test_a_knock_is_answered_as_if_nothing_were_ever_doubted(force_v, duration_s):
    knock = {"kind": "force_step", "at_s": 0.1, "force_v": force_v, "duration_s": duration_s}
    error_m, held = [], []
    for predict in (True, False):
        with rig_of(predict=predict, hold_ticks=40, faults=[{**knock, "channel": 0}]) as rig:
            rig.start()
            rig.seconds(0.3)
            rows = rig.rows("x")
            assert not rows["fault"].any()
            error_m.append(np.abs(rows["following_error_m"]))
            held.append(np.count_nonzero(rows["flags"] & SampleFlag.HELD))
    doubting, believing = error_m
    assert held[0] <= 2
    assert held[1] == 0
    assert doubting.max() < 1.15 * believing.max()
    assert doubting[-500:].max() < 1.2 * believing[-500:].max() + 1e-6


@pytest.mark.parametrize("later", [1, 3])
def test_a_second_jump_of_the_encoder_is_found_though_the_first_was_doubted(later):
    limit_m = JUMP_SPEED_RATIO * gantry().axes["x"].limits.max_velocity_m_s * TS
    jumps = [
        {"kind": "encoder_jump", "at_s": 0.1 + k * TS, "channel": 0, "jump_m": share * limit_m}
        for k, share in ((0, 0.9), (later, -1.3))
    ]
    with rig_of(predict=True, hold_ticks=40, faults=jumps) as rig:
        rig.start()
        rig.seconds(0.2)
        assert rig.fault_of("x") is FaultCause.ENCODER_JUMP


def test_overspeed_is_found_as_soon_as_if_nothing_were_ever_doubted():
    push = {"kind": "force_step", "at_s": 0.1, "force_v": 300.0, "channel": 0}
    trips_s = []
    for predict in (True, False):
        with rig_of(predict=predict, hold_ticks=40, faults=[push]) as rig:
            rig.tick.settings["following_error_minimum_m"] = 1.0
            rig.start()
            rig.seconds(0.2)
            assert rig.fault_of("x") is FaultCause.OVERSPEED
            trips_s.append(float(rig.state("x")["fault_time_s"]))
    assert trips_s[0] - trips_s[1] <= 1.5 * TS


def test_a_loop_that_was_stopped_for_too_long_is_the_cause_itself():
    machine = with_sim(gantry())
    setup = dataclasses.replace(
        machine.drivers["gantry"], cls=Paused, late=LateSamples(hold_ticks=5, predict=True)
    )
    with Hand(dataclasses.replace(machine, drivers={"gantry": setup})) as hand:
        hand.steps(5)
        assert hand.ask(Verb.START) is Reply.OK
        hand.steps(5)
        hand.number += 20
        now = time.monotonic_ns()
        # The loop wakes 20 periods late, and reads late once more.
        hand.tick.step(hand.number, 20, True, now - round(25 * TS * 1e9), now)
        assert FaultCause(int(hand.status()["fault"])) is FaultCause.HOST_FROZEN
        assert (hand.status()["fault_value"], hand.status()["fault_limit"]) == (19, 5)


def test_ticks_without_a_sample_are_counted():
    rig = run((0, 1, 2, 50, 51), predict=True)
    status = rig.state("x")
    assert (status["missed_ticks"], status["longest_missed_ticks"]) == (5, 3)
