"""A frame that shakes hides in a wide band that the command drives the axis: not in a narrower."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from scipy.integrate import solve_ivp

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose import recording
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.verdict.late_command import late_command
from motorctl.identify.diagnose.verdict.recording_mistakes import (
    UnexplainedMotionError,
    check_explains,
    explained_below,
)

RATE_HZ = 500.0
TIME_S = np.arange(5000) / RATE_HZ
INERTIA, WEIGHT, VISCOUS = 0.6, 30.0, 0.4


def chirp(time_s: np.ndarray) -> np.ndarray:
    """Return a torque that sweeps over the pendulum's own swing, 0.5 to 2 Hz in 10 s."""
    return 4.0 * np.sin(2.0 * np.pi * (0.5 * time_s + 0.075 * time_s**2))


def pendulum(shake_rad: float = 5e-4) -> Measured:
    """Return a pendulum around its lower rest, on a frame that shakes at 25 to 50 Hz."""

    def moves(time_s, state):
        angle, speed = state
        force = chirp(time_s) - WEIGHT * np.sin(angle) - VISCOUS * speed
        return speed, force / INERTIA

    run = solve_ivp(moves, (0.0, TIME_S[-1]), (0.0, 0.0), t_eval=TIME_S, rtol=1e-9, atol=1e-9)
    rng = np.random.default_rng(5)
    spectrum = np.fft.rfft(rng.standard_normal(len(TIME_S)))
    hz = np.fft.rfftfreq(len(TIME_S), 1.0 / RATE_HZ)
    spectrum[(hz < 25.0) | (hz > 50.0)] = 0.0
    shakes = np.fft.irfft(spectrum, len(TIME_S))
    position = run.y[0] + shake_rad * shakes / shakes.std()
    return Measured(
        source="pendulum.csv", axis="x", sample_rate_hz=RATE_HZ, time_s=TIME_S,
        position=position, command=chirp(TIME_S), usable=np.ones(len(TIME_S), np.bool_),
        position_unit="rad", command_unit="N*m",
    )  # fmt: skip


def refused(data: Measured) -> UnexplainedMotionError:
    with pytest.raises(UnexplainedMotionError, match="explains none") as caught:
        check_explains(data, make_signals(data), C1)
    return caught.value


def test_a_pendulum_on_a_frame_that_shakes_is_diagnosed():
    data = pendulum()
    refused(data)  # in the band of the shaking
    axis = diagnose_axis(data, C1)
    named = {effect.name for effect in axis.effects}
    assert named
    assert named <= {"gravity", "position_force"}


def test_a_reversed_sign_of_it_is_told():
    data = pendulum()
    data = replace(data, command=-data.command)
    with pytest.raises(DataError, match="the sign of one of the two is reversed"):
        explained_below(data, refused(data).plain, C1, 0.0)


@pytest.mark.parametrize("other", ["reversed in time", "of another sweep", "noise"])
def test_the_command_of_another_axis_is_refused_in_each_band(other):
    data = pendulum()
    command = {
        "reversed in time": data.command[::-1].copy(),
        "of another sweep": 4.0 * np.sin(2.0 * np.pi * (1.5 * TIME_S - 0.05 * TIME_S**2)),
        "noise": np.cumsum(np.random.default_rng(1).standard_normal(len(TIME_S))),
    }[other]
    data = replace(data, command=command)
    assert explained_below(data, refused(data).plain, C1, 0.0) is None


@pytest.mark.parametrize("resonance_hz", [1.1, 5.0])
def test_no_band_below_a_resonance_counts(resonance_hz):
    """A weight swings at 1.1 Hz; below a spring's resonance any machine moves as one."""
    below = explained_below(pendulum(), refused(pendulum()).plain, C1, resonance_hz)
    assert below is not None
    assert below.regressors.signals.band_hz >= 2.0 * resonance_hz
    assert explained_below(pendulum(), refused(pendulum()).plain, C1, resonance_hz=20.0) is None


def test_two_slow_motions_that_have_nothing_to_do_with_each_other_are_refused():
    rng = np.random.default_rng(0)
    hz = np.fft.rfftfreq(len(TIME_S), 1.0 / RATE_HZ)
    slow = np.fft.rfft(rng.standard_normal((16, len(TIME_S))))
    slow[:, hz > 0.3] = 0.0
    columns = np.fft.irfft(slow, len(TIME_S))
    columns /= columns.std(axis=1, keepdims=True)
    shakes = pendulum().position - pendulum(0.0).position
    unexplained = []
    for position, command in columns.reshape(8, 2, -1):
        data = replace(pendulum(), position=0.3 * position + 3.0 * shakes, command=command)
        try:
            check_explains(data, make_signals(data), C1)
        except UnexplainedMotionError as error:
            unexplained.append((data, error.plain))
        except DataError:  # told by something else
            continue
    assert unexplained
    assert [explained_below(data, plain, C1, 0.0) for data, plain in unexplained] == [
        None for _ in unexplained
    ]


def test_what_was_explained_in_a_narrow_band_is_searched_there(monkeypatch):
    bands = []

    def searched(signals, *rest):
        bands.append(signals.band_hz)
        raise DataError("enough")

    monkeypatch.setattr(recording, "searched", searched)
    data = pendulum()
    with pytest.raises(DataError, match="enough"):
        diagnose_axis(data, C1)
    below = explained_below(data, refused(data).plain, C1, 0.0)
    assert below is not None
    assert bands == [pytest.approx(below.regressors.signals.band_hz)]


@pytest.mark.parametrize("late_rows", [0, 5, 15])
def test_a_late_command_is_timed_in_the_band_of_the_motion(late_rows):
    data = shaken_cart()
    command = np.concatenate([np.full(late_rows, data.command[0]), data.command])
    data = replace(data, command=command[: len(TIME_S)])
    heard = check_explains(data, make_signals(data), C1)
    late = late_command(heard, 10.0)
    if not late_rows:
        assert late is None
    else:
        assert late is not None
        assert late.late_s == pytest.approx(late_rows / RATE_HZ, abs=1.5 / RATE_HZ)


def shaken_cart() -> Measured:
    """Return a cart with friction, moved by sines, whose frame shakes."""

    def force(time_s):
        return 3.0 * np.sin(2.0 * np.pi * 0.7 * time_s) + 2.0 * np.sin(2.0 * np.pi * 1.9 * time_s)

    def moves(time_s, state):
        friction = 1.0 * np.tanh(state[1] / 1e-3) + 2.0 * state[1]
        return state[1], (force(time_s) - friction) / 0.5

    run = solve_ivp(moves, (0.0, TIME_S[-1]), (0.0, 0.0), t_eval=TIME_S, max_step=2e-3)
    shakes = pendulum().position - pendulum(0.0).position
    return replace(
        pendulum(), position=run.y[0] + 0.02 * shakes, command=force(TIME_S), position_unit="m"
    )
