"""Arms whose joints all move in step, slowly: their joints are driven, and not too heavy to move.

The torque of a joint is what its own motion asks for, and what the other joints put upon it in the
same rhythm. Nothing is shared with the model or the other plants.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fit_plant import C1

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.columns.spans import spans_of
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.search.held_out_blocks import BLOCK_S, FOLDS, blocks_out_of_step
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.refutation import without_refuted
from motorctl.identify.diagnose.search.search import Found, rival_gains, whitened
from motorctl.identify.diagnose.search.whole_model import can_move, known_inertias
from motorctl.identify.diagnose.verdict import recording_mistakes
from motorctl.identify.diagnose.verdict.driven_motion import moved_by
from motorctl.identify.diagnose.verdict.late_command import late_command
from motorctl.model import columns, effect_class, make_effect

RATE_HZ = 200.0
ROUND_S = 12.0
W = 2.0 * np.pi / ROUND_S


def joint(
    inertia: float, viscous: float, dry: float, weight: float, others: tuple[float, float]
) -> Measured:
    """Return two rounds of a joint under its weight, and under others that move in step."""
    t = np.arange(0.0, 2.0 * ROUND_S, 1.0 / RATE_HZ)
    rng = np.random.default_rng(5)
    x = 0.8 * np.sin(W * t) + 0.1 * np.sin(3.0 * W * t + 0.4) + 0.02 * np.sin(11.0 * W * t)
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    load = others[0] * np.cos(2.0 * W * t) + others[1] * np.sin(3.0 * W * t + 1.0)
    command = inertia * a + viscous * v + dry * np.tanh(v / 0.01) + weight * np.sin(x) + load
    return Measured(
        source="arm.csv",
        axis="x",
        sample_rate_hz=RATE_HZ,
        time_s=t,
        position=x + 1e-6 * rng.standard_normal(len(x)),
        command=command + 0.02 * rng.standard_normal(len(x)),
        usable=np.ones(len(x), dtype=np.bool_),
        position_unit="rad",
        command_unit="N*m",
    )


@pytest.mark.parametrize("period_s", [FOLDS * BLOCK_S, 2.0 * FOLDS * BLOCK_S])
def test_blocks_that_are_held_out_together_hold_different_parts_of_a_motion(period_s):
    t = np.arange(0.0, 60.0, 0.01)
    length = blocks_out_of_step(np.cos(2.0 * np.pi * t / period_s), 0.01).length
    assert length * 0.01 > 1.2 * BLOCK_S
    usual = blocks_out_of_step(np.cos(2.0 * np.pi * t / 5.0), 0.01).length
    assert usual * 0.01 == pytest.approx(BLOCK_S, rel=0.05)


def test_friction_explains_a_joint_whose_round_takes_as_long_as_blocks_come_round():
    share, backwards = moved_by(make_signals(joint(0.2, 0.2, 0.8, 0.0, (1.0, 1.5))))
    assert share > 0.3
    assert not backwards


def test_a_weight_that_pushes_away_is_not_refuted_for_a_model_too_heavy_to_move():
    signals = make_signals(joint(1.0, 10.0, 4.0, -60.0, (2.0, 1.5)), slope_s_m=900.0)
    gravity = make_effect(effect_class("gravity"), {"turn_m": 2.0 * np.pi})
    regressors, noise = whitened(signals, C1, (gravity,), "command")
    final = Hypothesis(regressors, (gravity,)).refreshed()
    base = Hypothesis(regressors).refreshed()
    assert not can_move(base, known_inertias(base))
    found = Found(base, final, (), spans_of(signals), noise, rival_gains(final))
    held_out = np.arange(signals.rows) % 600 < 200
    kept, why = without_refuted(found, held_out)
    assert [effect.name for effect in kept.final.added] == ["gravity"], why


@pytest.mark.slow
def test_a_weight_whose_motion_does_not_show_the_inertia_is_told_as_a_force_of_the_place():
    found = diagnose_axis(joint(0.02, 0.2, 0.8, -20.0, (0.3, 0.2)), C1)
    assert found.unknown is not None
    assert found.unknown.family == "force_of_position"
    assert "gravity takes" in found.sentence


@pytest.mark.parametrize("late_s", [0.0, 0.06, 0.13])
def test_a_slow_joint_whose_torque_was_recorded_late_is_told_by_how_much(late_s):
    sound = joint(4.0, 1.0, 0.5, 0.0, (0.0, 0.0))
    late = round(late_s * RATE_HZ)
    command = np.concatenate([np.full(late, sound.command[0]), sound.command])[: len(sound.command)]
    data = replace(sound, command=command)
    hint = late_command(recording_mistakes.check_explains(data, make_signals(data), C1))
    if not late:
        assert hint is None
    else:
        assert hint is not None
        told_s = float(hint.told().partition("late_s: ")[2].split()[0])
        assert told_s == pytest.approx(late_s, abs=0.02)


@pytest.mark.slow
def test_nothing_is_named_beside_an_inertia_that_is_surely_negative_and_the_sign_is_told():
    (right,) = diagnose_axis(joint(1.0, 0.0, 0.0, 40.0, (0.0, 0.0)), C1).effects
    assert right.name == "gravity"
    turned = diagnose_axis(joint(-1.0, 0.0, 0.0, 40.0, (0.0, 0.0)), C1)
    assert (turned.verdict, turned.effects) == ("unknown_structure", ())
    (why,) = (note for note in turned.notes if "not named" in note)
    assert why.startswith("gravity: not named, for the inertia beside comes to -1")
    assert "may be reversed in the recording" in why


@pytest.mark.slow
@pytest.mark.parametrize("begins_s", [pytest.param(1e6, marks=pytest.mark.long), 1.7e9])
def test_a_load_is_named_wherever_the_clock_begins(monkeypatch, begins_s):
    monkeypatch.setattr(columns, "_USES", {})  # as in a process that has seen no other clock
    rng = np.random.default_rng(8)
    t = np.arange(0.0, 30.0, 1.0 / RATE_HZ)
    x = sum(np.sin(w * t + p) / w for w, p in zip((1.1, 2.3, 4.1, 7.7), range(4), strict=True))
    v = np.gradient(x, t)
    inertia = np.where(t >= 14.0, 0.35, 0.2)
    command = inertia * np.gradient(v, t) + 0.1 * v + 0.2 * np.tanh(v / 0.01)
    loaded = replace(
        joint(0.0, 0.0, 0.0, 0.0, (0.0, 0.0)),
        time_s=begins_s + t,
        position=x + 1e-6 * rng.standard_normal(len(x)),
        command=command + 0.005 * rng.standard_normal(len(x)),
        usable=np.ones(len(x), dtype=np.bool_),
    )
    (load,) = diagnose_axis(loaded, C1).effects
    assert load.name == "payload_change"
    assert load.theta[0] == pytest.approx(0.15, rel=0.05)


def test_what_falls_short_of_a_limit_is_not_rounded_up_to_it(monkeypatch):
    monkeypatch.setattr(recording_mistakes, "moved_by", lambda _: (0.1996, False))
    pulled = joint(0.0, 0.0, 0.0, 0.0, (9.0, 9.0))
    with pytest.raises(DataError, match=r"the motion 19 % of the command \(at least 20 %"):
        recording_mistakes.check_explains(pulled, make_signals(pulled), C1)
