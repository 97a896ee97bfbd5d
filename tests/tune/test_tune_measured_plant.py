"""Gains around a measured response: what rings counts, and what is not known is borne."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from linear_loop import GENTLE, TS, disturbance, loop_of
from scipy.signal import cont2discrete

from motorctl.config.analysis import DelayedPlant, LoopGains
from motorctl.errors import UsageError
from motorctl.response.estimate import Response
from motorctl.response.fitted_plant import fit_plant
from motorctl.tune.candidates import LoopShapes, MarginsWanted
from motorctl.tune.choice import choose_gains
from motorctl.tune.measured_plant import measured_plant

pytestmark = pytest.mark.slow

MASS, VISCOUS, DELAY_TICKS = 0.3, 0.4, 2
SPRING = (400.0, 0.01, 0.3)
"""Frequency clamped [Hz], damping ratio, share of the mass."""
LINES_HZ = np.geomspace(10.0, 1200.0, 120)
WANTED = MarginsWanted(30.0, 2.0, 2.0)


def two_masses(spring):
    """Return the sampled plant, written from the equations of motion: A, B, C."""
    hz, damping, share = spring
    loose, carriage = share * MASS, (1.0 - share) * MASS
    w = 2.0 * np.pi * hz
    k, c = loose * w**2, 2.0 * damping * loose * w
    a = [[0, 1, 0, 0], [-k / carriage, -(c + VISCOUS) / carriage, k / carriage, c / carriage],
         [0, 0, 0, 1], [k / loose, c / loose, -k / loose, -c / loose]]  # fmt: skip
    system = (np.array(a, float), np.array([[0], [1.0 / carriage], [0], [0]]), np.eye(1, 4), 0.0)
    a, b, c_out, _, _ = cont2discrete(system, TS)
    return a, b, c_out


def on_paper(spring, hz):
    a, b, c = two_masses(spring)
    z = np.exp(2j * np.pi * hz * TS)
    plant = np.array([(c @ np.linalg.solve(each * np.eye(4) - a, b))[0, 0] for each in z])
    return plant / z**DELAY_TICKS


def is_stable_on_paper(spring, gains):
    """Return whether the closed loop's eigenvalues lie inside the unit circle."""
    a, b, c = two_masses(spring)
    n = 4 + DELAY_TICKS + 2  # plant, commands under way, position before, d0
    own = gains.command_filter
    system = np.zeros((n + 4, n + 4))  # and the filter's last two inputs and outputs
    system[:4, :4], system[:4, 4] = a, b[:, 0]
    for k in range(DELAY_TICKS - 1):
        system[4 + k, 5 + k] = 1.0
    before, d0, last = n - 2, n - 1, 4 + DELAY_TICKS - 1
    p = np.zeros(n + 4)
    p[:4], p[before] = (1.0 / TS + gains.k1_1_s) * c[0], -1.0 / TS
    feedback = -gains.ks_v_s_m * p
    feedback[d0] -= 1.0
    system[last] = system[n] = feedback
    if own is not None:
        system[last] = own.b0 * feedback
        system[last, n : n + 4] = own.b1, own.b2, -own.a1, -own.a2
    system[n + 1, n], system[n + 2], system[n + 3, n + 2] = 1.0, system[last], 1.0
    system[before, :4] = c[0]
    system[d0] = TS * gains.gamma_d * p
    system[d0, d0] += 1.0
    return np.abs(np.linalg.eigvals(system)).max() < 1.0


@cache
def measured(spring=SPRING, error=1e-3, band_hz=(10.0, 1200.0)):
    lines_hz = LINES_HZ
    hz = lines_hz[(lines_hz >= band_hz[0]) & (lines_hz <= band_hz[1])]
    response = Response(
        axis="x", source="response.parquet", period_s=TS, frequency_hz=hz,
        plant=on_paper(spring, hz), sensitivity=np.ones(len(hz), complex),
        plant_error=np.full(len(hz), error), sensitivity_error=np.full(len(hz), error),
        coherence=np.ones(len(hz)), not_linear_v=np.zeros(0), not_linear_hz=np.zeros(0),
        line_v=0.1, windows=20, speed_m_s=0.1,
    )  # fmt: skip
    return SimpleNamespace(response=response, fitted=fit_plant(response))


