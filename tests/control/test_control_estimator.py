"""The estimator: exactly discretised least squares with forgetting, gated, limited, aligned."""

import math

import numpy as np
import pytest
from law_bench import C2_NAMES, X_COVARIANCE, X_START, X_TRUTH, Law, Run, effects, multisine
from scipy.signal import lfilter

from motorctl.control import LawFlag
from motorctl.motion import BackAndForth

TS = 0.2e-3
# Wide enough that nothing is ever projected.
WIDE = {"lower": (-1e3,) * 4 + (-0.02, -0.002), "upper": (1e3,) * 4 + (0.0, 0.0)}


@pytest.fixture(scope="module")
def model():
    return effects(*C2_NAMES)


def published_x(cycles: int = 1, acceleration: float = 35.6) -> np.ndarray:
    program = BackAndForth(
        name="x", axis="x", start_m=0.0, distance_m=0.4, max_velocity_m_s=1.05,
        max_acceleration_m_s2=acceleration, jerk_time_s=0.0086, period_s=3.5, cycles=cycles,
    )  # fmt: skip
    time_s = np.arange(int(3.5 * cycles / TS)) * TS
    return np.column_stack(program.trajectories()["x"].sample(time_s))


def regressor(run: Run, reference: np.ndarray, delay: float = 0.0) -> np.ndarray:
    """Build psi and u, aligned in time as CONTROL has it, from what a run recorded: (N, 7)."""
    y, u, vd = run.rows["y"], run.rows["u"], reference[:, 1]
    psi = np.zeros((len(y), 7))
    psi[2:, 0] = (y[2:] - 2 * y[1:-1] + y[:-2]) / TS**2
    psi[2:, 1] = (y[2:] - y[:-2]) / (2 * TS)
    psi[1:, 2] = 2 / math.pi * np.arctan(900 * vd[:-1])
    psi[:, 3] = -1.0
    for column, part in ((4, -u * abs(u)), (5, -(u**3)), (6, u)):
        mean = np.concatenate([[0.0, 0.0], 0.5 * (part[1:-1] + part[:-2])])
        whole, share = int(delay), delay - int(delay)
        early = np.concatenate([np.zeros(whole), mean])[: len(mean)]
        late = np.concatenate([[0.0], early])[: len(mean)]
        psi[:, column] = (1 - share) * early + share * late
    return psi


def filtered(psi: np.ndarray, rad_s: float, first: int = 3) -> np.ndarray:
    pole = math.exp(-rad_s * TS)
    out = psi.copy()
    out[:first] = 0.0
    for _ in range(2):
        out = lfilter([1 - pole], [1, -pole], out, axis=0)
    return out


def least_squares(phi, gates, *, alpha, nu, limit=10.0, start=X_START, gamma0=X_COVARIANCE):
    """Run CONTROL's recursion in covariance form, without projection: theta, Gamma (N, ...)."""
    theta, gamma = np.array(start), np.diag(gamma0)
    thetas, gammas = [], []
    for row, open_gate in zip(phi, gates, strict=True):
        if open_gate:
            psi, u = row[:6], row[6]
            forgetting = math.exp(-alpha * TS)
            if (np.diag(gamma) > limit * np.asarray(gamma0)).any():
                forgetting = 1.0
            kappa = TS / (1 + nu * psi @ gamma @ psi)
            gain = kappa * gamma @ psi / (forgetting + kappa * psi @ gamma @ psi)
            theta = theta + gain * (u - psi @ theta)
            gamma = (gamma - np.outer(gain, psi @ gamma)) / forgetting
        thetas.append(theta)
        gammas.append(gamma)
    return np.array(thetas), np.array(gammas)


@pytest.mark.parametrize(
    ("alpha", "nu", "rad_s", "delay"),
    [
        (1.1, 0.06, 166.0, 0.0),
        (0.27, 0.001, 597.0, 0.0),
        (1.1, 0.0, 166.0, 0.0),
        (1.1, 0.06, 300.0, 2.4),
    ],
)
def test_the_ud_form_is_plain_least_squares(model, alpha, nu, rad_s, delay):
    reference = multisine(1.4)
    law = Law(
        model, forgetting_1_s=alpha, normalisation=nu, filter_rad_s=rad_s,
        input_delay_s=delay * TS, **WIDE,
    )  # fmt: skip
    run = law.track(reference, covariances=True, resolution_m=1e-9)
    assert not (run.rows["flags"] & LawFlag.PROJECTED).any()
    psi = regressor(run, reference, delay)
    first = 3 + int(delay)
    phi = filtered(psi, rad_s, first)
    gates = (np.abs(phi[:, 1]) > 0.02) | (np.abs(phi[:, 0]) > 1.0)
    gates[:first] = False
    thetas, gammas = least_squares(phi, gates, alpha=alpha, nu=nu)
    assert gates.sum() > 5000
    assert (((run.rows["flags"] & LawFlag.ADAPTED) != 0) == gates).all()
    sd = np.sqrt(X_COVARIANCE)
    assert np.abs((run.theta - thetas) / sd).max() < 1e-9
    assert np.abs((run.gamma - gammas) / np.outer(sd, sd)).max() < 1e-9


def test_nothing_is_learned_at_rest(model):
    law = Law(model)
    run = law.track(published_x(2), covariances=True, resolution_m=0.5e-6)
    adapted = (run.rows["flags"] & LawFlag.ADAPTED) != 0
    dwell = slice(int(0.8 / TS), int(1.7 / TS))  # the first rest, well after the move has died out
    assert not adapted[dwell].any()
    assert adapted[int(0.05 / TS) : int(0.4 / TS)].all()
    assert (run.gamma[dwell] == run.gamma[dwell.start]).all()
    assert (run.theta[dwell] == run.theta[dwell.start]).all()


