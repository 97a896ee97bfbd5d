"""A measured response is that of the simulated plant on paper: 0.5 dB and 3 degrees where coherent.

The plant on paper (`analytic_response`) is written from the equation of motion, with the plant's
own numbers; the thrust's slope is the mean over the commands that were given.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from analytic_response import apart, plant_response

from motorctl.config import Machine, load
from motorctl.config.analysis import Frequencies, LoopGains, loop_margins
from motorctl.config.shipped import locate
from motorctl.log import read_recording
from motorctl.response.measurement import Measurement, measure_response
from motorctl.response.plan import plan_response
from motorctl.response.rigs import record_simulated
from motorctl.response.windows import excited_windows

CLOSE_DB, CLOSE_DEG = 0.5, 3.0
X = {"mass": 0.197, "viscous": 0.2265, "delay_s": 92e-6, "lag_s": 0.39e-3}
Y = {"mass": 0.670, "viscous": 0.296, "delay_s": 100e-6, "lag_s": 0.39e-3}
THRUST = {"x": (-0.0122, -0.00104), "y": (-0.0168, -0.00058)}
FIRST = {"frequency_hz": 150.0, "damping_ratio": 0.03, "fraction": 0.15}
SECOND = {"contact_frequency_hz": 320.0, "damping_ratio": 0.02, "fraction": 0.1, "gap_m": 0.0}
PARTS = ((0.15 * 0.197, 150.0, 0.03), (0.1 * 0.197, 320.0, 0.02))


def two_modes(folder: Path) -> Machine:
    """Return the shipped gantry with two parts on springs on axis x."""
    text = locate("published_gantry").read_text(encoding="utf-8")
    plants = json.dumps({"flexible_mode": FIRST, "backlash": SECOND})
    before = "preset: published_gantry, seed: 1}"
    assert before in text
    path = folder / "two_modes.yaml"
    after = before[:-1] + f", plants: {{0: {plants}}}}}"
    path.write_text(text.replace(before, after), encoding="utf-8")
    return load(path)


@cache
def slope(log: Path, axis: str) -> float:
    """Return the thrust's mean slope over the commands of the windows."""
    u = excited_windows(read_recording(log, gaps="keep"), axis).command
    quadratic, cubic = THRUST[axis]
    return float(1.0 + 2.0 * quadratic * np.abs(u).mean() + 3.0 * cubic * (u**2).mean())


def measured(machine: Machine, axis: str, log: Path, **asked: Any) -> Measurement:
    plan = plan_response(machine.axes[axis], machine.period_of(axis), **asked)
    record_simulated(machine, plan, log, lambda what, share: None)
    return measure_response([log], axis)


def on_paper(measurement: Measurement, log: Path, plant: dict[str, float], parts: Any = ()) -> Any:
    response = measurement.response
    gain = slope(log, response.axis)
    return plant_response(response.frequency_hz, response.period_s, gain=gain, parts=parts, **plant)


def require_close(
    measurement: Measurement, log: Path, plant: dict[str, float], parts: Any = ()
) -> None:
    response = measurement.response
    good = response.coherence > 0.9
    db, degrees = apart(response.plant, on_paper(measurement, log, plant, parts))
    print(
        f"axis {response.axis}: {np.count_nonzero(good)} of {len(good)} lines coherent, worst "
        f"{np.abs(db[good]).max():.2f} dB, {np.abs(degrees[good]).max():.2f} degrees"
    )
    assert np.abs(db[good]).max() <= CLOSE_DB
    assert np.abs(degrees[good]).max() <= CLOSE_DEG


@pytest.fixture(scope="module")
def of_x(tmp_path_factory: pytest.TempPathFactory) -> tuple[Measurement, Path]:
    log = tmp_path_factory.mktemp("response") / "x.parquet"
    return measured(load("published_gantry"), "x", log, band_hz=(20.0, 400.0), periods=150), log


def test_the_shipped_axis_answers_as_its_plant_does_on_paper(of_x):
    measurement, log = of_x
    require_close(measurement, log, X)
    assert np.count_nonzero(measurement.response.coherent) > 20


