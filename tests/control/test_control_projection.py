"""The projection: feasible, the nearest point in the metric of Gamma^-1, never a step back."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from law_bench import project_all, violating

from motorctl.control import law_settings, law_state

MOST = 10
"""Entries of theta in the records: one size, so that the kernels are compiled once."""


def records(cases: list[dict]) -> tuple[np.ndarray, np.ndarray]:
    """Fill the law's records; a case has theta, gamma, lower, upper, planes: [(normal, offset)]."""
    n = len(cases[0]["theta"])
    law = np.zeros(len(cases), law_settings(MOST))
    states = np.zeros(len(cases), law_state(MOST))
    for k, case in enumerate(cases):
        law[k]["n"] = n
        law[k]["lower"][:n], law[k]["upper"][:n] = case["lower"], case["upper"]
        law[k]["planes"] = len(case["planes"])
        for i, (normal, offset) in enumerate(case["planes"]):
            law[k]["plane_normal"][i, :n], law[k]["plane_offset"][i] = normal, offset
        states[k]["theta"][:n] = case["theta"]
        states[k]["U"][:n, :n], states[k]["D"][:n] = ud(case["gamma"])
    return law, states


def ud(gamma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factor gamma = U diag(D) U^T with U unit upper triangular."""
    reverse = gamma[::-1, ::-1]
    lower = np.linalg.cholesky(reverse)[::-1, ::-1]
    diagonal = np.diag(lower)
    return lower / diagonal, diagonal**2


def projected(case: dict) -> np.ndarray:
    law, states = records([case])
    project_all(law, states)
    return states["theta"][0, : len(case["theta"])].copy()


def distance(case: dict, point: np.ndarray, other: np.ndarray) -> float:
    step = point - other
    return float(step @ np.linalg.solve(case["gamma"], step))


def constraints(case: dict) -> tuple[np.ndarray, np.ndarray]:
    """Write box and half-planes as rows @ z <= bounds."""
    n = len(case["theta"])
    rows = [*np.eye(n), *-np.eye(n), *(-np.asarray(normal) for normal, _ in case["planes"])]
    bounds = [*case["upper"], *-np.asarray(case["lower"]), *(-b for _, b in case["planes"])]
    return np.array(rows), np.array(bounds)


def nearest(case: dict) -> np.ndarray:
    """Solve the quadratic program by trying every set of active constraints."""
    rows, bounds = constraints(case)
    theta, gamma, n = case["theta"], case["gamma"], len(case["theta"])
    sd = np.sqrt(np.einsum("ki,ij,kj->k", rows, gamma, rows))
    best, best_distance = None, np.inf
    for size in range(n + 1):
        for active in itertools.combinations(range(len(rows)), size):
            normals = rows[list(active)]
            if np.linalg.matrix_rank(normals) < size:
                continue
            lever = gamma @ normals.T
            pull = np.linalg.solve(normals @ lever, normals @ theta - bounds[list(active)])
            point = theta - lever @ pull
            if ((rows @ point - bounds) <= 1e-9 * sd).all():
                there = distance(case, point, theta)
                if there < best_distance:
                    best, best_distance = point, there
    assert best is not None
    return best


def random_case(rng: np.random.Generator, n: int, planes: int) -> dict:
    """Draw a badly scaled, strongly correlated case with a feasible point inside."""
    scale = 10.0 ** rng.uniform(-3, 1, n)
    lower = -scale * rng.uniform(0.1, 2.0, n)
    upper = scale * rng.uniform(0.1, 2.0, n)
    inside = rng.uniform(lower, upper)
    normals = rng.normal(size=(planes, n)) / scale
    cuts = [(normal, normal @ inside - abs(rng.normal()) * 0.5) for normal in normals]
    mixing = np.eye(n) + rng.uniform(0, 3) * rng.normal(size=(n, n))
    gamma = (mixing @ mixing.T + 1e-3 * np.eye(n)) * np.outer(scale, scale)
    theta = inside + 3.0 * scale * rng.normal(size=n)
    return {
        "theta": theta, "gamma": gamma, "lower": lower, "upper": upper, "planes": cuts,
        "inside": inside,
    }  # fmt: skip


def assert_feasible(case: dict, point: np.ndarray) -> None:
    assert (point >= case["lower"]).all()
    assert (point <= case["upper"]).all()
    for normal, offset in case["planes"]:
        sd = np.sqrt(normal @ case["gamma"] @ normal)
        assert normal @ point >= offset - 1e-10 * sd


@pytest.mark.slow
@settings(max_examples=150)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.integers(0, 2))
def test_the_projection_is_the_nearest_feasible_point(seed, n, planes):
    case = random_case(np.random.default_rng(seed), n, planes)
    point, reference = projected(case), nearest(case)
    assert_feasible(case, point)
    sd = np.sqrt(np.diag(case["gamma"]))
    assert np.abs((point - reference) / sd).max() <= 1e-8


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_a_half_plane_through_corners_of_the_box_is_kept(seed, depth):
    # Both lower bounds and the half-plane are violated: three normals in a plane of two.
    rng = np.random.default_rng(seed)
    correlation = rng.uniform(-0.999, 0.999)
    gamma = np.array([[1.0, correlation], [correlation, 1.0]])
    corner = np.array([1.0, 1.0])
    normal = np.abs(rng.normal(size=2)) + 0.05
    case = {
        "theta": np.array([-rng.uniform(0, 5), -rng.uniform(0, 5)]), "gamma": gamma,
        "lower": corner, "upper": corner + 10.0, "planes": [(normal, normal @ (corner + depth))],
    }  # fmt: skip
    point = projected(case)
    assert_feasible(case, point)
    assert np.abs(point - nearest(case)).max() <= 1e-8


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(0, 3))
def test_an_estimate_inside_stays_where_it_is(seed, n, planes):
    case = random_case(np.random.default_rng(seed), n, planes)
    case["theta"] = case["inside"]
    law, states = records([case])
    assert violating(law, states) == 0
    project_all(law, states)
    assert (states["theta"][0, :n] == case["inside"]).all()


@pytest.mark.slow
@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_projecting_twice_is_projecting_once(seed):
    case = random_case(np.random.default_rng(seed), 6, 1)
    once = projected(case)
    twice = projected({**case, "theta": once})
    assert np.abs((twice - once) / np.sqrt(np.diag(case["gamma"]))).max() <= 1e-9


@pytest.mark.parametrize(("n", "planes"), [(6, 1), (6, 3), (10, 2)])
def test_the_projection_never_moves_away_from_any_admissible_truth(n, planes):
    rng = np.random.default_rng(7)
    cases = [random_case(rng, n, planes) for _ in range(2000)]
    law, states = records(cases)
    project_all(law, states)
    clipping_worse = 0
    for case, point in zip(cases, states["theta"][:, :n], strict=True):
        assert_feasible(case, point)
        before = distance(case, case["theta"], case["inside"])
        assert distance(case, point, case["inside"]) <= before * (1 + 1e-9)
        clipped = np.clip(case["theta"], case["lower"], case["upper"])
        clipping_worse += distance(case, clipped, case["inside"]) > before
    assert clipping_worse > 20  # clipping each entry by itself has no such property


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.999, 0.99999, 0.9999999]))
def test_nearly_collinear_parameters_are_projected(seed, correlation):
    # theta5 and theta6 as the estimator knows them after a while; the optimum in rationals.
    rng = np.random.default_rng(seed)
    sd = np.array([1e-4, 1e-5])
    gamma = np.array([[1.0, -correlation], [-correlation, 1.0]]) * np.outer(sd, sd)
    case = {
        "theta": np.array([-0.02, 0.001]) * rng.uniform(0.5, 2.0, 2), "gamma": gamma,
        "lower": np.array([-0.015, -0.002]), "upper": np.array([0.0, 0.0]),
        "planes": [(np.array([20.0, 300.0]), -0.5)],
    }  # fmt: skip
    point, reference = projected(case), nearest_of_two(case)
    assert (point >= case["lower"]).all()
    assert (point <= case["upper"]).all()
    assert np.abs((point - reference) / sd).max() <= 1e-6


def nearest_of_two(case: dict) -> np.ndarray:
    """Solve the program in two unknowns exactly: at a vertex, or on one constraint's line."""
    rows, bounds = (np.vectorize(Fraction)(part) for part in constraints(case))
    theta, gamma = (np.vectorize(Fraction)(case[key]) for key in ("theta", "gamma"))
    determinant = gamma[0, 0] * gamma[1, 1] - gamma[0, 1] ** 2
    metric = np.array([[gamma[1, 1], -gamma[0, 1]], [-gamma[0, 1], gamma[0, 0]]]) / determinant
    points = [theta]
    for row, bound in zip(rows, bounds, strict=True):
        lever = gamma @ row
        points.append(theta - lever * ((row @ theta - bound) / (row @ lever)))
    for (a, b), (p, q) in zip(
        itertools.combinations(rows, 2), itertools.combinations(bounds, 2), strict=True
    ):
        cross = a[0] * b[1] - a[1] * b[0]
        if cross:
            points.append(np.array([p * b[1] - a[1] * q, a[0] * q - p * b[0]]) / cross)
    inside = [point for point in points if (rows @ point <= bounds).all()]
    return min(inside, key=lambda z: (z - theta) @ metric @ (z - theta)).astype(float)