def test_without_the_gate_the_covariance_winds_up_at_rest(model):
    reference = published_x(2)
    gated = Law(model).track(reference, covariances=True, resolution_m=0.5e-6)
    open_gate = Law(model, gate_velocity_m_s=0.0, gate_acceleration_m_s2=0.0)
    always = open_gate.track(reference, covariances=True, resolution_m=0.5e-6)
    late = int(1.0 / TS)
    largest = [np.linalg.eigvalsh(run.gamma[late::50]).max() for run in (gated, always)]
    assert largest[1] > 1.5 * largest[0]


def test_forgetting_stops_at_the_covariance_limit(model):
    limit = 1.5
    law = Law(model, covariance_limit=limit, forgetting_1_s=5.0, gate_velocity_m_s=0.0)
    # Straight on at constant speed: nothing tells the parameters apart, all but one wind up.
    time_s = np.arange(20000) * TS
    steady = np.column_stack([0.5 * time_s, np.full_like(time_s, 0.5), np.zeros_like(time_s)])
    run = law.track(steady, covariances=True, resolution_m=1e-9)
    diagonals = np.diagonal(run.gamma, axis1=1, axis2=2) / X_COVARIANCE
    assert diagonals.max() > limit
    assert diagonals.max() <= limit * math.exp(5.0 * TS) * (1 + 1e-12)


def test_the_rate_of_the_estimate_is_limited(model):
    limit = 0.02
    law = Law(model, rate_limit_1_s=limit)
    run = law.track(multisine(2.0), resolution_m=1e-9)
    free = (run.rows["flags"] & LawFlag.PROJECTED) == 0
    rates = np.linalg.norm(np.diff(run.theta, axis=0) / np.sqrt(X_COVARIANCE), axis=1) / TS
    assert rates[free[1:]].max() == pytest.approx(limit, rel=1e-9)
    unlimited = Law(model).track(multisine(2.0), resolution_m=1e-9)
    faster = np.diff(unlimited.theta, axis=0) / np.sqrt(X_COVARIANCE)
    assert np.linalg.norm(faster, axis=1).max() / TS > 2 * limit


def test_the_estimate_stays_within_its_bounds_and_assumption_2(model):
    bounds = {
        "lower": (0.15, 0.2, 0.1, -0.02, -0.012, -0.0012),
        "upper": (0.195, 0.24, 0.13, 0.02, 0.0, 0.0),
        "theta": (0.19, 0.22, 0.12, 0.0, -0.005, -0.0005),
        "monotonicity_margin": 0.5,
    }
    run = Law(model, **bounds).track(published_x(), resolution_m=0.5e-6)
    assert (run.rows["flags"] & LawFlag.PROJECTED).any()
    assert (run.theta >= bounds["lower"]).all()
    assert (run.theta <= bounds["upper"]).all()
    slopes = 1 + 2 * 10 * run.theta[:, 4] + 3 * 100 * run.theta[:, 5]
    assert slopes.min() >= 0.5 - 1e-9
    assert slopes.min() < 0.5 + 1e-6  # the half-plane was needed


def test_explicit_euler_diverges_at_the_published_covariance_and_the_estimator_does_not(model):
    # Full acceleration in one direction, from the first tick on, and no filter to soften it.
    time_s = np.arange(250) * TS
    acceleration = 36.0
    reference = np.column_stack(
        [0.5 * acceleration * time_s**2 - 0.9 * time_s, acceleration * time_s - 0.9,
         np.full_like(time_s, acceleration)]
    )  # fmt: skip
    law = Law(model, normalisation=0.0, filter_rad_s=1e5, theta=X_TRUTH, **WIDE)
    run = law.track(reference, covariances=True, resolution_m=1e-9, start=(0.0, -0.9))
    phi = filtered(regressor(run, reference), 1e5)[10:, :6]
    gamma = np.diag(X_COVARIANCE)
    assert max(TS * row @ gamma @ row for row in phi) > 1.0
    for row in phi:
        gamma = gamma + TS * (1.1 * gamma - np.outer(gamma @ row, gamma @ row))
        if np.linalg.eigvalsh(gamma).min() < -1.0:
            break
    else:
        pytest.fail("explicit Euler was stable")
    lowest = np.linalg.eigvalsh(run.gamma / np.sqrt(np.outer(X_COVARIANCE, X_COVARIANCE)))
    assert lowest.min() > 0.0
    assert np.abs(run.theta - X_TRUTH).max() < 1.0


def test_the_estimate_is_kept_when_the_law_starts_again(model):
    law = Law(model)
    first = law.track(multisine(1.0), resolution_m=1e-9)
    again = law.track(multisine(0.01), resolution_m=1e-9)
    assert (again.theta[0] == first.theta[-1]).all()


def test_nothing_is_learned_while_the_position_is_not_known(model):
    law = Law(model)
    law.state["blind"] = 1
    run = law.track(multisine(1.0), resolution_m=1e-9)
    assert (run.theta == X_START).all()
    assert not (run.rows["flags"] & LawFlag.ADAPTED).any()


def test_with_adaptation_off_the_estimate_is_what_was_configured(model):
    run = Law(model, enabled=False).track(multisine(1.0), resolution_m=1e-9)
    assert (run.theta == X_START).all()
    assert not (run.rows["flags"] & LawFlag.ADAPTED).any()
