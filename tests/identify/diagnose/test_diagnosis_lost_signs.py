"""A command whose negative values were read as large positive ones is told; no other is accused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.usual_mistakes import check_columns
from motorctl.identify.diagnose.recording import diagnose_axis


@pytest.fixture(scope="module")
def run() -> Measured:
    """A sound recording by another author's plant."""
    return OtherPlant(width_m_s=2e-3).run(seed=3, duration_s=12.0)


@pytest.mark.parametrize("bits", [16, 32])
@pytest.mark.parametrize("scale", [1.0, 1e-3, 0.0049])
def test_a_command_that_lost_its_signs_is_told(run, bits, scale):
    counts = np.round(300.0 * run.command / np.abs(run.command).max())
    data = replace(run, command=scale * (counts % 2**bits))
    with pytest.raises(DataError, match=f"{bits}-bit .* negative ones were read without a sign"):
        check_columns(data)
    check_columns(replace(run, command=scale * counts))


def test_its_sign_is_asked_before_a_slow_sensor_averages_it(run):
    counts = np.round(300.0 * run.command / np.abs(run.command).max())
    slow = np.repeat(run.position[::4], 4)[: len(run.position)]
    data = replace(run, command=counts % 2**16, position=slow)
    with pytest.raises(DataError, match="negative ones were read without a sign"):
        diagnose_axis(data, C1)


@pytest.mark.parametrize("noise", [1, 2, 6])
def test_a_switch_that_is_read_back_has_lost_no_sign(run, noise):
    about = np.random.default_rng(4).integers(0, noise, len(run.command))
    for top in (255.0, 65535.0):
        check_columns(replace(run, command=np.where(run.command > 0.0, top - about, about)))
    check_columns(replace(run, command=np.exp(-80.0 * run.time_s)))
