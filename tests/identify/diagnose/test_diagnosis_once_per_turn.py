"""An encoder off its centre errs once a turn, on axes that turn round."""

import math
from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.model import effect_class

TURN_RAD = 2.0 * math.pi


def turning(error_rad, travel_rad=15.0):
    """Return what is measured of a wheel whose encoder shows so much too much, once a turn."""
    wheel = OtherPlant(
        inertia=0.05, viscous=0.03, coulomb=0.1, width_m_s=0.05, travel=travel_rad,
        peak_velocity=8.0, peak_acceleration=40.0, bandwidth_hz=5.0, resolution=1e-4,
    )  # fmt: skip
    data = wheel.run(seed=2, duration_s=16.0)
    shown = data.position + error_rad * np.sin(data.position + 0.4)
    return replace(
        data, position=np.round(shown / 1e-4) * 1e-4, position_unit="rad", command_unit="A"
    )


@pytest.mark.parametrize(("travel_rad", "tried"), [(15.0, True), (5.0, False)])
def test_one_turn_is_tried_where_an_axis_turns_round(travel_rad, tried):
    spans = spans_of(make_signals(turning(0.0, travel_rad), slope_s_m=20.0))
    periods = [form.options.period_m for form in effect_class("encoder_error").trials(spans)]
    assert (TURN_RAD in periods) == tried


@pytest.mark.slow
def test_an_encoder_off_its_centre_is_named_with_its_turn_and_its_size():
    found = diagnose_axis(turning(0.05), C1)
    assert [effect.name for effect in found.effects] == ["encoder_error"], found.sentence
    options = found.effects[0].effect.options
    assert options.period_m == pytest.approx(TURN_RAD, rel=0.01)
    assert math.hypot(options.sin_m, options.cos_m) == pytest.approx(0.05, rel=0.1)
