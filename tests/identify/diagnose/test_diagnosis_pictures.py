"""What the pictures of a diagnosis draw, against signals of which the answer is known."""

from dataclasses import replace
from itertools import pairwise
from typing import get_args

import diagnosis_bench as bench
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiers import few_of

from motorctl.identify.diagnose.report.pictures import residual
from motorctl.identify.diagnose.report.pictures.all import DRAWERS, plot_diagnosis
from motorctl.identify.diagnose.report.pictures.frequency_response import (
    bridge_rests,
    frequency_response,
)
from motorctl.identify.diagnose.report.pictures.statistics import (
    binned,
    even_edges,
    position_noise,
    position_spectrum,
    ratio_in_bins,
    since_reversal,
    unbroken,
)
from motorctl.model import Spans, known_effects
from motorctl.model.knowledge import PictureKind

SPANS = Spans((0.0, 0.4), 1.0, 10.0, 9.0, (0.0, 24.0), 2e-4, 200.0, 5e-7, ("y",))
NEVER_MISSING = {
    "inertia",
    "viscous_friction",
    "coulomb_friction",
    "offset",
    "em_quadratic",
    "em_cubic",
    "residual_map",  # explains everything and names nothing
}
ONE_OF_EACH_KIND = {
    form.picture.kind: name
    for name in sorted(bench.KNOWN)
    if (form := known_effects()[name].typical(SPANS)) is not None
}
"""An effect for each kind of picture: how little data it takes does not depend on the effect."""


def assert_is_a_picture(path):
    assert path.read_bytes().startswith(b"\x89PNG\r\n")
    assert path.stat().st_size > 5_000


def test_every_effect_that_can_be_missing_has_a_picture_of_its_own():
    kinds = {
        name: form.picture.kind
        for name, cls in known_effects().items()
        if (form := cls.typical(SPANS)) is not None
    }
    assert {name for name, kind in kinds.items() if kind == "over_time"} <= NEVER_MISSING
    assert set(kinds.values()) <= set(DRAWERS)


def test_every_picture_that_an_effect_may_ask_for_can_be_drawn():
    assert set(DRAWERS) == set(get_args(PictureKind))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["presliding", "input_lag"])
def test_an_effect_is_drawn_beside_residual_and_spectrum_axis_by_axis(tmp_path, name):
    axes = {"x": bench.axis_diagnosis(name), "y": bench.axis_diagnosis(seed=2)}
    pictures = plot_diagnosis(bench.recording(**axes), tmp_path)
    of_x, of_y = pictures[:3], pictures[3:]
    assert [p.about for p in of_x] == [name, "residual", "spectrum"]
    assert [p.about for p in of_y] == ["residual", "spectrum"]
    for axis, picture in [*(("x", p) for p in of_x), *(("y", p) for p in of_y)]:
        assert picture.path == tmp_path / f"{axis}_{picture.about}.png"
        assert_is_a_picture(picture.path)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "marked"), [("periodic_disturbance", True), ("cogging", False)])
def test_a_line_over_time_is_marked_in_the_spectrum_and_a_wave_over_position_is_not(
    tmp_path, monkeypatch, name, marked
):
    marks = []
    monkeypatch.setattr(residual, "mark_frequency", lambda panel, at, words: marks.append(at))
    axis = bench.axis_diagnosis(name)
    plot_diagnosis(bench.recording(x=axis), tmp_path)
    assert marks == (list(axis.effects[0].effect.lines) if marked else [])
    assert bool(marks) == marked


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(sorted(bench.KNOWN), 2))
def test_every_effect_can_be_drawn(tmp_path, name):
    for picture in plot_diagnosis(bench.recording(x=bench.axis_diagnosis(name)), tmp_path):
        assert_is_a_picture(picture.path)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ONE_OF_EACH_KIND.values()))
