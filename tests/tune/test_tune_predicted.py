"""What an error would have been with other gains, against loops that are run with them."""

import numpy as np
import pytest
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st
from linear_loop import GENTLE, disturbance, followed, loop_of

from motorctl.config.analysis import LoopGains
from motorctl.tune.choice import margins_of
from motorctl.tune.predicted import Predictor

pytestmark = pytest.mark.slow


@settings(max_examples=12, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(
    seed=st.integers(0, 1000),
    k1=st.floats(40.0, 250.0),
    ks=st.floats(40.0, 150.0),
    k2=st.floats(6.0, 40.0),
)
def test_the_predicted_error_is_the_one_that_the_loop_makes(seed, k1, ks, k2):
    shaken = disturbance(np.random.default_rng(seed))
    gains = LoopGains(k1, ks, ks * k2)
    loop = loop_of(GENTLE, shaken)
    assume((margins_of(loop, gains).phase_margin_deg or 0.0) > 20.0)
    told = Predictor(loop).predict(gains)
    error, d0_hat = followed(gains, shaken, periods=24)
    counted = slice(-2 * len(shaken), None)
    assert told.eF_m == pytest.approx(np.abs(error[counted]).max(), rel=0.03)
    assert told.L2_m == pytest.approx(np.sqrt(np.mean(error[counted] ** 2)), rel=0.03)
    assert told.d0_hat_v == pytest.approx(np.abs(d0_hat[counted]).max(), rel=0.05)


def test_a_desired_velocity_that_is_ahead_is_no_disturbance_that_gains_suppress():
    rng = np.random.default_rng(4)
    ahead, calm = 0.02 * disturbance(rng), np.zeros(2500)
    gains = LoopGains(200.0, 130.0, 2000.0)
    told = Predictor(loop_of(GENTLE, calm, ahead=ahead)).predict(gains)
    error, d0_hat = followed(gains, calm, periods=24, ahead=ahead)
    counted = slice(-2 * len(calm), None)
    assert told.eF_m == pytest.approx(np.abs(error[counted]).max(), rel=0.03)
    assert told.d0_hat_v == pytest.approx(np.abs(d0_hat[counted]).max(), rel=0.05)


def test_a_fast_adaptation_that_was_off_has_to_take_what_the_error_held_against():
    shaken = disturbance(np.random.default_rng(5)) + 0.4
    off, gains = LoopGains(100.0, 60.0, 0.0), LoopGains(100.0, 60.0, 900.0)
    told = Predictor(loop_of(off, shaken)).predict(gains)
    error, d0_hat = followed(gains, shaken, periods=24)
    counted = slice(-2 * len(shaken), None)
    assert told.d0_hat_v == pytest.approx(np.abs(d0_hat[counted]).max(), rel=0.05)
    assert told.eF_m == pytest.approx(np.abs(error[counted]).max(), rel=0.05)


def test_the_gains_of_the_log_leave_its_error_as_it_is():
    loop = loop_of(GENTLE, disturbance(np.random.default_rng(1)))
    told = Predictor(loop).predict(GENTLE)
    assert told.eF_m == pytest.approx(loop.eF_m, rel=1e-3)


def test_noise_of_the_command_is_what_a_noisy_position_makes_of_it():
    gains = LoopGains(150.0, 90.0, 500.0)
    loop = loop_of(gains, np.zeros(100), noise_m=2e-7)
    rng = np.random.default_rng(3)
    x = v = before = d0 = 0.0
    late, commands = [0.0, 0.0], []
    for _ in range(60_000):
        y = x + rng.normal(0.0, 2e-7)
        p = (y - before) / loop.period_s + gains.k1_1_s * y
        late.append(-d0 - gains.ks_v_s_m * p)
        commands.append(late[-1])
        d0 += loop.period_s * gains.gamma_d * p
        before = y
        a = late.pop(0) / loop.plant.theta1
        x, v = x + v * loop.period_s + 0.5 * a * loop.period_s**2, v + a * loop.period_s
    told = Predictor(loop).command_noise_v(gains)
    assert told == pytest.approx(np.std(commands[5000:]), rel=0.03)
