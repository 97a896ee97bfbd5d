"""The parts of the diagnosis against analytic answers."""

import math

import numpy as np
import pytest
from fit_plant import C1, COGGING_PITCH_M, X_THETA, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from motorctl.identify.columns.command_timing import CommandPath, held_parts
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import low_pass_response, make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.columns.stretches import smoothed
from motorctl.identify.diagnose.search.held_out_blocks import (
    FOLDS,
    held_out_sse,
    make_blocks,
    make_problem,
    residual,
    solve,
)
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.noise_twins import largest_gain
from motorctl.identify.diagnose.search.parameters import values_of
from motorctl.identify.diagnose.search.search import LEAST_GAIN, whitened
from motorctl.identify.diagnose.search.spectral_lines import position_spectrum, strongest
from motorctl.identify.diagnose.search.whitening import spectrum
from motorctl.model.sign_function import Sign

FINE = 400
PERIOD_S = 1.0
DECLARED = Sign(900.0)


def acting(command, path):
    """Hold, delay and lag a command on a grid of FINE steps a period, exactly at its points."""
    h = PERIOD_S / FINE
    held = np.repeat(command, FINE)
    late = round(path.delay_s / h)
    held = np.concatenate([np.full(late, command[0]), held])[: len(held)]
    if path.lag_s == 0.0:
        return held
    out, value, keep = np.empty_like(held), command[0], math.exp(-h / path.lag_s)
    for k, u in enumerate(held):
        out[k] = value
        value = u + (value - u) * keep
    return out


@settings(max_examples=30)
@given(
    st.integers(0, 2 * FINE),
    st.sampled_from([0.0, 0.05, 0.3, 1.0, 4.0]),
    st.integers(0, 100),
)
def test_a_held_command_is_aligned_with_the_second_difference(late, lag, seed):
    path = CommandPath(late / FINE * PERIOD_S, lag * PERIOD_S)
    command = np.random.default_rng(seed).standard_normal(40)
    fine = acting(command, path)
    # the second difference at tick k is the acceleration averaged with a triangle around it
    s = (np.arange(-FINE, FINE) + 0.5) / FINE
    triangle = (1.0 - np.abs(s)) / FINE
    middle = 0.5 * (fine + np.append(fine[1:], fine[-1]))
    if lag == 0.0:
        middle = fine
    parts = held_parts(command, path, PERIOD_S)
    assert sum(weight for weight, _ in parts) == pytest.approx(1.0, abs=1e-12)
    got = sum(weight * series for weight, series in parts)
    for k in range(6, 38):
        expected = triangle @ middle[(k - 1) * FINE : (k + 1) * FINE]
        assert got[k] == pytest.approx(expected, abs=2e-4)


@settings(max_examples=30)
@given(st.integers(0, 29), st.floats(0.3, 3.0), st.floats(1e-4, 1e-2), st.integers(0, 100))
def test_one_rare_event_is_known_in_the_rows_held_out_where_its_size_is_usual(k, b, noise, seed):
    """A limit is met in one block alone; filters smear a thousandth of that into the next."""
    draw = np.random.default_rng(seed)
    rows, blocks = 3000, make_blocks(3000, 0.02)
    command = draw.standard_normal(rows)
    beyond = np.zeros(rows)
    inside = slice(k * blocks.length + 20, (k + 1) * blocks.length - 20)
    beyond[inside] = command[inside] * (np.abs(command[inside]) > 0.5)
    beyond[((k + 1) % blocks.count) * blocks.length + 5] = 1e-3
    error = noise * draw.standard_normal(rows)
    y = b * (command - beyond) + error
    columns = np.stack([command, beyond])
    tied = make_problem(blocks, columns, y, tied=np.array([np.nan, -1.0]))
    free = make_problem(blocks, columns, y)
    assert held_out_sse(tied).sum() < 1.1 * error @ error
    assert held_out_sse(free).sum() > held_out_sse(tied).sum()
    assert solve(tied).b == pytest.approx(solve(free).b, rel=1e-12)