@cache
def known(**changes):
    return measured_plant(measured(**changes), "x", TS)


def loop(**changes):
    """Return what a log tells of a loop, and a response of its plant."""
    told = loop_of(GENTLE, disturbance(np.random.default_rng(3)), limit_v=20.0)
    return replace(told, measured=known(**changes), noise_rms_m=1e-9)


@settings(max_examples=40)
@given(
    k1=st.floats(40.0, 600.0),
    k2=st.floats(0.5, 60.0),
    ks=st.floats(5.0, 400.0),
)
def test_a_loop_around_what_was_measured_is_stable_where_its_eigenvalues_say_so(k1, k2, ks):
    gains = LoopGains(k1, ks, ks * k2)
    shapes = LoopShapes(known().rigid, [], known())
    margins = shapes.margins(gains, 0.0, 0.0)
    assume(margins.crossover_rad_s is not None)
    assume(abs(margins.phase_margin_deg) > 1.0 and (margins.gain_margin or 2.0) > 1.05)
    assert margins.stable == is_stable_on_paper(SPRING, gains)


def test_gains_that_a_rigid_plant_allows_ring_with_the_measured_one():
    rigid = DelayedPlant((MASS, VISCOUS, 0.0), TS, DELAY_TICKS * TS)
    gains = LoopGains(250.0, 250.0, 2500.0)
    assert LoopShapes(rigid, []).stable_everywhere(gains)
    assert not LoopShapes(rigid, [], known()).stable_everywhere(gains)
    assert not is_stable_on_paper(SPRING, gains)


@pytest.mark.slow
def test_what_is_chosen_keeps_its_margins_around_the_true_plant():
    choice = choose_gains(loop(), WANTED, lambda what, share: None)
    gains = choice.chosen.gains
    for factor in (1.0 / WANTED.gain, 1.0, WANTED.gain):
        grown = replace(gains, ks_v_s_m=factor * gains.ks_v_s_m, gamma_d=factor * gains.gamma_d)
        assert is_stable_on_paper(SPRING, grown)
    assert choice.margins.stable
    assert choice.margins.phase_margin_deg >= WANTED.phase_deg
    # a filter that was chosen leaves less error, and bears a resonance that moves
    without = choice.without_filter
    assert without is not None
    assert choice.chosen.prediction.eF_m < 0.95 * without.prediction.eF_m
    assert without.phase_deg >= WANTED.phase_deg
    for moved in (0.96, 1.04):
        assert is_stable_on_paper((moved * SPRING[0], *SPRING[1:]), gains)


def test_what_is_not_known_is_taken_off_the_margins():
    gains = LoopGains(100.0, 40.0, 400.0)
    sure, less = (
        LoopShapes(plant.rigid, [], plant).margins(gains, 0.0, 0.0)
        for plant in (known(error=error) for error in (1e-3, 0.02))
    )
    turned = np.degrees(np.arcsin(0.04) - np.arcsin(0.002))
    assert sure.phase_margin_deg - less.phase_margin_deg == pytest.approx(turned, abs=0.3)
    assert sure.gain_margin / less.gain_margin == pytest.approx(1.04 / 1.002, rel=0.01)


@pytest.mark.slow
def test_no_gains_are_chosen_that_cross_over_where_nothing_was_measured():
    narrow = loop(spring=(150.0, 0.02, 0.0001), band_hz=(10.0, 40.0))
    choice = choose_gains(narrow, WANTED, lambda what, share: None)
    assert choice.margins.crossover_rad_s <= 2.0 * np.pi * 40.0
    assert "the band of the measured response" in choice.bound_by


def test_a_response_of_another_axis_or_rate_is_refused():
    with pytest.raises(UsageError, match="the response of axis x, not of y"):
        measured_plant(measured(), "y", TS)
    with pytest.raises(UsageError, match=r"measured at 5000 Hz, and axis x runs at 2000 Hz"):
        measured_plant(measured(), "x", 0.5e-3)
