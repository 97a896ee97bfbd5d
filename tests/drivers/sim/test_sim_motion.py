"""The simulated carriage moves as mechanics says, against analytic answers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from sim_bench import PERIOD_S, Bench, bare

THETA1 = 0.2


def test_constant_thrust_gives_constant_acceleration_exactly():
    motion = Bench(bare()).run(3.0, 500)
    t = motion.time_s
    assert motion.position_m[:, 0] == pytest.approx(0.5 * 3.0 / THETA1 * t**2, rel=1e-11)
    assert motion.velocity_m_s[:, 0] == pytest.approx(3.0 / THETA1 * t, rel=1e-11)


@settings(max_examples=20)
@given(viscous=st.floats(0.01, 5.0), v0=st.floats(-2.0, 2.0))
def test_a_carriage_left_alone_decays_exponentially_under_viscous_friction(viscous, v0):
    bench = Bench(bare(viscous_friction_v_s_m=viscous, initial_velocity_m_s=v0))
    motion = bench.run(0.0, 300)
    rate = viscous / THETA1
    decay = np.exp(-rate * motion.time_s)
    tolerance = 1e-4 * abs(v0) * (rate * 20e-6) + 1e-12  # second order in the substep
    assert motion.velocity_m_s[:, 0] == pytest.approx(v0 * decay, abs=100 * tolerance)
    travelled = v0 / rate * (1.0 - decay)
    assert motion.position_m[:, 0] == pytest.approx(travelled, abs=tolerance)


def test_halving_the_substep_quarters_the_error_of_viscous_decay():
    errors = []
    for substep in (40e-6, 20e-6):
        plant = bare(viscous_friction_v_s_m=20.0, initial_velocity_m_s=1.0)
        motion = Bench(plant, substep_s=substep).run(0.0, 50)
        exact = math.exp(-20.0 / THETA1 * motion.time_s[-1])
        errors.append(abs(motion.velocity_m_s[-1, 0] - exact))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_speed_settles_where_thrust_balances_friction_and_drag():
    plant = bare(
        viscous_friction_v_s_m=0.5,
        coulomb_friction_v=0.15,
        quadratic_drag={"drag_v_s2_m2": 0.3},
        travel_m=[-10.0, 1000.0],
    )

    def balance(v):
        return 2.0 - 0.5 * v - 0.15 * 2 / math.pi * math.atan(900 * v) - 0.3 * v * v

    motion = Bench(plant).run(2.0, 15000)
    assert motion.velocity_m_s[-1, 0] == pytest.approx(brentq(balance, 0.0, 4.0), rel=1e-7)


def test_coulomb_friction_slows_down_linearly():
    plant = bare(coulomb_friction_v=0.1, friction_slope_s_m=1e4, initial_velocity_m_s=1.0)
    motion = Bench(plant).run(0.0, 5000)
    assert motion.velocity_m_s[-1, 0] == pytest.approx(1.0 - 0.1 / THETA1 * 1.0, abs=1e-4)


def test_dahl_friction_takes_the_energy_of_its_path():
    # from a relaxed bristle to the first turning point: theta1 v0^2/2 = theta3 (x - x_s(1 - e))
    level, x_s, v0 = 0.139, 50e-6, 0.02
    plant = bare(coulomb_friction_v=level, presliding={"displacement_m": x_s})
    motion = Bench({**plant, "initial_velocity_m_s": v0}, period_s=20e-6).run(0.0, 3000)
    turning = motion.position_m[:, 0].max()

    def balance(x):
        return 0.5 * THETA1 * v0**2 - level * (x - x_s * (1.0 - math.exp(-x / x_s)))

    assert turning == pytest.approx(brentq(balance, 0.0, 0.1), rel=1e-5)


@pytest.mark.parametrize("kind", ["dahl", "lugre"])
def test_before_it_slides_friction_is_a_spring_of_coulomb_level_over_displacement(kind):
    level, x_s, v0 = 0.139, 10e-6, 1e-6
    plant = bare(coulomb_friction_v=level, presliding={"kind": kind, "displacement_m": x_s})
    motion = Bench({**plant, "initial_velocity_m_s": v0}, period_s=20e-6).run(0.0, 1500)
    omega = math.sqrt(level / x_s / THETA1)
    x = motion.position_m[:, 0]
    assert x.max() == pytest.approx(v0 / omega, rel=2e-3)
    crossings = motion.time_s[1:][(x[:-1] < 0) != (x[1:] < 0)]
    half_period = np.diff(crossings).mean()
    assert half_period == pytest.approx(math.pi / omega, rel=1e-2)


def test_lugre_micro_damping_damps_the_presliding_spring():
    level, x_s, v0, sigma1 = 0.139, 10e-6, 1e-6, 10.0
    spring = {"kind": "lugre", "displacement_m": x_s, "micro_damping_v_s_m": sigma1}
    plant = bare(coulomb_friction_v=level, presliding=spring, initial_velocity_m_s=v0)
    motion = Bench(plant, period_s=20e-6).run(0.0, 1500)
    omega, rate = math.sqrt(level / x_s / THETA1), sigma1 / THETA1 / 2
    damped = math.sqrt(omega**2 - rate**2)
    exact = v0 / damped * np.exp(-rate * motion.time_s) * np.sin(damped * motion.time_s)
    assert motion.position_m[:, 0] == pytest.approx(exact, abs=5e-3 * v0 / damped)


def test_a_command_below_the_coulomb_level_moves_only_as_far_as_the_bristles_bend():
    level, x_s = 0.139, 10e-6
    plant = bare(
        coulomb_friction_v=level, viscous_friction_v_s_m=120.0, presliding={"displacement_m": x_s}
    )
    motion = Bench(plant).run(0.5 * level, 3000)
    # theta3 (1 - exp(-x/x_s)) = theta3/2
    assert motion.position_m[-1, 0] == pytest.approx(x_s * math.log(2.0), rel=1e-3)
    assert abs(motion.velocity_m_s[-1, 0]) < 1e-9


def test_a_damped_carriage_rests_where_cogging_balances_the_offset():
    amplitude, pitch, phase, offset = 0.3, 0.05, 0.3, 0.1
    cogging = {
        "pitch_m": pitch,
        "harmonics": [{"order": 2, "amplitude_v": amplitude, "phase_rad": phase}],
    }
    plant = bare(offset_v=offset, viscous_friction_v_s_m=10.0, cogging=cogging)
    motion = Bench({**plant, "initial_position_m": 0.004}).run(0.0, 10000)
    # stable where the force falls with x: the angle is pi + asin(offset/amplitude)
    angle = math.pi + math.asin(offset / amplitude)
    rest = (angle - phase) * pitch / (2 * math.pi * 2)
    assert motion.position_m[-1, 0] == pytest.approx(rest, abs=1e-9)


def test_without_friction_kinetic_and_cogging_energy_stay_constant():
    amplitude, pitch = 0.3, 0.05
    k = 2 * math.pi / pitch
    cogging = {"pitch_m": pitch, "harmonics": [{"order": 1, "amplitude_v": amplitude}]}
    motion = Bench(bare(cogging=cogging, initial_velocity_m_s=0.5)).run(0.0, 5000)
    x, v = motion.position_m[:, 0], motion.velocity_m_s[:, 0]
    energy = 0.5 * THETA1 * v**2 + amplitude / k * np.cos(k * x)
    assert energy == pytest.approx(energy[0], rel=1e-6)
    assert np.ptp(v) > 0.01


def test_a_payload_of_the_same_mass_halves_the_acceleration_from_its_time_on():
    plant = bare(payload_change={"time_s": 0.05, "inertia_v_s2_m": THETA1})
    motion = Bench(plant).run(1.0, 500)
    landed = round(0.05 / PERIOD_S)
    assert motion.acceleration_m_s2[1 : landed + 1, 0] == pytest.approx(1.0 / THETA1, rel=1e-12)
    assert motion.acceleration_m_s2[landed + 1 :, 0] == pytest.approx(0.5 / THETA1, rel=1e-12)


def test_end_stops_hold_the_carriage_against_full_thrust():
    bench = Bench({"travel_m": [-0.07, 0.1], "initial_position_m": 0.05})
    motion = bench.run(10.0, 5000)
    stiffness = bench.driver.options.plant(0).end_stop.stiffness_v_m
    thrust = 10.0 - 0.0122 * 100 - 0.00104 * 1000 + 0.012
    assert motion.position_m[-1, 0] == pytest.approx(0.1 + thrust / stiffness, abs=1e-8)
    assert motion.position_m.max() < 0.115


@pytest.mark.parametrize("side", [-1, 1])
def test_a_carriage_bounces_off_the_end_stop_with_less_energy(side):
    plant = bare(travel_m=[-0.05, 0.05], initial_velocity_m_s=side * 0.5)
    motion = Bench(plant).run(0.0, 1000)
    after = -side * motion.velocity_m_s[-1, 0]
    assert 0.05 < after < 0.45
    assert np.abs(motion.position_m).max() < 0.051


def test_free_of_everything_two_axes_do_not_feel_each_other():
    alone = Bench(bare()).run(1.0, 200)
    both = Bench(bare(), bare()).run([1.0, -2.0], 200)
    assert np.array_equal(alone.position_m[:, 0], both.position_m[:, 0])