def test_a_size_that_many_blocks_show_is_theirs_and_not_the_usual_one():
    draw = np.random.default_rng(4)
    blocks = make_blocks(3000, 0.02)
    command, error = draw.standard_normal((2, 3000))
    beyond = command * (np.abs(command) > 1.5)
    columns = np.stack([command, beyond])
    y = command - 0.4 * beyond + 0.1 * error
    tied = make_problem(blocks, columns, y, tied=np.array([np.nan, -1.0]))
    free = make_problem(blocks, columns, y)
    assert held_out_sse(tied).sum() == pytest.approx(held_out_sse(free).sum(), rel=0.01)
    usual = y - columns.T @ (1.0, -1.0)
    assert held_out_sse(tied).sum() < 0.1 * usual @ usual


def test_a_rare_event_that_contradicts_its_usual_size_is_not_believed():
    draw = np.random.default_rng(5)
    blocks = make_blocks(3000, 0.02)
    command, error = draw.standard_normal((2, 3000))
    beyond = np.zeros(3000)
    beyond[20:100] = command[20:100]
    y = command - 0.5 * beyond + 0.01 * error
    columns = np.stack([command, beyond])
    tied = make_problem(blocks, columns, y, tied=np.array([np.nan, -1.0]))
    assert held_out_sse(tied).sum() == held_out_sse(make_problem(blocks, columns, y)).sum()


def test_smoothing_leaves_slow_motion_alone_and_takes_fast_away():
    t = np.arange(5000) / 5000.0
    slow, fast = np.sin(2 * np.pi * 20.0 * t), np.sin(2 * np.pi * 900.0 * t)
    inner = slice(300, -300)
    np.testing.assert_allclose(
        smoothed(0.3 + 2.0 * t + slow + fast, 200.0, 1 / 5000.0)[inner],
        (0.3 + 2.0 * t + slow)[inner],
        atol=2e-3,
    )


@pytest.fixture(scope="module")
def clean():
    return simulate(seed=2, duration_s=8.0, delay_samples=0.0, force_noise=0.05, theta=X_THETA[:4])


def hypothesis_of(run, *, whiten):
    signals = make_signals(run.measured(), slope_s_m=900.0)
    if whiten:
        regressors, noise = whitened(signals, C1, ())
        return Hypothesis(regressors), noise
    blocks = make_blocks(signals.rows, signals.row_period_s)
    return Hypothesis(Regressors(signals.with_response(low_pass_response(200.0)), C1, blocks)), None


def test_the_filtered_acceleration_is_that_of_the_motion():
    t = np.arange(10000) / 5000.0
    w = 2 * np.pi * 11.0
    data = Measured(
        "run.csv", "x", 5000.0, t, 0.01 * np.sin(w * t), np.zeros_like(t), np.ones(len(t), bool)
    )
    signals = make_signals(data)
    expected = -0.01 * w**2 * np.sin(w * signals.time_s)
    np.testing.assert_allclose(signals.acceleration(), expected, atol=2e-3 * 0.01 * w**2)


def test_what_is_left_of_clean_data_is_white(clean):
    hypothesis, noise = hypothesis_of(clean, whiten=True)
    signals = hypothesis.regressors.signals
    rows = residual(hypothesis.problem, hypothesis.solution.b)[: signals.rows]
    frequency, density = spectrum(rows, signals.row_period_s)
    bands = [(5.0, 50.0), (50.0, 100.0), (100.0, 170.0)]
    levels = [np.mean(density[(frequency > a) & (frequency < b)]) for a, b in bands]
    assert max(levels) < 1.6 * min(levels)
    assert 0.8 < hypothesis.solution.sse / hypothesis.noise_sse(noise) < 1.8


def test_the_noise_that_is_found_is_the_force_noise_that_was_put_in(clean):
    _, noise = hypothesis_of(clean, whiten=True)
    # white steps of 0.05 V at 5 kHz, one-sided density of the acceleration
    expected = 2.0 * (0.05 / X_THETA[0]) ** 2 / 5000.0
    # a low percentile of a spectrum of few windows: rather too small
    assert noise == pytest.approx(expected, rel=0.45)