def test_the_errors_that_are_told_are_those_that_are_made(of_x):
    measurement, log = of_x
    response = measurement.response
    noisy = response.plant_error > 0.005
    true = on_paper(measurement, log, X)
    off = np.abs(np.log(np.abs(response.plant / true)))[noisy] / response.plant_error[noisy]
    assert len(off) >= 5
    assert 0.4 < np.sqrt(np.mean(off**2)) < 2.0


def test_mass_delay_and_lag_are_read_from_it_and_nothing_rings(of_x):
    measurement, log = of_x
    plant = measurement.fitted
    assert plant.theta1 == pytest.approx(X["mass"] / slope(log, "x"), rel=0.01)
    assert plant.delay_s + plant.lag_s == pytest.approx(X["delay_s"] + X["lag_s"], rel=0.03)
    assert plant.parts == ()


def test_margins_are_those_of_the_plant_on_paper(of_x):
    measurement, log = of_x
    gains, gain = load("published_gantry").axes["x"].gains, slope(log, "x")
    true = loop_margins(
        X["mass"] / gain,
        X["viscous"] / gain,
        k1_1_s=gains.k1_1_s,
        ks_v_s_m=gains.ks_v_s_m,
        gamma_d=gains.gamma_d,
        period_s=measurement.response.period_s,
        delay_s=X["delay_s"],
        lag_s=X["lag_s"],
    )
    for told in (measurement.margins, measurement.fitted_margins):
        assert told.phase_margin_deg == pytest.approx(true.phase_margin_deg, abs=1.0)
        assert told.crossover_hz == pytest.approx(true.crossover_rad_s / (2.0 * np.pi), rel=0.01)


def test_loop_and_sensitivities_are_those_of_one_loop(of_x):
    response = of_x[0].response
    assert np.allclose(response.sensitivity + response.complementary, 1.0)
    assert np.allclose(response.loop * response.sensitivity, response.complementary)


def test_the_measured_loop_is_the_law_around_the_plant(of_x):
    """C = L/P: nobody has told the measurement the gains."""
    response, gains = of_x[0].response, load("published_gantry").axes["x"].gains
    at = Frequencies.at(2.0 * np.pi * response.frequency_hz, response.period_s)
    law = LoopGains(gains.k1_1_s, gains.ks_v_s_m, gains.gamma_d).feedback(at)
    good = response.coherent & (np.abs(response.sensitivity - 1.0) > 0.3)
    db, degrees = apart((response.loop / response.plant)[good], law[good])
    assert np.count_nonzero(good) > 10
    # The law inverts the thrust as it is at theta(0): its own slope is 0.3 dB above 1.
    assert np.abs(db).max() < 0.5
    assert np.abs(degrees).max() < 3.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "plant"), [pytest.param("x", X, marks=pytest.mark.long), ("y", Y)]
)
def test_the_published_plants_answer_as_they_do_on_paper(tmp_path, axis, plant):
    log = tmp_path / "log.parquet"
    require_close(measured(load("published_gantry"), axis, log), log, plant)


@pytest.mark.slow
def test_a_plant_with_two_modes_answers_as_it_does_on_paper_and_both_are_named(tmp_path):
    log = tmp_path / "log.parquet"
    measurement = measured(two_modes(tmp_path), "x", log)
    require_close(measurement, log, X, PARTS)
    found = measurement.fitted.parts
    assert [part.effect.name for part in found] == ["flexible_mode", "flexible_mode"]
    for part, (inertia, frequency_hz, zeta) in zip(found, PARTS, strict=True):
        assert part.effect.lines[0] == pytest.approx(frequency_hz, rel=0.01)
        assert part.effect.picture.damping_ratio == pytest.approx(zeta, rel=0.15)
        assert part.share == pytest.approx(inertia / 0.197, rel=0.1)
        assert part.resonance_hz > frequency_hz  # the axis rings with the carriage free


@pytest.mark.slow
def test_an_axis_that_stands_shows_friction_where_it_slides_it_shows_the_plant(tmp_path):
    log = tmp_path / "log.parquet"
    machine = load("published_gantry")
    still = measured(machine, "x", log, moving=False, amplitude_v=0.3, periods=100)
    response = still.response
    db, _ = apart(response.plant, on_paper(still, log, X))
    assert response.speed_m_s == 0.0
    assert "friction that sticks counts as a spring" in " ".join(still.notes)
    assert np.abs(db[response.coherent]).max() > 1.0
