"""Where a residual has many valleys, options evolve instead of going downhill."""

from __future__ import annotations

import numpy as np
import pytest
from fit_plant import C1

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.search import evolution
from motorctl.identify.diagnose.search.evolution import EARLY, MEMBERS, evolved
from motorctl.identify.diagnose.search.forms import best_form, refined
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import by_simplex, measure
from motorctl.identify.diagnose.search.search import whitened
from motorctl.model import effect_class, make_effect
from motorctl.model.columns import state_columns

RATE_HZ = 200.0
GAP_M = 6e-3


def behind_a_gap():
    """Return what is measured of an axis whose load of 0.1 of 0.25 V*s^2/m is behind a gap."""
    t = np.arange(0.0, 12.0, 1.0 / RATE_HZ)
    phases = np.random.default_rng(5).uniform(0.0, 2.0 * np.pi, 5)
    x = sum(
        0.1 / (k + 1) * np.sin(2.0 * np.pi * (0.2 + 0.31 * k) * t + phases[k]) for k in range(5)
    )
    v = np.gradient(x, 1.0 / RATE_HZ)
    a = np.gradient(v, 1.0 / RATE_HZ)
    gap = {"gap_m": GAP_M, "glide_m_s2": 0.5, "contact_hz": 25.0}
    push = state_columns(make_effect(effect_class("backlash"), gap), x, v, a, v, t)[0]
    command = 0.25 * a + 0.3 * v + 0.1 * np.arctan(900.0 * v) + 0.1 * push
    command += 1e-3 * np.random.default_rng(3).standard_normal(len(t))
    return Measured(
        source="gap.csv",
        axis="x",
        sample_rate_hz=RATE_HZ,
        time_s=t,
        position=np.round(x / 1e-6) * 1e-6,
        command=command,
        reference=None,
        reference_velocity=None,
        usable=np.ones(len(t), dtype=bool),
        saturated=None,
        resolution=1e-6,
        position_unit="m",
        command_unit="V",
    )


def test_a_gap_is_found_where_a_single_search_would_stop_beside_it():
    signals = make_signals(behind_a_gap(), None, slope_s_m=900.0)
    spans = spans_of(signals)
    alone = Hypothesis(whitened(signals, C1, ())[0]).refreshed()
    first = best_form(alone, effect_class("backlash"), spans, None)
    assert by_simplex(alone, first, spans).held_out > 0.3 * alone.held_out
    found = refined(alone, first, spans)
    assert found.held_out < 0.2 * alone.held_out
    assert found.effect.options.gap_m == pytest.approx(GAP_M, rel=0.15)
    assert found.effect.options.glide_m_s2 == pytest.approx(0.5, rel=0.15)


def test_evolution_ends_early_where_too_little_shows(monkeypatch):
    monkeypatch.setattr(evolution, "SHOWS", 0.0)  # of what is left below the low band: nothing does
    signals = make_signals(behind_a_gap(), None, slope_s_m=900.0)
    spans = spans_of(signals)
    alone = Hypothesis(whitened(signals, C1, ())[0]).refreshed()
    first = best_form(alone, effect_class("backlash"), spans, None)
    tried = []
    monkeypatch.setattr(
        evolution, "measure", lambda *args, **options: tried.append(1) or measure(*args, **options)
    )
    assert evolved(alone, [first], spans) is first
    assert len(tried) <= MEMBERS * (EARLY + 1) + 1


def test_what_evolves_is_the_same_each_time():
    signals = make_signals(behind_a_gap(), None, slope_s_m=900.0)
    spans = spans_of(signals)
    alone = Hypothesis(whitened(signals, C1, ())[0]).refreshed()
    first = best_form(alone, effect_class("backlash"), spans, None)
    assert (
        evolved(alone, [first], spans).effect.options
        == evolved(alone, [first], spans).effect.options
    )