def test_parameters_lie_within_their_standard_errors(clean):
    hypothesis, _ = hypothesis_of(clean, whiten=True)
    values = values_of(hypothesis)
    assert values.model.parameter_names == C1.names
    off = np.abs(values.theta - X_THETA[:4]) / values.std_error
    assert off.max() < 5.0
    assert (values.std_error < 0.03 * np.abs(X_THETA[:4]) + 1e-3).all()


@pytest.mark.slow
def test_standard_errors_tell_how_far_parameters_scatter():
    found = []
    for seed in range(8):
        run = simulate(
            seed=seed, duration_s=6.0, delay_samples=0.0, force_noise=0.1, theta=X_THETA[:4]
        )
        found.append(values_of(hypothesis_of(run, whiten=True)[0]))
    off = np.array([(v.theta - X_THETA[:4]) / v.std_error for v in found])
    assert 0.3 < np.sqrt(np.mean(off**2)) < 2.0


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.integers(1, 5), st.integers(90, 400))
def test_held_out_residuals_are_those_of_explicit_refits(seed, p, m):
    random = np.random.default_rng(seed)
    X = random.standard_normal((p, m)) * 10.0 ** random.uniform(-3, 3, (p, 1))
    y = random.standard_normal(p) @ X + random.standard_normal(m)
    blocks = make_blocks(m, 0.01)
    fold = np.arange(m) // blocks.length % FOLDS
    expected = []
    for k in range(FOLDS):
        b = np.linalg.lstsq(X[:, fold != k].T, y[fold != k], rcond=None)[0]
        expected.append(np.sum((y - b @ X)[fold == k] ** 2))
    problem = make_problem(blocks, X, y)
    np.testing.assert_allclose(held_out_sse(problem), expected, rtol=1e-6)
    b, sse = np.linalg.lstsq(X.T, y, rcond=None)[:2]
    found = solve(problem)
    np.testing.assert_allclose(found.b, b, rtol=1e-6)
    assert found.sse == pytest.approx(sse[0], rel=1e-8)


def test_a_line_over_position_shows_at_its_pitch():
    run = simulate(
        seed=3, duration_s=8.0, delay_samples=0.0, cogging=0.2, theta=X_THETA[:4], peak_velocity=0.5
    )
    hypothesis, _ = hypothesis_of(run, whiten=False)
    signals = hypothesis.regressors.signals
    rows = residual(hypothesis.problem, hypothesis.solution.b)[: signals.rows]
    kappa, gain = position_spectrum(signals, rows, None)
    best = strongest(kappa, gain, 1)[0]
    assert 1.0 / best == pytest.approx(COGGING_PITCH_M, rel=0.02)
    # the gain is about the squared residual that the line takes away
    assert gain.max() == pytest.approx(hypothesis.solution.sse, rel=0.5)


@pytest.mark.slow
def test_what_chance_gains_on_a_clean_twin_grows_with_how_long_its_noise_lasts():
    run = simulate(seed=3, duration_s=8.0, delay_samples=0.0, force_noise=0.1, theta=X_THETA[:4])
    white, _ = hypothesis_of(run, whiten=True)
    signals, spans = white.regressors.signals, spans_of(white.regressors.signals)
    assert largest_gain(white, spans, DECLARED) < LEAST_GAIN
    # a force that wanders within a twentieth of a second is no effect of place, speed or command
    keep = math.exp(-signals.row_period_s / 0.05)
    wander = lfilter([1.0], [1.0, -keep], np.random.default_rng(4).standard_normal(signals.rows))
    wander *= 3.0 * np.std(residual(white.problem, white.solution.b)) / np.std(wander)
    lasting = Hypothesis(white.regressors.with_offset(wander), (), white.acceleration)
    assert largest_gain(lasting, spans, DECLARED) > 2.0 * largest_gain(white, spans, DECLARED)
