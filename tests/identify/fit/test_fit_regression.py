"""Least squares with either side on the left, bounds, and standard errors."""

import numpy as np
import pytest
from fit_plant import C1, model_of
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from motorctl.identify.fit.regression import Regression, regression, solve, solve_bounded
from motorctl.identify.fit.standard_errors import long_run_covariance, sandwich

THETAS = arrays(float, 4, elements=st.floats(-5.0, 5.0).filter(lambda v: abs(v) > 1e-2)).map(
    lambda t: np.append(abs(t[0]), t[1:])
)


def exact_data(theta, seed=0, rows=400):
    """Return psi and u that obey u = psi theta."""
    psi = np.random.default_rng(seed).standard_normal((rows, len(theta)))
    return psi, psi @ theta


@given(THETAS)
def test_both_sides_find_the_same_parameters_in_exact_data(theta):
    psi, command = exact_data(theta)
    for left in ("acceleration", "command"):
        problem = regression(psi, command, C1, left)
        np.testing.assert_allclose(problem.theta(solve(problem).b), theta, rtol=1e-9, atol=1e-9)


@given(THETAS)
def test_coefficients_and_parameters_are_each_others_inverse(theta):
    problem = regression(*exact_data(theta), C1, "acceleration")
    np.testing.assert_allclose(problem.theta(problem.coefficients(theta)), theta, rtol=1e-12)


@given(THETAS)
def test_the_jacobian_is_the_derivative_of_the_parameters(theta):
    problem = regression(*exact_data(theta), C1, "acceleration")
    b = problem.coefficients(theta)
    step = 1e-6 * abs(b[0])
    columns = [
        (problem.theta(b + step * unit) - problem.theta(b - step * unit)) / (2 * step)
        for unit in np.eye(4)
    ]
    np.testing.assert_allclose(
        problem.jacobian(b), np.transpose(columns), rtol=1e-5, atol=1e-4 * abs(theta).max()
    )


def test_acceleration_noise_biases_the_command_side_and_not_the_acceleration_side():
    theta = np.array([0.2, 0.3, 0.1, 0.0])
    rng = np.random.default_rng(1)
    psi, command = exact_data(theta, rows=20000)
    noisy = psi.copy()
    noisy[:, 0] += 0.5 * rng.standard_normal(len(psi))
    found = {}
    for left in ("acceleration", "command"):
        problem = regression(noisy, command, C1, left)
        found[left] = problem.theta(solve(problem).b)[0]
    assert found["command"] == pytest.approx(0.2 / 1.25, rel=0.03)  # attenuated by 1/(1 + 0.5^2)
    assert found["acceleration"] == pytest.approx(0.2, rel=0.03)


def test_a_direction_that_the_data_leaves_open_is_told_and_has_a_huge_error():
    psi, command = exact_data(np.array([0.2, 0.3, 0.1, 0.4]))
    psi[:, 3] = -psi[:, 2]
    solution = solve(regression(psi, command, C1, "command"))
    assert len(solution.open_directions) == 1
    np.testing.assert_allclose(
        np.abs(solution.open_directions[0]), [0, 0, 0.7071, 0.7071], atol=1e-3
    )
    assert solution.bread[2, 2] > 1e9 * solution.bread[0, 0]


@pytest.mark.parametrize("left", ["acceleration", "command"])
def test_bounds_hold_and_the_rest_is_the_best_under_them(left):
    theta = np.array([0.2, -0.1, 0.3, 0.05])
    psi, command = exact_data(theta)
    lower, upper = np.array([0.0, 0.0, -np.inf, -1.0]), np.array([np.inf, 1.0, np.inf, 1.0])
    problem = regression(psi, command, C1, left)
    found = solve_bounded(problem, problem.theta(solve(problem).b), lower, upper)
    assert found.theta[1] == 0.0
    assert found.at_lower.tolist() == [False, True, False, False]
    assert not found.at_upper.any()
    without = regression(
        np.delete(psi, 1, axis=1), command, model_of("inertia", "coulomb_friction", "offset"), left
    )
    best = without.theta(solve(without).b)
    np.testing.assert_allclose(np.delete(found.theta, 1), best, rtol=1e-4)


def test_a_model_without_inertia_has_the_command_on_the_left():
    model = model_of("viscous_friction", "coulomb_friction", "offset")
    problem = regression(*exact_data(np.ones(3)), model, "acceleration")
    assert problem.inertia is None


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
def test_standard_errors_honour_serial_correlation(rho):
    # the mean of an autoregressive series: variance 1 / ((1 - rho)^2 m)
    m, errors, means = 4000, [], []
    for seed in range(30):
        shocks = np.random.default_rng(seed).standard_normal(m + 200)
        series = np.zeros(m + 200)
        for k in range(1, m + 200):
            series[k] = rho * series[k - 1] + shocks[k]
        ones, residual = np.ones((m, 1)), series[200:]
        solution = solve(Regression(ones, residual, None))
        scores = ones * solution.residual[:, None]
        errors.append(np.sqrt(sandwich(solution.bread, scores, 5)[0, 0]))
        means.append(solution.b[0])
    truth = 1.0 / ((1.0 - rho) * np.sqrt(m))
    assert np.mean(errors) == pytest.approx(truth, rel=0.2)
    assert np.std(means) == pytest.approx(truth, rel=0.4)


def test_the_long_run_covariance_is_never_negative():
    rng = np.random.default_rng(3)
    blue = np.diff(rng.standard_normal((500, 3)), 2, axis=0)
    assert np.linalg.eigvalsh(long_run_covariance(blue, 10)).min() > -1e-9
