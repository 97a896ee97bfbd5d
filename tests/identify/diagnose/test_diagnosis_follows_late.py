"""An axis that follows a speed late: its command is a delay's, though inertia would look alike."""

from __future__ import annotations

import re
from math import tanh

import numpy as np
import pytest
from foreign_axes import sines

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.fit.declared_models import controller_list

pytestmark = pytest.mark.slow

RATE_HZ, STEPS = 200.0, 10
DELAY_S = 0.04
VISCOUS = 20.0


def followed(velocity: np.ndarray, follows_s: float, dry: float) -> Measured:
    """Return an axis whose drive takes the voltage for a speed, and takes it late."""
    command = VISCOUS * velocity + dry * np.tanh(velocity / 0.005)
    time_s = np.arange(len(command)) / RATE_HZ
    h = 1.0 / RATE_HZ / STEPS
    acting = np.interp(np.arange(len(command) * STEPS) * h - DELAY_S, time_s, command)
    x = v = 0.0
    positions = np.empty(len(acting))
    for k, u in enumerate(acting.tolist()):
        positions[k] = x
        v += h / follows_s * ((u - dry * tanh(v / 0.005)) / VISCOUS - v)
        x += h * v
    noise = np.random.default_rng(2).normal(0.0, 0.01 * command.std(), len(command))
    return Measured(
        source="foreign.csv",
        axis="x",
        sample_rate_hz=RATE_HZ,
        time_s=time_s,
        position=np.round(positions[::STEPS] / 1e-5) * 1e-5,
        command=command + noise,
        reference=None,
        reference_velocity=None,
        usable=np.ones(len(command), dtype=bool),
        saturated=None,
        resolution=1e-5,
        position_unit="m",
        command_unit="V",
    )


@pytest.mark.parametrize(("follows_s", "dry"), [(0.002, 0.0), (0.01, 0.0), (0.01, 0.1)])
def test_a_speed_that_is_followed_late_is_a_delay_and_no_inertia(
    follows_s: float, dry: float
) -> None:
    velocity = sines(30.0, RATE_HZ, 0.1, (0.1, 3.0), seed=5)[:, 1]
    found = diagnose_axis(followed(velocity, follows_s, dry), controller_list(None, "C1"))
    (effect,) = found.effects
    assert effect.name == "input_delay"
    assert effect.effect.delay_s == pytest.approx(DELAY_S, abs=0.007)
    after, before = (
        found.error.simulated_position_after_rms,
        found.error.simulated_position_before_rms,
    )
    assert after is not None
    assert before is not None
    assert after < 0.5 * before


def test_a_delay_that_is_refuted_is_told_with_its_time_where_it_explains_the_command() -> None:
    """To and fro at one speed, all that is late looks alike."""
    velocity = 0.1 * np.sign(np.sin(2.0 * np.pi * np.arange(6000) / RATE_HZ / 1.6))
    found = diagnose_axis(followed(velocity, 0.002, 0.0), controller_list(None, "C1"))
    assert not found.effects
    (note,) = [note for note in found.notes if note.startswith("input_delay is refuted")]
    told = re.search(r"Yet a command that acts ([\d.]+) ms late explains (\d+) %", note)
    assert told is not None
    assert 20.0 < float(told[1]) < 45.0
    assert float(told[2]) > 50.0
