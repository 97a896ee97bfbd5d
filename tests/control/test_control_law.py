"""The law itself: its terms as published, its saturation, its start, its settings."""

import math

import numpy as np
import pytest
from law_bench import C1_NAMES, C2_NAMES, X_START, X_TRUTH, Law, effects, multisine

from motorctl.control import LawFlag, max_input_delay_s
from motorctl.errors import UsageError

TS = 0.2e-3
K1, KS, GAMMA_D = 250.0, 95.0, 500.0


@pytest.fixture(scope="module")
def c1():
    return effects(*C1_NAMES)


@pytest.fixture(scope="module")
def c2():
    return effects(*C2_NAMES)


def sf(v):
    return 2 / math.pi * np.arctan(900 * v)


def test_the_virtual_command_is_the_sum_of_the_published_terms(c2):
    reference = multisine(2.0)
    law = Law(c2, enabled=False)
    run = law.track(reference, resolution_m=0.5e-6)
    y, (xd, vd, ad) = run.rows["y"], reference.T
    t1, t2, t3, t4, t5, t6 = X_START
    p = np.diff(y, prepend=y[0]) / TS - vd + K1 * (y - xd)
    model = t1 * ad + t2 * vd + t3 * sf(vd) - t4
    d0 = np.concatenate([[model[0]], run.rows["d0"][:-1]])  # before this tick's step
    assert np.allclose(run.rows["virtual"], model - d0 - KS * p, rtol=0, atol=1e-9)
    u = run.rows["u"]
    assert np.allclose(u + t5 * u * abs(u) + t6 * u**3, run.rows["virtual"], rtol=0, atol=1e-12)
    assert np.allclose(run.rows["d0"], np.clip(d0 + TS * GAMMA_D * p, -1.0, 1.0), rtol=0, atol=1e-9)


def test_a_matched_velocity_is_the_difference_of_two_errors(c2):
    reference = multisine(1.0)
    law = Law(c2, enabled=False, velocity="matched", gamma_d=0.0)
    run = law.track(reference, resolution_m=0.5e-6)
    y, (xd, vd, ad) = run.rows["y"], reference.T
    e = y - xd
    p = np.diff(e) / TS + K1 * e[1:]
    t1, t2, t3, t4, _, _ = X_START
    model = t1 * ad + t2 * vd + t3 * sf(vd) - t4
    virtual = (model - model[0] - KS * np.concatenate([[0.0], p]))[1:]
    assert np.allclose(run.rows["virtual"][1:], virtual, rtol=0, atol=1e-8)


@pytest.mark.slow
def test_c1_is_c2_with_its_electromagnetic_parameters_at_zero(c1, c2):
    reference = multisine(1.0)
    theta = (*X_START[:4], 0.0, 0.0)
    one = Law(c1, enabled=False, theta=theta[:4]).track(reference, resolution_m=0.5e-6)
    two = Law(c2, enabled=False, theta=theta).track(reference, resolution_m=0.5e-6)
    assert (one.rows == two.rows).all()


@pytest.mark.slow
def test_c2_compensates_what_c1_does_not(c1, c2):
    # Fast enough a loop that what the hold adds does not hide the rest.
    fast = {"period_s": 20e-6, "enabled": False}
    reference = multisine(1.6, 20e-6)
    errors = []
    for law in (Law(c1, theta=X_TRUTH[:4], **fast), Law(c2, theta=X_TRUTH, **fast)):
        run = law.track(reference)
        errors.append(np.abs(run.rows["x"] - reference[:, 0])[50_000:].max())
    assert errors[1] < 0.1 * errors[0]


def test_the_command_never_leaves_its_range_and_says_so(c2):
    law = Law(c2, max_voltage_v=4.0)
    run = law.track(multisine(1.5), resolution_m=0.5e-6)
    saturated = (run.rows["flags"] & LawFlag.SATURATED) != 0
    assert np.abs(run.rows["u"]).max() == 4.0
    assert ((np.abs(run.rows["u"]) == 4.0) == saturated).all()


def test_the_fast_adaptation_does_not_push_further_into_saturation(c2):
    law = Law(c2, max_voltage_v=4.0, d_hat_max_v=50.0, enabled=False)
    reference = multisine(1.5)
    run = law.track(reference, resolution_m=0.5e-6)
    steps = np.diff(run.rows["d0"])
    u, saturated = run.rows["u"][1:], (run.rows["flags"][1:] & LawFlag.SATURATED) != 0
    # -d0 adds to the command: frozen where it would raise one that is at its limit.
    assert saturated.sum() > 100
    assert (steps[saturated] * u[saturated] >= 0.0).all()
    y = run.rows["y"]
    p = np.diff(y, prepend=y[0]) / TS - reference[:, 1] + K1 * (y - reference[:, 0])
    held = saturated & (GAMMA_D * p[1:] * u < 0.0)
    assert held.sum() > 50
    assert (steps[held] == 0.0).all()
    assert (np.abs(steps[~held & (p[1:] != 0.0)]) > 0.0).all()


def test_the_fast_adaptation_stays_within_its_bound(c2):
    run = Law(c2, enabled=False).track(multisine(1.5), push=3.0, resolution_m=0.5e-6)
    assert np.abs(run.rows["d0"]).max() == 1.0


@pytest.mark.parametrize("offset", [-0.4, 0.0, 0.4])
def test_the_law_starts_without_a_bump_whatever_was_learned(c2, offset):
    law = Law(c2, theta=(*X_START[:3], offset, *X_START[4:]))
    at_rest = np.zeros((50, 3))
    run = law.track(at_rest, (*X_TRUTH[:3], 0.0, *X_TRUTH[4:]), resolution_m=0.5e-6)
    assert run.rows["u"][0] == 0.0
    assert np.abs(run.rows["u"]).max() < 0.3  # a count of the encoder is 0.25 V


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("input_delay_s", -1e-9),
        ("input_delay_s", max_input_delay_s(TS) + 1e-6),
        ("input_delay_s", math.nan),
        ("covariance", (2.0, 50.0, 0.0, 500.0, 0.05, 0.005)),
        ("covariance", (2.0, 50.0, math.nan, 500.0, 0.05, 0.005)),
    ],
)
def test_settings_that_cannot_work_are_refused(c2, setting, value):
    with pytest.raises(UsageError):
        Law(c2, **{setting: value})


def test_the_longest_input_delay_is_learned_through(c2):
    law = Law(c2, input_delay_s=max_input_delay_s(TS), enabled=True)
    run = law.track(multisine(1.0), resolution_m=1e-9)
    assert np.isfinite(run.theta).all()
    assert (run.rows["flags"] & LawFlag.ADAPTED).any()