@pytest.mark.parametrize("rows", [16, 40])
def test_pictures_survive_hardly_any_data(tmp_path, name, rows):
    axis = bench.axis_diagnosis(name)
    few = {
        key: value[:rows]
        for key, value in vars(axis.traces).items()
        if isinstance(value, np.ndarray) and len(value) == len(axis.traces.time_s)
    }
    contributions = {key: value[:rows] for key, value in axis.traces.contributions.items()}
    traces = replace(axis.traces, contributions=contributions, **few)
    for picture in plot_diagnosis(bench.recording(x=replace(axis, traces=traces)), tmp_path):
        assert_is_a_picture(picture.path)


@pytest.mark.slow
def test_an_axis_that_stands_still_can_be_drawn(tmp_path):
    axis = bench.axis_diagnosis("cogging")
    still = np.zeros_like(axis.traces.time_s)
    traces = replace(axis.traces, position=still + 0.1, velocity=still, acceleration=still)
    pictures = plot_diagnosis(bench.recording(x=replace(axis, traces=traces)), tmp_path)
    assert len(pictures) == 3


def test_an_axis_without_signals_has_no_pictures(tmp_path):
    assert plot_diagnosis(bench.recording(x=bench.insufficient_axis()), tmp_path) == []


def test_the_spectrum_along_the_way_shows_a_sine_with_its_amplitude_and_wave_number():
    m = bench.motion(1)
    wave, amplitude = position_spectrum(m.x, 0.3 * np.sin(2 * np.pi * 40.0 * m.x + 1.0), 100.0)
    peak = int(np.argmax(amplitude))
    assert wave[peak] == pytest.approx(40.0, abs=0.7)
    assert amplitude[peak] == pytest.approx(0.3, rel=0.1)


def test_dwelling_at_one_place_does_not_dominate_the_spectrum_along_the_way():
    x = np.concatenate([np.linspace(0.0, 0.3, 3000), np.full(60_000, 0.3)])
    wave, amplitude = position_spectrum(x, np.sin(2 * np.pi * 50.0 * x), 100.0)
    assert wave[np.argmax(amplitude)] == pytest.approx(50.0, abs=0.7)
    assert np.max(amplitude) == pytest.approx(1.0, rel=0.1)


def test_about_one_percent_of_noise_exceeds_the_level_that_is_drawn_for_it():
    m = bench.motion(1)
    over = []
    for seed in range(8):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(len(m.x))
        amplitude = position_spectrum(m.x, noise, 200.0)[1]
        over.append(np.mean(amplitude > position_noise(m.x, 0.02, 200.0)))
    assert 0.002 < np.mean(over) < 0.03


def test_the_response_of_a_lag_and_a_delay_is_found_from_signals():
    rate, lag, delay = 600.0, 2e-3, 1e-3
    t = np.arange(24_000) / rate
    u = np.random.default_rng(1).standard_normal(len(t))
    s = 2j * np.pi * np.fft.rfftfreq(len(t), 1.0 / rate)
    truth = np.exp(-s * delay) / (1.0 + s * lag)
    y = np.fft.irfft(np.fft.rfft(u) * truth, len(t))
    seen = frequency_response(t, u, y, 200.0)
    w = 2j * np.pi * seen.frequency_hz
    expected = np.exp(-w * delay) / (1.0 + w * lag)
    assert len(seen.gain) > 10
    assert np.max(np.abs(seen.gain - expected)) < 0.05


def test_an_instrument_frees_the_response_from_noise_that_goes_round_the_loop():
    """u = r - n and y = u + n: direct division sees less than the gain of one."""
    rate = 600.0
    random = np.random.default_rng(3)
    t = np.arange(60_000) / rate
    r, n = random.standard_normal((2, len(t)))
    direct = frequency_response(t, r - n, r, 200.0)
    with_reference = frequency_response(t, r - n, r, 200.0, instrument=r)
    assert np.all(np.abs(direct.gain) < 0.75)
    error = np.abs(with_reference.gain - 1.0)
    assert np.median(error / with_reference.std_error) < 3.0
    assert np.median(error) < 0.15


