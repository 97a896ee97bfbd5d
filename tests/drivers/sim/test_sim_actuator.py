"""Between command and thrust: converter, dead zone, delay, lag, saturation, heat, ripple."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sim_bench import PERIOD_S, Bench, bare, force_at

THETA1 = 0.2
NO_STEPS = {"resolution_bits": None}


def test_the_thrust_curve_saturates_where_the_straight_line_goes_on():
    # 80 N/V: the straight line gives 800 N at 10 V
    x_motor = {"em_quadratic_1_v": -0.0122, "em_cubic_1_v2": -0.00104}
    thrust_n = {u: 80.0 * force_at(0.0, 0.0, u, **x_motor) for u in (1.0, 9.0, 10.0, -10.0)}
    assert thrust_n[10.0] == pytest.approx(80.0 * (10.0 - 1.22 - 1.04), rel=1e-9)
    assert thrust_n[-10.0] == pytest.approx(-thrust_n[10.0], rel=1e-9)
    assert thrust_n[1.0] > 0.98 * 80.0
    assert 570.0 < thrust_n[9.0] < thrust_n[10.0] < 700.0


@settings(max_examples=25)
@given(u=st.floats(-10, 10), theta5=st.floats(-0.02, 0.02), theta6=st.floats(-1e-3, 1e-3))
def test_thrust_is_the_cubic_of_the_command(u, theta5, theta6):
    force = force_at(0.0, 0.0, u, em_quadratic_1_v=theta5, em_cubic_1_v2=theta6)
    assert force == pytest.approx(u + theta5 * u * abs(u) + theta6 * u**3, abs=1e-9)


@pytest.mark.parametrize(("written", "applied"), [(12.0, 10.0), (-1e300, -10.0), (4.0, 4.0)])
def test_the_converter_clamps_at_its_range(written, applied):
    assert force_at(0.0, 0.0, written) == pytest.approx(applied, abs=1e-9)


@pytest.mark.parametrize("written", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_no_number_gives_no_thrust(written):
    assert force_at(0.0, 0.0, written) == 0.0


def test_a_disabled_amplifier_gives_no_thrust_whatever_the_command():
    bench = Bench(bare(), bare())
    bench.outputs.enable[:] = (1, 0)
    motion = bench.run([5.0, 5.0], 10)
    assert motion.current_v[-1] == pytest.approx([5.0, 0.0])
    assert motion.position_m[-1, 1] == 0.0


@settings(max_examples=25)
@given(u=st.floats(-9.9, 9.9), bits=st.sampled_from([8, 12, 16]))
def test_the_converter_rounds_to_its_steps(u, bits):
    step = 20.0 / 2**bits
    force = force_at(0.0, 0.0, u, amplifier={"resolution_bits": bits})
    assert abs(force - u) <= 0.5 * step + 1e-8
    assert force / step == pytest.approx(round(force / step), abs=1e-4)


@settings(max_examples=25)
@given(u=st.floats(-3, 3))
def test_the_dead_zone_takes_a_clip_of_the_command_away(u):
    force = force_at(0.0, 0.0, u, dead_zone={"half_width_v": 0.4})
    assert force == pytest.approx(u - np.clip(u, -0.4, 0.4), abs=1e-9)


def test_the_lag_follows_a_step_exponentially_at_every_period():
    tau = 0.39e-3
    motion = Bench(bare(input_lag={"time_s": tau})).run(5.0, 50)
    exact = 5.0 * (1.0 - np.exp(-motion.time_s / tau))
    assert motion.current_v[:, 0] == pytest.approx(exact, abs=1e-12)


def test_behind_the_lag_the_velocity_is_the_exact_integral_of_the_thrust():
    tau = 0.39e-3
    motion = Bench(bare(input_lag={"time_s": tau})).run(5.0, 50)
    t = motion.time_s
    exact = 5.0 / THETA1 * (t - tau * (1.0 - np.exp(-t / tau)))
    assert motion.velocity_m_s[:, 0] == pytest.approx(exact, abs=1e-12)


@settings(max_examples=30)
@given(delay_s=st.floats(1e-7, 9.9e-3), period_s=st.sampled_from([1e-4, PERIOD_S, 1e-3]))
def test_any_fraction_of_a_period_of_delay_is_exact(delay_s, period_s):
    motion = Bench(bare(input_delay={"time_s": delay_s}), period_s=period_s).run(2.0, 120)
    exact = 2.0 / THETA1 * np.maximum(motion.time_s - delay_s, 0.0)
    after = motion.time_s > delay_s + 20e-6
    assert motion.velocity_m_s[after, 0] == pytest.approx(exact[after], abs=1e-12)
    assert not motion.velocity_m_s[motion.time_s <= delay_s - 20e-6].any()


def test_delay_and_lag_together_delay_the_lagged_step():
    tau, delay = 0.39e-3, 0.46 * PERIOD_S
    plant = bare(input_lag={"time_s": tau}, input_delay={"time_s": delay})
    motion = Bench(plant).run(5.0, 50)
    since = np.maximum(motion.time_s - delay, 0.0)
    exact = 5.0 / THETA1 * (since - tau * (1.0 - np.exp(-since / tau)))
    # the step inside a substep of length h is spread over it: at most h^2/8 of area is displaced
    bound = 5.0 / THETA1 * (20e-6) ** 2 / (8 * tau)
    assert motion.velocity_m_s[:, 0] == pytest.approx(exact, abs=bound)
    assert motion.velocity_m_s[-1, 0] == pytest.approx(exact[-1], rel=1e-12)


def test_heat_lets_the_thrust_fade_to_its_final_fraction():
    drift = {"fraction": 0.1, "time_constant_s": 0.05}
    motion = Bench(bare(gain_drift=drift)).run(2.0, 1500)
    begun = motion.time_s[:-1]  # held over each period
    exact = 2.0 / THETA1 * (1.0 - 0.1 * (1.0 - np.exp(-begun / 0.05)))
    assert motion.acceleration_m_s2[1:, 0] == pytest.approx(exact, rel=1e-9)


@settings(max_examples=25)
@given(x=st.floats(-0.2, 0.2), u=st.floats(-8, 8))
def test_ripple_changes_the_thrust_in_proportion(x, u):
    harmonics = [
        {"order": 1, "amplitude": 0.05, "phase_rad": 0.4},
        {"order": 3, "amplitude": 0.02},
    ]
    ripple = {"pitch_m": 0.03, "harmonics": harmonics}
    force = force_at(x, 0.0, u, em_cubic_1_v2=-1e-3, force_ripple=ripple)
    k = 2 * math.pi / 0.03
    share = 1.0 + 0.05 * math.sin(k * x + 0.4) + 0.02 * math.sin(3 * k * x)
    assert force == pytest.approx((u - 1e-3 * u**3) * share, abs=1e-8)


def test_thrust_hysteresis_depends_on_where_the_command_came_from():
    hysteresis = {"force_v": 0.2, "voltage_v": 0.5}
    bench = Bench(bare(thrust_hysteresis=hysteresis, travel_m=[-1e3, 1e3]))
    up = bench.run(3.0, 1).acceleration_m_s2[-1, 0] * THETA1
    bench.run(6.0, 1)
    down = bench.run(3.0, 1).acceleration_m_s2[-1, 0] * THETA1
    top = 1.0 - math.exp(-6.0 / 0.5)
    assert up == pytest.approx(3.0 - 0.2 * (1.0 - math.exp(-3.0 / 0.5)), rel=1e-9)
    assert down == pytest.approx(3.0 - 0.2 * (-1.0 + (top + 1.0) * math.exp(-3.0 / 0.5)), rel=1e-9)
