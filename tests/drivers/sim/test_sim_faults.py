"""Faults come when they were ordered, and do what they say."""

import numpy as np
import pytest
from sim_bench import PERIOD_S, Bench, bare

from motorctl.hal import Status

AT, DURATION = 0.02, 0.01
FIRST, LAST = round(AT / PERIOD_S), round((AT + DURATION) / PERIOD_S)
IN_FORCE = (slice(FIRST, LAST), slice(LAST, None))


def run_with(kind, *, plant=None, channel=None, duration_s=DURATION, **amount):
    fault = {"kind": kind, "at_s": AT, "channel": channel, "duration_s": duration_s, **amount}
    plants = (plant or bare(), bare())
    return Bench(*plants, faults=[fault]).run(1.0, 250)


@pytest.mark.parametrize(
    ("kind", "bit"),
    [
        ("encoder_lost", Status.ENCODER_LOST),
        ("amplifier_fault", Status.AMPLIFIER_FAULT),
        ("communication_lost", Status.COMMUNICATION_LOST),
        ("estop", Status.ESTOP),
    ],
)
def test_the_status_tells_a_fault_for_as_long_as_it_lasts(kind, bit):
    told = (run_with(kind).status & bit) != 0
    expected = np.zeros(251, bool)
    expected[FIRST:LAST] = True
    assert np.array_equal(told[:, 0], expected)
    assert np.array_equal(told[:, 1], expected)  # without a channel: all of them


def test_a_fault_of_one_channel_leaves_the_others_alone():
    motion = run_with("encoder_lost", channel=1)
    assert not motion.status[:, 0].any()
    assert motion.status[FIRST, 1] == Status.ENCODER_LOST


@pytest.mark.parametrize("kind", ["encoder_lost", "encoder_stuck", "communication_lost"])
def test_a_lost_encoder_stands_still_while_the_carriage_moves_on(kind):
    motion = run_with(kind)
    assert np.ptp(motion.counts[FIRST - 1 : LAST, 0]) == 0
    assert (np.diff(motion.position_m[:, 0]) > 0).all()
    error = motion.counts[:, 0] * 1e-9 - motion.position_m[:, 0]
    assert error[LAST:] == pytest.approx(0.0, abs=1e-9)  # found again


def test_a_stuck_encoder_does_not_tell():
    assert not run_with("encoder_stuck").status.any()


@pytest.mark.parametrize("kind", ["amplifier_fault", "estop", "communication_lost"])
def test_without_amplifier_there_is_no_thrust(kind):
    acceleration = run_with(kind).acceleration_m_s2[:, 0]
    assert not acceleration[FIRST + 1 : LAST + 1].any()
    assert acceleration[FIRST] == pytest.approx(5.0)
    assert acceleration[LAST + 1 :] == pytest.approx(5.0)


def test_a_jump_of_the_encoder_stays():
    motion = run_with("encoder_jump", duration_s=None, jump_m=1e-4)
    error = motion.counts[:, 0] * 1e-9 - motion.position_m[:, 0]
    assert error[:FIRST] == pytest.approx(0.0, abs=1e-9)
    assert error[FIRST:] == pytest.approx(1e-4, abs=1e-9)


def test_a_force_step_pushes_the_carriage_for_its_time():
    acceleration = run_with("force_step", force_v=-3.0).acceleration_m_s2[:, 0]
    assert acceleration[FIRST + 1 : LAST + 1] == pytest.approx((1.0 - 3.0) / 0.2)
    assert acceleration[LAST + 1 :] == pytest.approx(5.0)


def test_a_fault_without_a_duration_is_for_good():
    status = run_with("amplifier_fault", duration_s=None).status[:, 0]
    assert (status[FIRST:] == Status.AMPLIFIER_FAULT).all()


def test_a_fault_can_be_there_at_power_on():
    fault = {"kind": "encoder_lost", "at_s": 0.0}
    motion = Bench(bare(), faults=[fault]).run(1.0, 5)
    assert (motion.status == Status.ENCODER_LOST).all()
    assert not motion.counts.any()
