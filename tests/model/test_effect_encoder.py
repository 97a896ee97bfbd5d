"""The encoder's periodic error is taken out of what was measured."""

import math

import numpy as np
import pytest
from effect_forms import form
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from motorctl.model import EffectList
from motorctl.model.effects.encoder_error import correct


@given(
    position_m=st.floats(-2.0, 2.0),
    period_m=st.floats(1e-6, 1e-3),
    share=st.floats(0.0, 1.0),
    phase=st.floats(0.0, 2.0 * math.pi),
)
def test_the_corrected_position_is_the_true_one(position_m, period_m, share, phase):
    # up to the largest error for which the measurement still tells the position
    amplitude = 0.999 * share * 0.5 * period_m / (2.0 * math.pi)
    sin_m, cos_m = amplitude * math.cos(phase), amplitude * math.sin(phase)
    effect = form("encoder_error", period_m=period_m, sin_m=sin_m, cos_m=cos_m)
    angle = 2.0 * math.pi * position_m / period_m
    shown = position_m + sin_m * math.sin(angle) + cos_m * math.cos(angle)
    # compiled once for all forms; a list would compile each
    assert abs(correct(shown, effect.constants) - position_m) < 1e-5 * period_m


def test_the_list_corrects_a_common_scale_to_less_than_a_picometre():
    effect = form("encoder_error", period_m=20e-6, sin_m=0.3e-6, cos_m=-0.25e-6)
    kernels = EffectList([form("inertia"), effect]).kernels
    for x in np.linspace(-100e-6, 100e-6, 400):
        angle = 2.0 * math.pi * x / 20e-6
        shown = x + 0.3e-6 * math.sin(angle) - 0.25e-6 * math.cos(angle)
        assert abs(kernels.correct(shown) - x) < 1e-12


def test_a_list_without_errors_of_measurement_corrects_nothing():
    assert EffectList([form("inertia")]).kernels.correct(0.1234) == 0.1234


def test_an_error_that_hides_the_position_is_refused():
    with pytest.raises(ValidationError, match=r"at most 1\.59155e-06 m can be undone"):
        form("encoder_error", period_m=20e-6, sin_m=1.5e-6, cos_m=1.5e-6)


def test_the_error_itself_has_no_adapted_parameters():
    effect = form("encoder_error", period_m=20e-6, sin_m=1e-7)
    model = EffectList([effect, form("inertia")])
    assert model.parameter_names == ("inertia",)
