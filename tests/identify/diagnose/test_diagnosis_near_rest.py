"""Near rest: how slowly an axis turns round, and where it sticks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant
from tiers import few_of

from motorctl.errors import DataError
from motorctl.identify.columns.at_rest import sticks
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.reversals import slow_reversal
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.columns.stretches import Stretch
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.declared_shape import reshaped
from motorctl.identify.diagnose.search.forms import is_corner
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.measured_forms import measure
from motorctl.identify.diagnose.search.search import whitened
from motorctl.model import effect_class, make_effect
from motorctl.model.sign_function import sign_of

PERIOD_S = 2e-4
T = np.arange(0.0, 2.0, PERIOD_S)


@pytest.mark.parametrize("acceleration", [0.05, 1.0, 20.0])
def test_the_acceleration_of_a_reversal_is_that_of_the_motion(acceleration):
    x = 0.5 * acceleration * (T - 1.0) ** 2
    assert slow_reversal(x, 1e-6, PERIOD_S) == pytest.approx(acceleration, rel=0.15)


def test_a_motion_one_way_has_no_reversal():
    assert slow_reversal(0.3 * T, 1e-6, PERIOD_S) is None
    assert slow_reversal(np.zeros_like(T), 0.0, PERIOD_S) is None


def dropped(x, noise, margin_s=0.0, slowest=0.0, command=1.0):
    v = np.gradient(x, PERIOD_S)
    stretch = Stretch(T, x, x, v, np.broadcast_to(command, x.shape), {}, v)
    return sticks(stretch, PERIOD_S, 1, noise, margin_s, slowest)


STUCK = np.interp(T, [0.0, 0.9, 1.0, 2.0], [0.0, 0.45, 0.45, 0.95])


@pytest.mark.parametrize("margin_s", [0.0, 0.01])
def test_rows_in_which_an_axis_sticks_are_dropped_and_no_others(margin_s):
    found = dropped(STUCK, 1e-7, margin_s)
    inside = (T > 0.9) & (T < 1.0)
    assert found[inside].all()
    assert found.sum() * PERIOD_S == pytest.approx(0.1 + 2.0 * margin_s, abs=2e-3)


def turn(came, left, stuck_s=0.0, same_way=False):
    """Return a position that comes to rest at 1 s, sticks, and leaves: accelerations in m/s^2."""
    before, after = np.minimum(T - 1.0, 0.0), np.maximum(T - 1.0 - stuck_s, 0.0)
    return (-1.0 if same_way else 1.0) * 0.5 * came * before**2 + 0.5 * left * after**2


@pytest.mark.parametrize(("came", "left"), [(0.5, 0.5), (4.0, 0.5), (0.5, 20.0)])
@pytest.mark.parametrize("same_way", [False, True])
def test_the_turning_point_of_a_reversal_is_kept(came, left, same_way):
    assert not dropped(turn(came, left, same_way=same_way), 1e-7).any()


@pytest.mark.parametrize(("came", "left"), [(0.5, 0.5), (4.0, 0.5), (20.0, 20.0)])
@pytest.mark.parametrize("same_way", [False, True])
@pytest.mark.parametrize("noise", [1e-7, 2e-6])
def test_a_stick_that_is_shorter_than_a_slow_turn_is_dropped(came, left, same_way, noise):
    turns_over = np.clip((T - 1.0) / 0.006 - 1.0, -1.0, 1.0)
    found = dropped(turn(came, left, stuck_s=0.012, same_way=same_way), noise, command=turns_over)
    assert found[(T > 1.0003) & (T < 1.0117)].all()
    turning_s = np.sqrt(2.0 * 14.0 * noise) * (came**-0.5 + left**-0.5)
    assert 0.0115 < found.sum() * PERIOD_S < 0.012 + turning_s + 4e-3


def test_a_short_rest_under_a_command_that_stays_is_kept():
    weight = 1.0 + 0.05 * np.sin(40.0 * T)
    assert not dropped(turn(4.0, 4.0, stuck_s=0.012), 1e-7, command=weight).any()


def test_slow_motion_that_the_encoder_shows_is_kept():
    creeping = np.interp(T, [0.0, 0.9, 1.0, 2.0], [0.0, 0.45, 0.4502, 0.95])
    assert not dropped(creeping, 1e-7).any()


def test_a_coarse_encoder_drops_what_is_slower_than_it_shows():
    found = dropped(STUCK, 1e-3, slowest=0.1)
    inside = (T > 0.9) & (T < 1.0)
    assert found[inside].all()
    assert found.sum() * PERIOD_S == pytest.approx(0.1, abs=2e-3)


def test_an_encoder_too_coarse_for_most_of_a_motion_drops_nothing():
    assert not dropped(STUCK, 1e-3, slowest=0.6).any()


GENTLE = [("tanh", 8e-3, 5e-6), ("algebraic", 5e-3, 1e-5), ("clip", 0.05, 5e-6)]


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "width_m_s", "resolution"), few_of(GENTLE, 1))
def test_the_width_of_a_gentle_friction_is_found_through_a_coarse_encoder(
    shape, width_m_s, resolution
):
    plant = OtherPlant(shape=shape, width_m_s=width_m_s, resolution=resolution)
    found = diagnose_axis(plant.run(seed=3, duration_s=12.0), C1)
    assert (found.verdict, found.effects) == ("complete", ()), found.sentence
    assert found.mended[0].options["slope_s_m"] == pytest.approx(1.0 / width_m_s, rel=0.03)
    assert found.error.held_out_after_rms < 2.5 * found.error.noise_floor_rms


@pytest.mark.slow
def test_a_weight_under_a_friction_of_another_shape_is_gravity_and_no_spline():
    joint = OtherPlant(
        inertia=0.05, gravity=2.0, shape="clip", width_m_s=0.1, travel=2.5, peak_velocity=1.5,
        bandwidth_hz=6.0, resolution=1e-5,
    )  # fmt: skip
    data = replace(joint.run(seed=2, duration_s=12.0), position_unit="rad", command_unit="A")
    found = diagnose_axis(data, C1)
    assert [effect.name for effect in found.effects] == ["gravity"], found.sentence
    assert found.mended[0].options["slope_s_m"] == pytest.approx(10.0, rel=0.05)


def tried(plant, *names):
    """Return friction of the best shape beside some effects, on a motion of the plant."""
    signals = make_signals(plant.run(seed=3, duration_s=8.0), slope_s_m=900.0)
    added = tuple(make_effect(effect_class(name), options) for name, options in names)
    regressors, _ = whitened(signals, C1, added)
    return Hypothesis(regressors, added).refreshed(), spans_of(signals)


def test_a_shape_is_found_that_only_brakes_together_with_what_was_added():
    hypothesis, spans = tried(
        OtherPlant(shape="tanh", width_m_s=8e-3),
        ("warming_friction", {"time_constant_s": 500.0}),
    )
    shaped = reshaped(hypothesis, spans)
    assert shaped is not None
    assert sign_of(shaped.regressors.declared.effects).slope_s_m == pytest.approx(125.0, rel=0.03)


def test_what_a_steeper_friction_looks_like_is_a_corner_and_no_effect():
    hypothesis, _ = tried(OtherPlant(shape="clip", width_m_s=2e-4))
    options = {"velocity_m_s": 0.9e-3, "exponent": 1.0}
    form = measure(hypothesis, make_effect(effect_class("stribeck"), options))
    assert form.held_out < 0.8 * hypothesis.held_out
    assert is_corner(hypothesis, form)


def test_an_effect_beside_the_corner_is_none():
    hypothesis, _ = tried(OtherPlant(cogging=0.05))
    wave = make_effect(effect_class("cogging"), {"pitch_m": 0.06, "orders": [1]})
    assert not is_corner(hypothesis, measure(hypothesis, wave))


def test_what_is_wrong_at_the_ends_of_a_stretch_does_not_reach_the_rows():
    data = OtherPlant().run(seed=3, duration_s=4.0)
    signals = make_signals(data)
    slow = signals.with_response(lambda frequency: 1.0 / (1.0 + (frequency / 0.5) ** 4))
    sound = [np.sin(s.time_s)[None] for s in signals.stretches]
    wrong = [part.copy() for part in sound]
    for part in wrong:
        part[:, :5] += 1e3
        part[:, -5:] -= 1e3
    assert np.array_equal(slow.filtered(wrong), slow.filtered(sound))


def test_a_servo_that_is_logged_slowly_rests_and_is_not_noise():
    """Moves of a third of a second, ten rows a second, counts of a hobby servo."""
    t = np.arange(0.0, 30.0, 0.1)
    way = np.clip((t % 8.0 - 2.0) / 0.3, 0.0, 1.0) - np.clip((t % 8.0 - 6.0) / 0.3, 0.0, 1.0)
    count = 2.0 * np.pi / 4096.0
    servo = Measured(
        source="servo.csv",
        axis="x",
        sample_rate_hz=10.0,
        time_s=t,
        position=np.round(0.6 * way / count) * count,
        command=30.0 * np.gradient(way, t),
        usable=np.ones(len(t), dtype=np.bool_),
        position_unit="rad",
        command_unit="%",
    )
    with pytest.raises(DataError, match=r"it moves over 0\.6.* rests \d\d % of the time"):
        make_signals(servo)


def test_of_a_short_motion_is_told_how_much_it_rests():
    t = np.arange(0.0, 5.4, 0.016)
    arm = Measured(
        source="arm.csv",
        axis="x",
        sample_rate_hz=62.5,
        time_s=t,
        position=np.where(t < 3.4, 0.4 * t, 1.36),
        command=np.where(t < 3.4, 3.0, 1.0),
        usable=np.ones(len(t), dtype=np.bool_),
        position_unit="rad",
        command_unit="N*m",
    )
    with pytest.raises(
        DataError, match=r"moves over 1\.3.* but rests \d\d % of the time: in motion are \d+ of 1"
    ):
        make_signals(arm, 9.0)
