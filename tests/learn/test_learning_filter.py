"""What is learned shrinks what repeats, for every plant that may be, and learns no noise."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.config.analysis import LoopGains
from motorctl.errors import RunError
from motorctl.learn.cycles import Repetition
from motorctl.learn.robust_filter import (
    SHRINKS_TO,
    LearningFilter,
    learning_filter,
    process_sensitivity,
)
from motorctl.learn.update import next_voltage
from motorctl.response.measurement import Measurement
from motorctl.tune.recorded_loop import PlantEstimate, RecordedLoop

PERIOD_S = 0.2e-3
CYCLE_S, POINTS = 0.5, 2500
FREQUENCY_HZ = np.arange(1, POINTS // 2 + 1) / CYCLE_S
BOUNDS = (0.14, 0.26)
GAINS = LoopGains(250.0, 95.0, 500.0)


def loop(**changes: object) -> RecordedLoop:
    plant = PlantEstimate(
        theta1=0.19, theta2=0.25, theta1_bounds=BOUNDS, theta2_bounds=(0.15, 0.35),
        delay_s=2e-4, lag_s=0.0, delay_open_s=4e-5,
    )  # fmt: skip
    return RecordedLoop(
        axis="x", source="here", period_s=PERIOD_S, gains=GAINS, d_hat_max_v=1.0,
        max_voltage_v=10.0, error=np.zeros(4), d0_hat=np.zeros(4), ahead=np.zeros(4),
        goes_round=True, counted=2, plant=dataclasses.replace(plant, **changes), noise_rms_m=1e-7,
    )  # fmt: skip


def filters(**changes: object) -> LearningFilter:
    return learning_filter(loop(**changes), CYCLE_S, POINTS)


def acts(theta1: float, theta2: float, delay_s: float, slope: float = 1.0) -> np.ndarray:
    """Return what a voltage does to the error of a true axis, at the harmonics."""
    known = loop()
    plant = known.plant.at(theta1, theta2, PERIOD_S, delay_s).response(2 * np.pi * FREQUENCY_HZ)
    return slope * process_sensitivity(plant, GAINS, FREQUENCY_HZ, PERIOD_S)


MADE = filters()


@settings(max_examples=60)
@given(
    st.floats(*BOUNDS), st.floats(0.15, 0.35), st.floats(1.2e-4, 2e-4), st.floats(0.2, 1.0)
)  # fmt: skip
def test_every_plant_within_the_bounds_has_less_error_after_each_repetition(
    theta1: float, theta2: float, delay_s: float, slope: float
) -> None:
    true = acts(theta1, theta2, delay_s, slope)
    left = MADE.robust[1:] * np.abs(1.0 - MADE.inverse[1:] * true)
    assert left.max() < 1.0
    if slope == 1.0:
        assert left.max() <= SHRINKS_TO + 0.02  # between corners of the bounds, too


@pytest.mark.parametrize("wrong", [0.8, 1.0, 1.2])
def test_a_repeated_disturbance_is_gone_after_six_repetitions_with_an_inertia_20_percent_off(
    wrong: float,
) -> None:
    made = filters(theta1=0.19 * wrong)
    true = acts(0.19, 0.25, 1.8e-4)
    place = np.arange(POINTS) / POINTS
    volts = 0.3 * np.sin(2 * np.pi * 3 * place) + 0.1 * np.sign(np.sin(2 * np.pi * place))
    disturbance = np.fft.rfft(volts)
    learned, sizes = np.zeros(POINTS), []
    for _ in range(7):
        lines = np.zeros(POINTS // 2 + 1, complex)
        lines[1:] = true * (disturbance[1:] + np.fft.rfft(learned)[1:])
        error = np.fft.irfft(lines, POINTS)
        sizes.append(float(np.sqrt(np.mean(error**2))))
        cycles = np.tile(error, (3, 1))
        learned = next_voltage(repetition(cycles, learned), made, limit_v=1.0)
    assert sizes[-1] < 0.05 * sizes[0], sizes
    assert sizes[2] < sizes[1] < sizes[0]


def repetition(error: np.ndarray, learned: np.ndarray) -> Repetition:
    return Repetition("x", "here", CYCLE_S, error, learned, np.zeros(POINTS))


def test_of_an_error_that_does_not_repeat_next_to_nothing_is_learned() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-6, (8, POINTS))
    volts = next_voltage(repetition(noise, np.zeros(POINTS)), MADE, limit_v=1.0)
    back = np.fft.irfft(np.fft.rfft(volts)[1:] * acts(0.19, 0.25, 1.8e-4), POINTS)
    averaged = 1e-6 / np.sqrt(8)
    assert np.sqrt(np.mean(back**2)) < 0.1 * averaged


def test_it_never_asks_for_more_than_its_limit() -> None:
    error = np.tile(1e-3 * np.sin(2 * np.pi * np.arange(POINTS) / POINTS), (3, 1))
    volts = next_voltage(repetition(error, np.zeros(POINTS)), MADE, limit_v=0.25)
    assert np.abs(volts).max() == 0.25


def test_what_is_not_known_holds_the_corner_down_until_nothing_is_learned() -> None:
    vague = filters(delay_s=1.7e-3, delay_open_s=0.8e-3)
    assert vague.corner_hz < 0.9 * MADE.corner_hz
    assert vague.bound_by == "how well the plant is known"
    assert vague.shrinks_at_worst.max() <= SHRINKS_TO
    with pytest.raises(RunError, match=r"nothing can be learned for sure: at .* Hz .*refine"):
        learning_filter(loop(), CYCLE_S, POINTS, measured(np.full(len(LINES_HZ), 40.0)))


LINES_HZ = np.geomspace(3.0, 400.0, 60)


def measured(error: np.ndarray) -> Measurement:
    """Return the response of a mass as it is known, with these relative errors of its lines."""

    def plant(hz: np.ndarray, period_s: float = PERIOD_S) -> np.ndarray:
        return loop().plant.at(0.19, 0.25, period_s, 1.6e-4).response(2 * np.pi * hz)

    response = SimpleNamespace(
        frequency_hz=LINES_HZ,
        plant=plant(LINES_HZ),
        plant_error=error,
        coherent=np.ones(len(LINES_HZ), bool),
    )
    return SimpleNamespace(response=response, fitted=SimpleNamespace(response=plant))  # type: ignore[return-value]


def test_a_measured_response_lets_it_learn_higher_up_to_where_it_is_known() -> None:
    sure = learning_filter(loop(), CYCLE_S, POINTS, measured(np.full(len(LINES_HZ), 0.02)))
    assert sure.corner_hz == pytest.approx(200.0)
    assert sure.bound_by == "the band of the measured response"
    vague = np.where(LINES_HZ > 60.0, 1.5, 0.02)
    held = learning_filter(loop(), CYCLE_S, POINTS, measured(vague))
    assert 10.0 < held.corner_hz < 0.7 * sure.corner_hz
    assert held.bound_by == "how well the plant is known"
    assert held.shrinks_at_worst.max() <= SHRINKS_TO
