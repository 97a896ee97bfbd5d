"""The parts of a measured response, each against what can be said of it on paper."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_response import apart, plant_response

from motorctl.config import load
from motorctl.config.analysis import loop_margins
from motorctl.config.shipped import locate
from motorctl.errors import DataError
from motorctl.response.estimate import Response, estimate_response, require_coherence
from motorctl.response.fitted_plant import fit_plant
from motorctl.response.measured_margins import measured_margins
from motorctl.response.model import model_response
from motorctl.response.multisine import multisine
from motorctl.response.plan import plan_response
from motorctl.response.same_plant import require_same_plant
from motorctl.response.windows import Windows

TS = 0.2e-3
N = 1000


def test_a_multisine_has_odd_lines_of_one_size_within_its_band_and_no_high_peak():
    waves = multisine(2000, TS, (10.0, 500.0), 1.5)
    size = np.abs(np.fft.rfft(waves.volts)) / 1000.0
    assert np.abs(waves.volts).max() == pytest.approx(1.5)
    assert np.all(waves.lines % 2 == 1)
    assert np.ptp(size[waves.lines]) < 1e-12
    others = np.setdiff1d(np.arange(len(size)), waves.lines)
    assert size[others].max() < 1e-12
    hz = waves.lines / (2000 * TS)
    assert hz[0] >= 10.0
    assert hz[-1] <= 500.0
    assert np.abs(waves.volts).max() < 2.0 * waves.volts.std()
    # One odd harmonic in four is left out, none of those at the begin.
    assert len(waves.left_out) == (len(waves.lines) + len(waves.left_out)) // 4
    assert waves.lines[0] < waves.left_out[0]


def looped(noise_m: float, windows: int = 60, seed: int = 1, square: float = 0.0):
    """Return windows of a loop on paper: e = P u + noise, u = r - C e, at every harmonic."""
    rng = np.random.default_rng(seed)
    waves = multisine(N, TS, (20.0, 1000.0), 1.0)
    hz = np.arange(1, N // 2 + 1) / (N * TS)
    plant = plant_response(hz[:-1], TS, mass=0.2, viscous=0.2, lag_s=0.4e-3)
    law = 95.0 * (250.0 + 2j * np.pi * hz[:-1])
    rows: dict[str, list[np.ndarray]] = {"r": [], "u": [], "e": []}
    for _ in range(windows):
        r = np.roll(waves.volts, rng.integers(N))
        seen = np.fft.rfft(r + square * r**3)[1:-1]
        noise = np.fft.rfft(noise_m * rng.normal(size=N))[1:-1]
        sensitivity = 1.0 / (1.0 + plant * law)
        e = sensitivity * (plant * seen + noise)
        u = np.fft.rfft(r)[1:-1] - law * e
        for key, values in (("u", u), ("e", e)):
            whole = np.zeros(N // 2 + 1, complex)
            whole[1:-1] = values
            rows[key].append(np.fft.irfft(whole, N))
        rows["r"].append(r)
    r, u, e = (np.array(rows[key]) for key in "rue")
    return Windows(TS, N, r, u, e, 0.05), plant, sensitivity, hz[:-1]


def at_lines(response: Response, hz: np.ndarray, values: np.ndarray) -> np.ndarray:
    return values[np.searchsorted(hz, response.frequency_hz - 1e-6)]


def test_without_noise_plant_and_sensitivity_are_exact():
    windows, plant, sensitivity, hz = looped(0.0)
    response = estimate_response(windows, "x", "log")
    assert np.allclose(response.plant, at_lines(response, hz, plant), rtol=1e-9)
    assert np.allclose(response.sensitivity, at_lines(response, hz, sensitivity), rtol=1e-9)
    assert np.all(response.coherence > 1.0 - 1e-9)
    assert response.not_linear_v.max() < 1e-9


def test_noise_that_the_feedback_passes_on_biases_nothing_and_is_told():
    """The ratio of the spectra of position and command would tend to -1/C where noise is loud."""
    windows, plant, _, hz = looped(2e-6, windows=2000)
    response = estimate_response(windows, "x", "log")
    true = at_lines(response, hz, plant)
    loud = response.coherence < 0.5
    assert np.count_nonzero(loud) > 20
    off = np.abs(response.plant / true - 1.0)
    assert np.sqrt(np.mean((off / (np.sqrt(2.0) * response.plant_error))[loud] ** 2)) < 1.5
    assert off[loud].mean() < 0.2


def test_coherence_falls_with_noise():
    seen = [estimate_response(looped(noise)[0], "x", "log") for noise in (1e-8, 1e-7, 1e-6)]
    medians = [float(np.median(response.coherence)) for response in seen]
    assert medians[0] > 0.99
    assert medians[0] > medians[1] > medians[2]


def test_what_is_not_linear_comes_back_at_the_lines_that_were_left_out():
    plain = estimate_response(looped(1e-9)[0], "x", "log")
    bent = estimate_response(looped(1e-9, square=0.1)[0], "x", "log")
    share = np.median(bent.not_linear_v) / bent.line_v
    assert share > 0.01
    assert share > 100.0 * np.median(plain.not_linear_v) / plain.line_v
    # Windows agree with each other there: only these lines tell.
    assert np.median(bent.plant_error) > 0.3 * share / np.sqrt(2.0)


def test_no_coherence_is_refused_with_what_would_help():
    response = estimate_response(looped(1e-4)[0], "x", "log")
    with pytest.raises(DataError, match=r"from 25 to 995 Hz .* raise it as far as the machine"):
        require_coherence(response, 2.0, 1.0)
    with pytest.raises(DataError, match=r"--amplitude [\d.e+]+ would do for half of them \(limit"):
        require_coherence(response, 1e6, 1.0)


def test_margins_from_line_to_line_are_those_of_the_formula():
    gains = {"k1_1_s": 250.0, "ks_v_s_m": 95.0, "gamma_d": 500.0}
    axis = load("published_gantry").axes["x"]
    hz = np.linspace(5.0, 1200.0, 800)
    told = measured_margins(hz, model_response(axis, TS, hz).loop)
    exact = loop_margins(0.19, 0.25, **gains, period_s=TS)
    assert told.phase_margin_deg == pytest.approx(exact.phase_margin_deg, abs=0.1)
    assert told.crossover_hz == pytest.approx(exact.crossover_rad_s / (2 * np.pi), rel=1e-3)


def test_a_loop_that_never_crosses_has_no_margin():
    hz = np.linspace(10.0, 100.0, 20)
    told = measured_margins(hz, np.full(20, 0.1 + 0.0j))
    assert (told.crossover_hz, told.phase_margin_deg, told.gain_margin) == (None, None, None)


def on_paper(parts=(), error=0.002):
    """Return a response as it would be measured of a plant on paper."""
    hz = np.arange(15.0, 600.0, 5.0)
    rng = np.random.default_rng(4)
    noise = 1.0 + error * (rng.normal(size=len(hz)) + 1j * rng.normal(size=len(hz)))
    plant = plant_response(hz, TS, mass=0.3, viscous=0.4, delay_s=150e-6, lag_s=0.3e-3, parts=parts)
    ones = np.ones(len(hz))
    return Response(
        "x", "paper", TS, hz, plant * noise, 0.5 + 0j * hz, error * ones, error * ones, ones,
        np.zeros(0), np.zeros(0), 0.1, 50, 0.05,
    )  # fmt: skip


def test_a_rigid_plant_is_read_with_its_delay_and_lag_apart():
    plant = fit_plant(on_paper())
    assert plant.theta1 == pytest.approx(0.3, rel=0.005)
    assert plant.delay_s == pytest.approx(150e-6, abs=5e-6)
    assert plant.lag_s == pytest.approx(0.3e-3, abs=10e-6)
    assert plant.parts == ()
    assert plant.error_db < 0.05


@pytest.mark.parametrize(("hz", "zeta", "share"), [(60.0, 0.02, 0.3), (250.0, 0.01, 0.05)])
def test_a_part_that_rings_is_named_with_frequency_damping_and_mass(hz, zeta, share):
    (part,) = fit_plant(on_paper(parts=((share * 0.3, hz, zeta),))).parts
    assert part.effect.lines[0] == pytest.approx(hz, rel=0.003)
    assert part.effect.picture.damping_ratio == pytest.approx(zeta, rel=0.1)
    assert part.share == pytest.approx(share, rel=0.05)
    assert part.resonance_hz == pytest.approx(hz / np.sqrt(1.0 - share), rel=0.01)
    assert f"{part.share:.1%} of the mass" in part.words


def test_what_the_fit_says_is_what_the_plant_on_paper_answers():
    parts = ((0.06, 120.0, 0.02), (0.03, 300.0, 0.02))
    response = on_paper(parts=parts)
    fitted = fit_plant(response).response(response.frequency_hz, TS)
    true = plant_response(
        response.frequency_hz, TS, mass=0.3, viscous=0.4, delay_s=150e-6, lag_s=0.3e-3, parts=parts
    )
    db, degrees = apart(fitted, true)
    assert np.abs(db).max() < 0.3
    assert np.abs(degrees).max() < 2.0


def test_a_declared_part_on_a_spring_shows_in_the_models_own_response(tmp_path):
    text = locate("published_gantry").read_text(encoding="utf-8")
    at = text.index("      em_quadratic: {initial: -0.005")
    mode = (
        "      flexible_mode: {frequency_hz: 120, damping_ratio: 0.02, parameters: {inertia: "
        "{initial: 0.03, bounds: [0, 0.1]}}}\n"
    )
    path = tmp_path / "mode.yaml"
    path.write_text(text[:at] + mode + text[at:], encoding="utf-8")
    axis = load(path).axes["x"]
    hz = np.array([20.0, 110.0, 120.0, 130.0, 300.0])
    told = model_response(axis, TS, hz).plant
    true = plant_response(hz, TS, mass=0.19, viscous=0.25, parts=((0.03, 120.0, 0.02),))
    db, degrees = apart(told, true)
    assert np.abs(db).max() < 0.2
    assert np.abs(degrees).max() < 2.0


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_plan_moves_faster_than_it_shakes_and_stays_within_travel_and_limits(axis):
    machine = load("published_gantry")
    told = machine.axes[axis]
    plan = plan_response(told, machine.period_of(axis))
    low, high = told.limits.travel_m
    assert np.abs(plan.excitation.volts).max() <= told.limits.max_excitation_v / 2 + 1e-9
    assert plan.motion is not None
    ends = {plan.motion.start_m, *(move.target_m for move in plan.motion.moves)}
    assert min(ends) > low
    assert max(ends) < high
    peaks = plan.motion.trajectories()[axis].peaks()
    assert peaks.max_velocity_m_s == pytest.approx(plan.speed_m_s)
    assert plan.motion.trajectories()[axis].duration_s > plan.duration_s
    assert plan.speed_m_s <= 0.2 * told.limits.max_velocity_m_s


@pytest.mark.parametrize(
    ("was", "is_now", "told"),
    [
        ("resolution_m: 0.5e-6", "resolution_m: 1e-6", "axes.x.encoder.resolution_m: 5e-07, here"),
        ("name: published-gantry", "name: mill", "name: published-gantry, here mill"),
        ("max_voltage_v: 10", "max_voltage_v: 9", None),
    ],
)
def test_a_response_of_another_machine_is_not_taken(
    tmp_path: Path, was: str, is_now: str, told: str | None
) -> None:
    text = locate("published_gantry").read_text()
    assert was in text
    (tmp_path / "other.yaml").write_text(text.replace(was, is_now))
    other, source = load(tmp_path / "other.yaml"), SimpleNamespace(source="response_x.parquet")
    measured: Any = SimpleNamespace(machine=load("published_gantry"), response=source)
    if told is None:
        require_same_plant(measured, other, "x")
        return
    with pytest.raises(DataError, match=r"response_x\.parquet is not a response of") as caught:
        require_same_plant(measured, other, "x")
    assert told in str(caught.value)
