"""A filter on the feedback's part of the command: as published without, as on paper with."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from law_bench import X_START
from law_stepper import Stepper, known
from scipy.signal import lfilter

from motorctl.config.analysis import DelayedPlant, LoopGains, is_stable, loop_margins
from motorctl.control import command_filter
from motorctl.errors import UsageError
from motorctl.model import EffectList

TS = 0.2e-3
NOTCH = command_filter("notch", 300.0, 0.5, 0.1, TS)
LOW_PASS = command_filter("low_pass", 400.0, 0.7, 1.0, TS)
FILTERS = st.builds(
    command_filter,
    st.sampled_from(["notch", "low_pass"]),
    st.floats(20.0, 2200.0),
    st.floats(0.05, 2.0),
    st.floats(0.01, 1.0),
    st.just(TS),
)


def stepper(own=None, **gains):
    names = ("inertia", "viscous_friction", "coulomb_friction", "offset")
    model = EffectList([known(name) for name in names])
    theta = X_START[:4]
    return Stepper(
        model, theta, (0.05, 0.08, 0.05, -0.5), (0.55, 0.5, 0.5, 0.5), enabled=False,
        command_filter=own, **gains,
    )  # fmt: skip


@given(FILTERS)
def test_a_filter_is_stable_and_leaves_what_rests(own):
    assert own.response(np.ones(1, complex))[0] == pytest.approx(1.0, abs=1e-9)
    assert np.abs(np.roots([1.0, own.a1, own.a2])).max() < 1.0


def test_a_notch_leaves_its_depth_at_its_frequency_and_a_low_pass_what_its_damping_says():
    def size(own, hz):
        return abs(own.response(np.exp(2j * np.pi * np.array([hz]) * TS))[0])

    assert size(NOTCH, 300.0) == pytest.approx(0.1)
    assert size(LOW_PASS, 400.0) == pytest.approx(1.0 / (2.0 * 0.7))


@settings(max_examples=60)
@given(FILTERS, st.floats(30.0, 400.0), st.floats(10.0, 300.0), st.floats(0.1, 60.0))
def test_the_gain_margin_behind_a_filter_is_where_the_eigenvalues_leave_the_circle(own, k1, ks, k2):
    gains = LoopGains(k1, ks, ks * k2, own)
    told = loop_margins(0.19, 0.25, **vars(gains), period_s=TS, delay_s=1e-4)
    if told.stable and told.gain_margin is not None:
        plant = DelayedPlant((0.19, 0.25, 0.0), TS, 1e-4)
        for by, stable in ((0.99, True), (1.01, False)):
            grown = LoopGains(k1, ks * by * told.gain_margin, ks * k2 * by * told.gain_margin, own)
            assert is_stable(plant, grown) is stable


@pytest.mark.parametrize("own", [NOTCH, LOW_PASS])
def test_the_law_filters_its_feedback_and_not_its_model(own):
    rng = np.random.default_rng(1)
    law = stepper(own, d_hat_max_v=5.0, max_voltage_v=100.0)
    law.start(0.0, 0.1)
    feedback, behind, d0 = [], [], law.record["d0"]
    y1 = x1 = 0.1
    first = -d0
    for k in range(400):
        t, xd, vd, ad = k * TS, 0.1 + 1e-4 * k * TS, 1e-4, 0.2
        y = xd + 1e-6 * rng.normal()
        law.step(t, y, (xd, vd, ad))
        p = (y - y1) / TS - (xd - x1) / TS + 250.0 * (y - xd)
        feedback.append(-d0 - 95.0 * p)
        model = X_START[0] * ad + X_START[1] * vd
        model += X_START[2] * 2.0 / np.pi * np.arctan(900.0 * vd) - X_START[3]
        behind.append(law.record["v"] - model)
        y1, x1, d0 = y, xd, law.record["d0"]
    b, a = (own.b0, own.b1, own.b2), (1.0, own.a1, own.a2)
    assert np.allclose(behind, first + lfilter(b, a, np.array(feedback) - first), atol=1e-9)


def test_without_a_filter_the_law_is_as_published_to_the_last_bit():
    plain, one = stepper(), stepper(command_filter("notch", 300.0, 0.5, 1.0, TS))
    for law in (plain, one):
        law.start(0.0, 0.1)
    assert not plain.settings["filters"][0]
    rng = np.random.default_rng(2)
    for k in range(100):
        y = 0.1 + 1e-6 * rng.normal()
        u = plain.step(k * TS, y, (0.1, 0.0, 0.0))
        # one of depth 1 lets everything pass: the two ways through the law are the same
        assert one.step(k * TS, y, (0.1, 0.0, 0.0)) == pytest.approx(u, abs=1e-9)


def test_an_axis_at_rest_is_moved_to_new_coordinates_without_a_bump_behind_a_filter():
    law = stepper(LOW_PASS)
    law.start(0.0, 0.1)
    for k in range(2000):
        u = law.step(k * TS, 0.1 + 2e-6, (0.1, 0.0, 0.0))
    law.shift(2000 * TS, 0.1, 0.05)
    assert law.step(2000 * TS, 0.15 + 2e-6, (0.15, 0.0, 0.0)) == pytest.approx(u, abs=1e-3)


@pytest.mark.parametrize("damping", [0.5, 1.0])
@pytest.mark.parametrize("frequency_hz", [2500.0, 3750.0, 7000.0, 0.0, float("nan")])
def test_a_frequency_that_no_sampled_filter_has_is_refused_with_the_highest(
    frequency_hz: float, damping: float
) -> None:
    with pytest.raises(UsageError, match=r"below half of the rate, 2500 Hz"):
        command_filter("low_pass", frequency_hz, damping, 1.0, TS)
