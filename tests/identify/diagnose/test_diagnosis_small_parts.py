"""What is small, or hidden behind a form of more freedom, and is there all the same."""

import pytest
from diagnosis_cases import diagnosed, names

from motorctl_benchmarks.diagnosis.groups import draw, parse_key

WHOLE_S = 24.0
"""Length of the campaign's recordings [s]: what is small needs them whole."""

pytestmark = pytest.mark.slow


def of_campaign(key, folder):
    return diagnosed(draw(parse_key(key)), folder, duration_s=WHOLE_S)


def test_a_delay_that_leaves_far_more_than_noise_may_be_a_lag_that_leaves_little_more(tmp_path):
    (effect,) = of_campaign("poor:950070", tmp_path).effects
    assert "input_lag" in {effect.name, *effect.indistinguishable_from}
    assert effect.confidence < 0.6


def test_a_magnet_pitch_under_a_spring_and_a_lag_is_no_wave_of_a_long_pitch(tmp_path):
    found = of_campaign("several:940011", tmp_path)
    assert set(names(found)) == {"cogging", "position_force", "input_lag"}


def test_a_weak_resonance_that_leaves_noise_alone_is_named(tmp_path):
    (effect,) = of_campaign("weak:910041", tmp_path).effects
    assert effect.name == "flexible_mode"
    assert effect.effect.options.frequency_hz == pytest.approx(107.0, rel=0.02)
