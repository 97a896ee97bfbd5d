"""Lag, delay and encoder error: what has no estimates is compensated in time and in place."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from compensation_bench import Tracking, machine, track
from loop_bench import Rig

from motorctl.log.sample import AxisState
from motorctl.loop import Verb
from motorctl.motion import point_to_point

COUNTING_UM = 0.5 / np.sqrt(12.0)
LAG = {"input_lag": {"time_s": 0.8e-3}}


@cache
def oracle() -> Tracking:
    """The machine whose command acts after the delay that every machine here has."""
    return track(machine({}, {}))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("timing", "worse"),
    [
        pytest.param(LAG, 12.0, marks=pytest.mark.long),
        ({"input_delay": {"time_s": 0.5e-3}}, 7.0),
        ({"input_lag": {"time_s": 0.4e-3}, "input_delay": {"time_s": 0.37e-3}}, 12.0),
    ],
    ids=["lag", "delay", "both"],
)
def test_a_declared_lag_or_delay_is_as_good_as_none(timing: dict[str, Any], worse: float) -> None:
    undeclared = track(machine(timing, {}))
    declared = track(machine(timing, {}, timing))
    assert declared.rms_um < 1.3 * max(oracle().rms_um, COUNTING_UM)
    assert undeclared.rms_um > worse * COUNTING_UM
    # The lead costs no more than what the amplifier has to do.
    assert declared.largest_step_v < 1.5 * oracle().largest_step_v


@pytest.mark.slow
def test_the_position_that_is_controlled_and_logged_is_free_of_the_encoders_error() -> None:
    rows = oracle().rows
    moving = np.abs(rows["reference_velocity_m_s"]) > 0.01
    true_m = (oracle().error_m + rows["reference_m"])[moving]
    off_m = rows["position_m"][moving] - true_m
    error_m = 0.3e-6 * np.sin(2.0 * np.pi * true_m / 17e-6)
    assert np.std(error_m) > 0.2e-6
    assert np.std(off_m) < 1.2e-6 * COUNTING_UM
    assert abs(np.corrcoef(off_m, error_m)[0, 1]) < 0.1
    assert np.array_equal(rows["following_error_m"], rows["position_m"] - rows["reference_m"])


@pytest.mark.slow
def test_the_preview_makes_no_bumps_however_motion_begins_and_ends() -> None:
    """Start, program, its end, a program cut off on the way, and a start after it."""
    jerk, inertia = 2500.0, 0.197
    with Rig(machine(LAG, {}, LAG)) as rig:
        rng = np.random.default_rng(5)
        for number in range(6):
            rig.start()
            here = float(rig.state("x")["reference_m"])
            there = rng.uniform(0.05, 0.1) if here < 0.05 else rng.uniform(0.0, 0.05)
            move = point_to_point(here, there, 0.5, 15.0, jerk)
            rig.follow({"x": move})
            cut = number % 2 == 0
            rig.seconds(rng.uniform(0.2, 0.8) * move.duration_s if cut else move.duration_s + 0.02)
            assert rig.state_of("x") is (AxisState.RUNNING if cut else AxisState.IDLE)
            for axis in ("x", "y"):
                rig.ask(Verb.STOP, axis)
            rig.wait_until(lambda: rig.state_of("x") is AxisState.OFF, 2.0)
            rig.seconds(0.2)
        rows = rig.rows("x")
    powered = np.isin(rows["state"], [AxisState.IDLE, AxisState.RUNNING, AxisState.STOPPING])
    # Into OFF the command falls to zero; while powered it changes by no more than twice what the
    # jerk asks for through lag and delay: a stop may turn it round.
    steps = np.abs(np.diff(rows["command_v"]))[powered[1:] & powered[:-1]]
    assert steps.max() < 2.0 * inertia * jerk * (LAG["input_lag"]["time_s"] + 0.3e-3)
    assert np.abs(rows["following_error_m"][powered]).max() < 2e-6
