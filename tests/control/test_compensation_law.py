"""The law with effects that the published one lacks: theory, learning, coordinates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from law_stepper import Stepper, known

from motorctl.control import invert, monotonicity_half_planes
from motorctl.errors import UsageError
from motorctl.model import EffectList

TS = 0.2e-3
NO_MEMORY = np.zeros(0)
LAG_S, DELAY_S = 0.7e-3, 0.27e-3
NO_TIME_S = 1e-12
TRUTH = {
    "inertia": 0.197,
    "viscous_friction": 0.2265,
    "coulomb_friction": 0.139,
    "offset": 0.05,
    "em_quadratic": -0.0122,
    "em_cubic": -0.00104,
    "presliding_force": 0.0,
    "presliding_micro_damping": 0.0,
    "cross_axis_acceleration_y": 0.05,
    "cross_axis_velocity_y": 0.3,
    "position_force": 2.0,
    "force_ripple_sin_1": 0.06,
    "force_ripple_cos_1": -0.03,
}
PITCH_M = 0.06


def model_of(lag_s: float, delay_s: float) -> EffectList:
    return EffectList(
        [
            *map(known, ("inertia", "viscous_friction", "coulomb_friction", "offset")),
            *map(known, ("em_quadratic", "em_cubic")),
            known("presliding", displacement_m=20e-6),
            known("cross_axis", axes=["y"]),
            known("position_force"),
            known("force_ripple", pitch_m=PITCH_M),
            known("input_lag", time_s=lag_s),
            known("input_delay", time_s=delay_s),
        ]
    )


def stepper(lag_s: float = LAG_S, delay_s: float = DELAY_S, **settings: Any) -> Stepper:
    model = model_of(lag_s, delay_s)
    theta = np.zeros(len(model))
    theta[0] = 0.25
    lower = np.array([0.05, 0, 0, -1, -0.02, -0.002, 0, -1, -1, -2, -9, -0.1, -0.1])
    upper = np.array([0.5, 1, 0.5, 1, 0, 0, 0.3, 1, 1, 2, 9, 0.1, 0.1])
    return Stepper(model, theta, lower, upper, **settings)


def sines(t: float, amplitudes: tuple[float, ...], hertz: tuple[float, ...]) -> np.ndarray:
    """Motion (x, v, a) that begins at rest; amplitudes are of the acceleration."""
    motion = np.zeros(3)
    for a, f in zip(amplitudes, hertz, strict=True):
        w = 2.0 * math.pi * f
        swing = (w * t - math.sin(w * t)) / w**2, (1 - math.cos(w * t)) / w, math.sin(w * t)
        # Less its drift, so that it stays near; the drift begins with the motion.
        motion += a * np.array([swing[0] - t / w, swing[1] - 1 / w, swing[2]])
    return motion


def own_motion(t: float) -> np.ndarray:
    return sines(t, (10.0, 15.0, 13.0), (1.3, 3.7, 8.3))


def other_motion(t: float) -> np.ndarray:
    return sines(t, (3.0, 4.0), (1.7, 5.9))


def learn(law: Stepper, ticks: int) -> np.ndarray:
    """Close the loop around the true plant, with lag and delay; gives theta afterwards."""
    substeps = 10
    h = TS / substeps
    waiting = [0.0] * (1 + math.floor(DELAY_S / h))
    part = DELAY_S / h - math.floor(DELAY_S / h)
    decay = math.exp(-h / LAG_S)
    x, v = own_motion(0.0)[:2]
    current, old = 0.0, 0.0
    for k in range(ticks):
        t = k * TS
        motion, ahead = own_motion(t), t + law.settings["act_delay_s"][0]
        law.state["others"][0] = other_motion(t)
        law.state["others_far"][0] = other_motion(ahead + TS)
        y = 0.1e-6 * round(x / 0.1e-6)
        if k == 0:
            law.start(t, y)
        u = law.step(t, y, motion, own_motion(ahead), own_motion(ahead + TS))
        for j in range(substeps):
            waiting.append(u)
            newer = waiting.pop(0)
            acts, old = newer + part * (old - newer), newer
            current = acts + (current - acts) * decay
            angle = 2.0 * math.pi * x / PITCH_M
            i = current
            thrust = i - 0.0122 * i * abs(i) - 0.00104 * i**3
            thrust += i * (0.06 * math.sin(angle) - 0.03 * math.cos(angle))
            other = other_motion(t + (j + 0.5) * h)
            force = thrust - 0.2265 * v - 0.139 * 2.0 / math.pi * math.atan(900.0 * v) + 0.05
            force -= 0.05 * other[2] + 0.3 * other[1] + 2.0 * x
            a = force / 0.197
            x, v = x + h * (v + 0.5 * h * a), v + h * a
    theta: np.ndarray = law.record["theta"]
    return theta


@pytest.mark.slow
def test_with_the_timing_declared_the_adaptation_finds_every_parameter() -> None:
    truth = np.array(list(TRUTH.values()))
    aligned, late = learn(stepper(), 15000), learn(stepper(NO_TIME_S, NO_TIME_S), 15000)
    # Presliding is not excited by fast motion.
    found = [0, 1, 2, 3, 8, 9, 10, 11, 12]
    assert aligned[found] == pytest.approx(truth[found], rel=0.05)
    assert aligned[0] == pytest.approx(truth[0], rel=1e-3)
    off, off_late = abs(aligned - truth), abs(late - truth)
    assert (off_late[[0, 1, 2]] > 5.0 * off[[0, 1, 2]]).all()
    u = np.linspace(1.0, 8.0, 20)
    mapped = u + aligned[4] * u**2 + aligned[5] * u**3
    assert mapped == pytest.approx(u + truth[4] * u**2 + truth[5] * u**3, rel=0.01)


@pytest.mark.slow
def test_the_first_virtual_command_at_rest_is_zero_wherever_it_starts() -> None:
    law = stepper()
    law.record["theta"][10] = 2.0
    law.record["theta"][3] = 0.1
    law.start(0.0, 0.3)
    rest = (0.3, 0.0, 0.0)
    assert law.step(0.0, 0.3, rest, rest, rest) == pytest.approx(0.0, abs=1e-12)
    assert law.record["d0"] == pytest.approx(2.0 * 0.3 - 0.1)


@pytest.mark.slow
def test_new_coordinates_change_no_command() -> None:
    law = stepper(enabled=False)
    law.record["theta"][10] = 2.0
    law.start(0.0, 0.1)
    rest = (0.1, 0.0, 0.0)
    before = [law.step(k * TS, 0.1 + 1e-6, rest, rest, rest) for k in range(3)]
    law.shift(3 * TS, 0.1 + 1e-6, 0.15)
    there = (0.25, 0.0, 0.0)
    after = law.step(3 * TS, 0.25 + 1e-6, there, there, there)
    # d0 goes on as before; nothing else has changed.
    assert after - before[2] == pytest.approx(before[2] - before[1], abs=1e-9)
    assert before[2] != pytest.approx(before[1], abs=1e-6)


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
    st.floats(0.0, 0.07),
    st.floats(-9.0, 9.0),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
)
def test_a_map_that_varies_is_inverted_where_the_axis_is(
    sine: float, cosine: float, depth: float, u: float, x: float, vs: float
) -> None:
    kernels = VARYING.kernels
    theta = np.array([-0.005, -0.0005, sine, cosine, depth, 0.05, 0.1])
    v = kernels.input_map(u, x, vs, 30.0, NO_MEMORY, theta)
    found = invert(kernels.input_map, kernels.input_slope, v, x, vs, 30.0, NO_MEMORY, theta, 10.0)
    assert found == pytest.approx(u, abs=1e-9)


VARYING = EffectList(
    [
        known("em_quadratic"),
        known("em_cubic"),
        known("force_ripple", pitch_m=PITCH_M),
        known("dead_zone", half_width_v=0.09),
        known("gain_drift", time_constant_s=20.0),
        known("load_friction", slope_s_m=300.0),
    ]
)
LOW = np.array([-0.05, -0.005, -0.1, -0.1, 0.0, -0.05, 0.0])
HIGH = np.array([0.05, 0.005, 0.1, 0.1, 0.06, 0.05, 0.1])


@pytest.mark.slow
@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_no_admitted_estimate_folds_the_map_at_any_place_speed_or_time(seed: int) -> None:
    normals, offsets = monotonicity_half_planes(VARYING, LOW, HIGH, 10.0, 0.05, (0.0, 0.4))
    rng = np.random.default_rng(seed)
    theta = rng.uniform(LOW, HIGH, (400, len(LOW)))
    admitted = theta[(theta @ normals.T >= offsets).all(axis=1)]
    assert len(admitted)
    slope = VARYING.kernels.input_slope
    # At the ends of the range the electromagnetic parts are steepest.
    for one in admitted[:40]:
        x, vs, t = rng.uniform(0.0, 0.4), rng.uniform(-1.0, 1.0), 10.0 ** rng.uniform(-1.0, 4.0)
        assert (
            min(slope(u, x, vs, t, NO_MEMORY, one) for u in (-10.0, -9.0, -1e-3, 1e-3, 9.0, 10.0))
            > 0.045
        )


@pytest.mark.slow
def test_bounds_that_leave_the_others_no_room_are_refused() -> None:
    wide = np.array([0.05, 0.005, 1.0, 1.0, 0.06, 0.05, 0.1])
    with pytest.raises(UsageError, match="narrow the bounds of the parameters that vary"):
        monotonicity_half_planes(VARYING, -wide, wide, 10.0, 0.05, (0.0, 0.4))
