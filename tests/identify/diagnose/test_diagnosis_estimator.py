"""How parameters are found: with the reference as instrument where least squares is biased."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.parameters import values_of
from motorctl.identify.diagnose.search.search import whitened
from motorctl.identify.diagnose.verdict.estimator import estimator_of
from motorctl.identify.diagnose.verdict.instruments import with_instruments
from motorctl.model import effect_class, make_effect

COARSE = OtherPlant(shape="arctan", width_m_s=1.0 / 900.0, cogging=0.05, resolution=1e-4)
COGGING = make_effect(effect_class("cogging"), {"pitch_m": COARSE.pitch_m})


def model(data, side="command"):
    signals = make_signals(data, slope_s_m=900.0)
    regressors, _ = whitened(signals, C1, (COGGING,), side)
    return Hypothesis(regressors, (COGGING,)).refreshed()


@pytest.fixture(scope="module")
def recording():
    return COARSE.run(seed=4, duration_s=10.0)


def test_behind_a_coarse_encoder_instruments_find_the_inertia_that_least_squares_misses(recording):
    plain = model(recording)
    better = with_instruments(plain)
    by_squares, by_reference = values_of(plain), values_of(better)
    place = by_reference.model.index_of("acceleration")
    assert by_squares.theta[place] < 0.95 * COARSE.inertia
    assert by_reference.theta[place] == pytest.approx(COARSE.inertia, rel=0.01)
    amplitude = sum(v**2 for v in by_reference.theta[-2:]) ** 0.5
    assert amplitude == pytest.approx(COARSE.cogging, rel=0.05)
    told = estimator_of(plain, instruments=True)
    assert (told.left, told.method) == ("command", "instruments")


def test_without_a_reference_or_with_the_acceleration_on_the_left_there_are_no_instruments(
    recording,
):
    assert with_instruments(model(replace(recording, reference=None))) is None
    sideways = model(recording, "acceleration")
    assert with_instruments(sideways) is None
    assert estimator_of(sideways).method == "least_squares"


def test_a_reference_of_another_run_is_no_instrument(recording):
    other = COARSE.run(seed=5, duration_s=10.0).reference
    assert with_instruments(model(replace(recording, reference=other))) is None


def told_range(noise_m):
    """Return what is told of the inertia's range, of a machine whose position has noise."""
    clean = OtherPlant(cogging=0.0).run(seed=4, duration_s=10.0)
    noise = noise_m * np.random.default_rng(1).standard_normal(len(clean.position))
    signals = make_signals(replace(clean, position=clean.position + noise), slope_s_m=900.0)
    regressors, _ = whitened(signals, C1, (), "command")
    return estimator_of(Hypothesis(regressors).refreshed()).sentence.partition("; least ")[2]


def test_an_inertia_that_noise_of_the_acceleration_hides_is_told_with_its_upper_end():
    assert told_range(1e-7) == told_range(3e-4) == ""  # none is needed; nothing is seen
    told = told_range(7e-5)
    parts = (told.partition(of)[2].split()[0] for of in ("inertia of ", " has "))
    more, less = (float(part.rstrip(",")) for part in parts)
    assert less < 0.6 * OtherPlant.inertia
    assert less < OtherPlant.inertia < 1.3 * more
