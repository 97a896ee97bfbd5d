"""Masses that move each other: coupled axes, parts on springs, parts in a clearance."""

import math

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter
from sim_bench import PERIOD_S, Bench, bare

THETA1 = 0.2


def coupled(own, other, **coupling):
    return bare(inertia_v_s2_m=own, cross_axis={"channel": other, **coupling})


def test_coupled_masses_accelerate_as_their_mass_matrix_says():
    m, c = np.array([0.2, 0.6]), 0.03
    plants = [coupled(m[i], 1 - i, acceleration_v_s2_m=c) for i in (0, 1)]
    motion = Bench(*plants).run([2.0, -1.0], 50)
    matrix = np.array([[m[0], c], [c, m[1]]])
    exact = np.linalg.solve(matrix, [2.0, -1.0])
    assert motion.acceleration_m_s2[-1] == pytest.approx(exact, rel=1e-9)


def test_coupling_is_linear_in_the_other_axis_motion():
    def pushed(u):
        plants = bare(cross_axis={"channel": 1, "acceleration_v_s2_m": 0.02}), bare()
        return Bench(*plants).run([0.0, u], 200).position_m[:, 0]

    assert 3.0 * pushed(1.0) == pytest.approx(pushed(3.0), rel=1e-9)
    assert pushed(1.0)[-1] < 0.0


def test_coupling_by_velocity_pushes_against_the_other_axis_motion():
    plants = (
        bare(inertia_v_s2_m=0.2, cross_axis={"channel": 1, "velocity_v_s_m": 0.5}),
        bare(initial_velocity_m_s=0.8),
    )
    motion = Bench(*plants).run(0.0, 100)
    assert motion.acceleration_m_s2[-1, 0] == pytest.approx(-0.5 * 0.8 / 0.2, rel=1e-12)


def test_a_coupled_channel_that_no_axis_uses_stands_still():
    alone = Bench(bare(cross_axis={"channel": 1, "acceleration_v_s2_m": 0.1})).run(1.0, 100)
    assert np.array_equal(alone.position_m, Bench(bare()).run(1.0, 100).position_m)


FREQUENCY_HZ, ZETA, FRACTION = 80.0, 0.02, 0.25


def flexible_bench():
    mode = {"frequency_hz": FREQUENCY_HZ, "damping_ratio": ZETA, "fraction": FRACTION}
    return Bench(bare(flexible_mode=mode))


def test_a_flexible_mode_answers_as_the_linear_system_of_its_formula():
    # theta1 a = u + fraction theta1 s^2/(s^2 + 2 zeta w s + w^2) a, solved for the velocity
    w = 2 * math.pi * FREQUENCY_HZ
    part = np.array([1.0, 2 * ZETA * w, w * w])
    rest = part - [FRACTION, 0.0, 0.0]
    step, denominator, _ = cont2discrete((part, np.append(THETA1 * rest, 0.0)), PERIOD_S, "zoh")
    volts = np.random.default_rng(1).standard_normal(5000)
    exact = lfilter(np.ravel(step), denominator, volts)
    motion = flexible_bench().run(volts[:, np.newaxis], len(volts))
    rigid = np.cumsum(volts) * PERIOD_S / THETA1
    error = motion.velocity_m_s[:-1, 0] - exact
    bending = exact[1:] - rigid[:-1]
    assert error.std() < 0.02 * bending.std()


def test_a_flexible_mode_is_rigid_to_slow_forces():
    motion = flexible_bench().run(1.0, 5000)
    assert motion.acceleration_m_s2[-1, 0] == pytest.approx(1.0 / THETA1, rel=1e-3)
    assert motion.velocity_m_s[-1, 0] == pytest.approx(1.0 / THETA1, rel=1e-2)


def test_a_part_that_its_friction_holds_keeps_the_carriage_on_its_spring():
    mode = {"frequency_hz": FREQUENCY_HZ, "damping_ratio": 0.5, "fraction": FRACTION}
    motion = Bench(bare(flexible_mode=mode | {"friction_v": 2.0})).run(1.0, 5000)
    stiffness = FRACTION * THETA1 * (2 * math.pi * FREQUENCY_HZ) ** 2
    assert motion.position_m[-1, 0] == pytest.approx(1.0 / stiffness, rel=1e-3)
    assert motion.velocity_m_s[-1, 0] == pytest.approx(0.0, abs=1e-6)


def test_a_part_that_slides_takes_its_friction_of_the_thrust():
    mode = {"frequency_hz": FREQUENCY_HZ, "damping_ratio": 0.5, "fraction": FRACTION}
    motion = Bench(bare(flexible_mode=mode | {"friction_v": 0.4})).run(1.0, 5000)
    assert motion.acceleration_m_s2[-1, 0] == pytest.approx((1.0 - 0.4) / THETA1, rel=1e-3)


def test_backlash_lets_the_carriage_go_alone_until_the_gap_is_used_up():
    gap, fraction = 50e-6, 0.3
    motion = Bench(bare(backlash={"gap_m": gap, "fraction": fraction})).run(0.5, 400)
    free = motion.position_m[:, 0] < 0.49 * gap
    assert free.sum() > 5
    alone = 0.5 / (THETA1 * (1.0 - fraction))
    assert motion.acceleration_m_s2[free, 0][1:] == pytest.approx(alone, rel=1e-12)
    # bounces of the loose part die out; then both move as one
    assert motion.acceleration_m_s2[-100:, 0].mean() == pytest.approx(0.5 / THETA1, rel=0.05)


def test_bouncing_in_the_clearance_keeps_the_momentum():
    loose = {"gap_m": 20e-6, "fraction": 0.4, "damping_ratio": 0.0}
    bench = Bench(bare(backlash=loose))
    motion = bench.run(np.where(np.arange(3000) < 50, 1.0, 0.0)[:, np.newaxis], 3000)
    # thrust x time is shared by both parts: the mean speed is that of the whole mass
    exact = 1.0 * 50 * PERIOD_S / THETA1
    assert motion.velocity_m_s[-2000:, 0].mean() == pytest.approx(exact, rel=0.02)
    assert np.ptp(motion.velocity_m_s[-2000:, 0]) > 0.05 * exact
