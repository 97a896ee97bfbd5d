"""Gains that a configuration begins with keep margins, and say truly which one holds them back."""

import pytest

from motorctl.config.analysis import LoopMargins, loop_margins
from motorctl.errors import UsageError
from motorctl.init.first_gains import FirstGains, first_gains

SIX_DB = 10.0 ** (6.0 / 20.0)


def gains_of(inertia, viscous, rate_hz, periods_late=0, resolution_m=1e-6):
    bounds = inertia / 2.0, 2.0 * inertia
    late_s = periods_late / rate_hz
    return first_gains(inertia, bounds, viscous, resolution_m, 10.0, 1.0 / rate_hz, late_s, "x")


@pytest.mark.parametrize(
    ("inertia", "viscous", "rate_hz", "periods_late", "least_k1"),
    [(0.001, 100.0, 1000, 0, 250), (0.001, 100.0, 1000, 1, 250), (0.01, 10.0, 100, 0, 100)],
)
def test_an_axis_that_friction_holds_gets_gains_as_fast_as_its_margins_allow(
    inertia, viscous, rate_hz, periods_late, least_k1
):
    gains = gains_of(inertia, viscous, rate_hz, periods_late)
    assert gains.k1_1_s >= least_k1
    assert gains.margins.stable
    assert gains.margins.phase_margin_deg >= 45.0


def test_what_keeps_the_gains_from_being_higher_is_the_margin_that_is_used_up():
    gains = gains_of(0.1, 1.0, 1000)
    assert gains.bound_by == (
        "then the gain margin is less than 6 dB with inertia at its lower bound (0.05 V*s^2/m) and "
        "1 ms of delay"
    )
    told = {"k1_1_s": gains.k1_1_s, "ks_v_s_m": gains.ks_v_s_m, "gamma_d": gains.gamma_d}
    used_up = loop_margins(0.05, 1.0, **told, period_s=1e-3, delay_s=1e-3)
    assert used_up.gain_margin == pytest.approx(SIX_DB, rel=0.02)
    assert used_up.phase_margin_deg > 35.0  # of 30
    assert gains.margins.phase_margin_deg > 50.0  # of 45
    assert f"phase margin {gains.margins.phase_margin_deg:.0f} deg" in gains.margins_in_words


def test_phase_is_told_where_it_is_what_is_used_up():
    gains = gains_of(0.01, 100.0, 100, 4)
    assert gains.bound_by.startswith("then the phase margin is less than 45 degrees with the inert")
    assert gains.margins.phase_margin_deg == pytest.approx(45.0, abs=0.5)


def test_a_rate_at_which_no_gains_keep_their_margins_is_refused_with_the_next_step():
    with pytest.raises(
        UsageError, match=r"axis x: .* at 0\.005 Hz: even with k1 0\.1 1/s .*--rate"
    ):
        gains_of(0.1, 0.1, 0.005)


def test_a_loop_without_a_crossover_is_not_told_as_one_without_phase():
    margins = LoopMargins(0.0, 0.0, True, None, None, None, None)
    told = FirstGains(250.0, 0.5, 2.5, margins, "").margins_in_words
    assert told == "any phase margin, any gain margin"
