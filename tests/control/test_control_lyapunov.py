"""The transient guarantee of the paper, its eq. 24, in a simulation apart from the model.

Chen, Yao, Wang 2013, eq. 16 with the sampled law's signs: theta1 dp/dt = -ks p
+ (theta1 k1 - theta2 - theta3 g) de/dt + Delta, where Delta = -phi_d^T (theta_hat - theta) - d0_hat
is all that the model and the fast adaptation do not compensate, |Delta| <= h over the box. Along
it, Vs = theta1 p^2/2 + theta1 k1^2 e^2/2 has

    dVs/dt = -(ks - theta1 k1 + G) p^2 + k1 G e p - theta1 k1^3 e^2 + p Delta,

G = theta2 + theta3 g. Split ks = ks1 + ks2. With
ks1 >= k2 + theta1 k1 - G + G^2/(2 theta1 k1) the first three terms and
-ks1's share are at most -lambda Vs, lambda = min(2 k2/theta1max, k1). What is left,
-ks2 p^2 + p Delta, is at most h^2/(4 ks2): the paper's eta for a constant ks2 (its eq. 22).
"""

import numpy as np
import pytest
from law_bench import C2_NAMES, Law, effects, multisine

TS = 20e-6
SLOPE = 900.0
LOWER = np.array([0.18, 0.15, 0.06, -0.05, -0.012, -0.0007])
UPPER = np.array([0.22, 0.35, 0.10, 0.05, -0.008, -0.0003])
MIDDLE = 0.5 * (LOWER + UPPER)
K1, K2, KS2, D_MAX, U_MAX = 250.0, 25.0, 5.0, 0.2, 10.0
START = (1e-4, 0.02)
"""Off the reference by this much at the start [m, m/s]."""


@pytest.fixture(scope="module")
def model():
    return effects(*C2_NAMES)


@pytest.fixture(scope="module")
def reference():
    return multisine(1.6, TS, peak_m_s2=15.0)


def needed_ks1() -> float:
    """Return the least ks1 over the box; the condition is convex in G."""
    ends = [
        K2 + t1 * K1 - g + g * g / (2 * t1 * K1)
        for t1 in (LOWER[0], UPPER[0])
        for g in (LOWER[1], UPPER[1] + UPPER[2] * 2 * SLOPE / np.pi)
    ]
    return max(ends)


def bound(vs0: float, error: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return eq. 24's right side at every tick; error (6,) bounds |theta_hat - theta|."""
    largest = [*np.abs(reference[:, [2, 1]]).max(axis=0), 1.0, 1.0, U_MAX**2, U_MAX**3]
    h = error @ largest + D_MAX
    eta, rate = h**2 / (4 * KS2), min(2 * K2 / UPPER[0], K1)
    decay = np.exp(-rate * TS * np.arange(len(reference)))
    return decay * vs0 + eta / rate * (1 - decay)


def lyapunov(model, reference, truth, *, ks, adapt, d_max=D_MAX) -> np.ndarray:
    law = Law(
        model, period_s=TS, k1_1_s=K1, ks_v_s_m=ks, gamma_d=300.0, d_hat_max_v=d_max,
        max_voltage_v=U_MAX, lower=LOWER, upper=UPPER, theta=MIDDLE, enabled=adapt,
    )  # fmt: skip
    start = tuple(reference[0, :2] + START)
    run = law.track(reference, truth, start=start, slope=SLOPE, substeps=2, estimates=False)
    assert np.abs(run.rows["u"]).max() < U_MAX  # else eq. 16 does not hold
    e = run.rows["x"] - reference[:, 0]
    p = run.rows["v"] - reference[:, 1] + K1 * e
    return 0.5 * truth[0] * (p**2 + K1**2 * e**2)


def plants() -> list[np.ndarray]:
    rng = np.random.default_rng(11)
    corners = [np.where(rng.random(6) < 0.5, LOWER, UPPER) for _ in range(6)]
    return corners + [rng.uniform(LOWER, UPPER) for _ in range(4)]


@pytest.mark.parametrize("adapt", [False, True])
def test_the_error_stays_within_the_guaranteed_bound(model, reference, adapt):
    error = (UPPER - LOWER) if adapt else 0.5 * (UPPER - LOWER)
    for truth in plants():
        vs = lyapunov(model, reference, truth, ks=needed_ks1() + KS2, adapt=adapt)
        assert (vs <= bound(vs[0], error, reference) * (1 + 1e-9)).all()


def test_too_small_a_gain_leaves_the_bound(model, reference):
    # The bound is not so wide that any loop would keep it.
    for truth in plants():
        vs = lyapunov(model, reference, truth, ks=0.05 * needed_ks1(), adapt=False)
        assert (vs > bound(vs[0], 0.5 * (UPPER - LOWER), reference)).any()


def test_without_model_error_the_decay_is_the_guaranteed_one_and_needs_the_gain(model, reference):
    reference = reference[:5000]
    rate = min(2 * K2 / UPPER[0], K1)
    decay = np.exp(-rate * TS * np.arange(len(reference)))
    runs = [
        lyapunov(model, reference, MIDDLE, ks=ks, adapt=False, d_max=0.0)
        for ks in (needed_ks1(), 0.25 * needed_ks1())
    ]
    kept, left = [vs > (decay + 1e-6) * vs[0] for vs in runs]
    assert not kept.any()
    assert left.any()
