"""A rigid leg that swings freely behind a coarse encoder: a weight, and no spring."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant
from scipy import signal

from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.held_out_blocks import make_blocks
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.other_direction import worse_in_other_direction
from motorctl.identify.diagnose.search.parameters import theta_of, values_of
from motorctl.identify.diagnose.search.physics import beyond_physics
from motorctl.model import effect_class, make_effect

RATE_HZ = 200.0
DURATION_S = 60.0
SUBSTEPS = 20
INERTIA, VISCOUS, DRY, WEIGHT = 0.21, 0.13, 0.2, 17.6
"""Of a leg [V s^2/rad], [V s/rad], [V], [V]."""
COUNT_RAD = np.deg2rad(0.088)
LIMIT_V = 5.0


@cache
def leg(count_rad: float = COUNT_RAD) -> Measured:
    """Return a leg that its motor alone could turn by 16 degrees, pumped up by it to 60 or more."""
    rows = round(DURATION_S * RATE_HZ)
    time_s = np.arange(rows) / RATE_HZ
    pumped = 4.0 * np.sign(np.sin(2.0 * np.pi * 1.3 * time_s + 2.0 * np.sin(0.4 * time_s)))
    swept = signal.chirp(time_s, 0.2, DURATION_S, 12.0)
    command = np.clip(pumped + swept, -LIMIT_V, LIMIT_V)
    angle, speed, step_s = 0.0, 0.0, 1.0 / (RATE_HZ * SUBSTEPS)
    angles = np.zeros(rows)
    for row in range(rows):
        angles[row] = angle
        for _ in range(SUBSTEPS):
            force = command[row] - VISCOUS * speed - DRY * np.tanh(speed / 0.05)
            speed += step_s * (force - WEIGHT * np.sin(angle)) / INERTIA
            angle += step_s * speed
    return Measured(
        source="leg.csv", axis="x", sample_rate_hz=RATE_HZ, time_s=time_s,
        position=np.round(angles / count_rad) * count_rad, command=command,
        usable=np.ones(rows, dtype=np.bool_), position_unit="rad", command_unit="V",
        resolution=count_rad,
    )  # fmt: skip


def model(data: Measured, *effects) -> Hypothesis:
    signals = make_signals(data, slope_s_m=900.0)
    blocks = make_blocks(signals.rows, signals.row_period_s)
    return Hypothesis(Regressors(signals, C1, blocks, "command"), effects).refreshed()


def mode(frequency_hz: float, damping_ratio: float):
    return make_effect(
        effect_class("flexible_mode"),
        {"frequency_hz": frequency_hz, "damping_ratio": damping_ratio},
    )


WEIGHED = make_effect(effect_class("gravity"))


def test_a_weight_may_be_many_times_the_command_of_what_swings():
    fine = leg(0.01 * COUNT_RAD)
    assert np.max(np.abs(fine.position)) > 1.0
    weighed = model(fine, WEIGHED)
    values = values_of(weighed)
    weight = next(e for e in values.model.effects if e.name == "gravity")
    sine, _ = theta_of(values, weight)[0]
    assert sine == pytest.approx(WEIGHT, rel=0.05)
    assert beyond_physics(weighed) is None


def test_a_filter_of_the_encoders_noise_is_no_spring():
    swings = model(leg(), WEIGHED, mode(6.3, 0.35))
    assert swings.held_out < 0.8 * swings.without("flexible_mode").refreshed().held_out
    refuted = worse_in_other_direction(swings)
    assert refuted is not None
    assert "times the square that a rigid machine leaves" in refuted[1]


@pytest.mark.parametrize(
    ("damping_ratio", "shaken", "bandwidth_hz"),
    [
        (0.05, 0.0, 5.0), (0.01, 0.0, 5.0), (0.01, 0.3, 5.0), (0.02, 0.1, 5.0),
        # so much that any model tells the acceleration worse: the encoder is fine all the same
        (0.05, 0.3, 15.0), (0.01, 1.0, 15.0), (0.05, 2.0, 15.0),
    ],
)  # fmt: skip
def test_a_load_on_a_spring_filters_no_noise_however_it_is_shaken(
    damping_ratio, shaken, bandwidth_hz
):
    plant = OtherPlant(
        load=0.4, load_hz=15.0, load_damping=damping_ratio, bandwidth_hz=bandwidth_hz,
        command_noise=shaken,
    )  # fmt: skip
    sprung = plant.run(seed=5, duration_s=8.0)
    assert worse_in_other_direction(model(sprung, mode(15.0, damping_ratio))) is None


@pytest.mark.slow
def test_a_leg_that_swings_is_a_weight_and_nothing_else():
    found = diagnose_axis(leg(), C1)
    assert [effect.name for effect in found.effects] == ["gravity"], found.sentence