def test_short_stretches_count_where_they_are_most_of_the_recording():
    rate = 600.0
    t = np.arange(12_000) / rate
    u = np.random.default_rng(5).standard_normal(len(t))
    broken = t + (np.arange(len(t)) // 200) * 2.0
    whole, parts = (frequency_response(time, u, 0.5 * u, 200.0) for time in (t, broken))
    assert np.min(parts.frequency_hz) > np.min(whole.frequency_hz)
    np.testing.assert_allclose(parts.gain, 0.5)


def test_rests_that_were_cut_out_are_bridged_and_other_gaps_are_not():
    m = bench.motion(1)
    moving = np.abs(m.v) > 1e-4
    lost = moving & ~((m.t > 10.0) & (m.t < 11.0))  # while it moved
    time, (position,) = bridge_rests(m.t[lost], m.x[lost], [m.x[lost]])
    gaps = np.flatnonzero(np.diff(time) > 1.5 / bench.RATE_HZ)
    assert [round(time[k], 1) for k in gaps] == [10.0]
    assert np.max(np.abs(position - np.interp(time, m.t, m.x))) < 1e-4


def test_windows_never_reach_across_a_gap():
    rate = 100.0
    t = np.arange(4000) / rate
    later = t + (np.arange(4000) >= 2000) * 5.0
    assert [(s.start, s.stop) for s in unbroken(later, 1.0 / rate)] == [(0, 2000), (2000, 4000)]
    short = np.repeat(np.arange(400), 10) + np.tile(np.arange(10), 400) / rate
    assert len(frequency_response(short, t, t, 40.0).gain) == 0


@given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=60))
def test_the_way_since_a_reversal_is_that_of_the_last_turn(steps):
    x = np.cumsum(steps)
    way, direction = since_reversal(x, 1.0)
    assert np.all(way >= 0.0)
    for k in np.flatnonzero(direction):
        turn = np.flatnonzero(direction[: k + 1] != direction[k])
        start = int(turn[-1]) + 1 if len(turn) else 0
        assert way[k] == pytest.approx(abs(x[k] - x[start]))
        # since it turned it never went back by as much as counts as a turn, until it did so
        ahead = direction[k] * (x[start : k + 1] - x[start])
        assert np.all(ahead >= -1e-9)


def test_turns_of_less_than_what_counts_are_no_turns():
    x = np.concatenate([np.linspace(0, 10, 50), np.linspace(10, 5, 30), np.linspace(5, 8, 30)])
    x += 0.05 * (-1.0) ** np.arange(len(x))
    direction = since_reversal(x, 0.5)[1]
    assert [int(d) for d in direction[np.flatnonzero(np.diff(direction, prepend=9.0))]] == [
        0,
        -1,
        1,
    ]


@given(st.integers(1, 400), st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_bins_hold_the_median_of_what_lies_in_them(rows, most, seed):
    random = np.random.default_rng(seed)
    x, y = random.standard_normal((2, rows))
    edges = even_edges(x, most, 10)
    found = binned(x, y, edges)
    expected = []
    for low, high in pairwise(edges):
        inside = (x >= low) & ((x < high) | (high == edges[-1]))
        if inside.sum() >= 5:
            expected.append(np.median(y[inside]))
    np.testing.assert_allclose(found.middle, expected)
    assert np.all(found.low <= found.middle)
    assert np.all(found.middle <= found.high)


def test_the_ratio_in_bins_is_the_gain_at_each_place():
    m = bench.motion(1)
    gain = 0.05 * np.sin(2 * np.pi * m.x / 0.1)
    place, ratio = ratio_in_bins(m.x, gain * m.a, m.a, even_edges(m.x, 100, 60))
    assert len(place) > 30
    assert np.max(np.abs(ratio - 0.05 * np.sin(2 * np.pi * place / 0.1))) < 0.01
