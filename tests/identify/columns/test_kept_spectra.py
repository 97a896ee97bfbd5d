"""What is kept of a recording's columns is what would be formed anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from other_plant import OtherPlant

from motorctl.identify.columns import kept_spectra
from motorctl.identify.columns.command_timing import AT_ONCE, CommandPath
from motorctl.identify.columns.kept_spectra import KeptSpectra
from motorctl.identify.columns.signals import make_signals
from motorctl.model import effect_class, make_effect

LATE = CommandPath(delay_s=1e-3, lag_s=2e-3)


def form(name, **options):
    return make_effect(effect_class(name), options)


STRIBECK = form("stribeck", velocity_m_s=0.02)
MODE = form("flexible_mode", frequency_hz=40.0, damping_ratio=0.05)
RIPPLE = form("force_ripple", pitch_m=0.05)


@pytest.fixture(scope="module")
def signals():
    return make_signals(OtherPlant().run(seed=1, duration_s=4.0), slope_s_m=900.0)


def columns(signals, acceleration, *, keep):
    """Return columns of each kind that a scan tries."""
    state = [signals.state_spectra(e, acceleration, keep=keep) for e in (STRIBECK, MODE)]
    parts = [*map(signals.rows_of, state), signals.input(RIPPLE, LATE, keep=keep)]
    return np.vstack([*parts, signals.input(RIPPLE, AT_ONCE, keep=keep)])


def test_kept_columns_are_those_formed_anew_whatever_has_changed_since(signals):
    first = signals.smoothed_acceleration(1.5)
    second = [2.0 * a for a in first]
    moved = tuple(replace(s, x=s.x + 0.01) for s in signals.stretches)
    others = [
        signals,
        signals.plain(50.0),
        signals.turning_over(5.0),
        signals.with_stretches(moved),
    ]
    for _ in range(2):  # the second time from what the first has kept
        for each in others:
            for acceleration in (first, second):
                kept = columns(each, acceleration, keep=True)
                assert np.array_equal(kept, columns(each, acceleration, keep=False))


def test_a_form_that_is_asked_for_again_is_not_formed_again():
    kept, formed = KeptSpectra(), []

    def make():
        formed.append(True)
        return ((np.ones((1, 4), complex), 6),)

    assert kept.of("a", make) is kept.of("a", make)
    assert len(formed) == 1


def test_what_was_not_asked_for_longest_goes_first_when_memory_is_full(monkeypatch):
    monkeypatch.setattr(kept_spectra, "MOST_BYTES", 2 * 64)
    kept, formed = KeptSpectra(), []

    def ask(name):
        def make():
            formed.append(name)
            return ((np.ones((1, 4), complex), 6),)  # 64 bytes

        kept.of(name, make)

    for name in ("a", "b", "a", "c", "a", "b"):
        ask(name)
    assert formed == ["a", "b", "c", "b"]
