"""One move one way, as much of what is recorded of arms: judged by what it can tell, not refused.

Where all that goes the other way, or stands, lies in one of the parts that are held out in turn,
the others hold a constant force and friction by direction for the same.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant

from motorctl.errors import DataError
from motorctl.identify.columns.measured import Measured
from motorctl.identify.columns.pieces import shortened
from motorctl.identify.columns.signals import FEWEST_ROWS, make_signals
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.result import ModelError
from motorctl.identify.diagnose.search.search import nothing_sought
from motorctl.identify.diagnose.search.undetermined import without_undetermined
from motorctl.identify.diagnose.verdict.confidence import DoubtedMember
from motorctl.identify.diagnose.verdict.recording_mistakes import check_explains
from motorctl.identify.diagnose.verdict.undetermined_model import why_undetermined

RATE_HZ = 250.0
INERTIA, VISCOUS, COULOMB, WEIGHT = 0.8, 10.0, 0.6, 1.5
"""Of a joint, in N m and rad: about those of a small arm's."""
NOISE = 0.05
"""Of the torque, rms [N m]."""


def joint(duration_s: float = 4.4, swept: float = 0.6) -> Measured:
    """Simulate one move: the velocity of a bell, then a hint of a motion back at the end.

    The velocity is given and the torque follows from it, so no solver is needed.
    """
    rng = np.random.default_rng(5)
    time_s = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    place = time_s / duration_s
    v = 2.0 * swept / duration_s * np.sin(np.pi * (0.1 + 0.9 * np.minimum(place / 0.97, 1.0))) ** 2
    back = np.clip((place - 0.97) / 0.03, 0.0, 1.0)
    v -= 0.02 * np.sin(np.pi * back) ** 2
    v *= 1.0 + 0.3 * np.sin(2.0 * np.pi * 3.0 * time_s)  # a controller that hunts
    x = np.cumsum(v) / RATE_HZ
    a = np.gradient(v, 1.0 / RATE_HZ)
    torque = INERTIA * a + VISCOUS * v + COULOMB * np.sign(v) + WEIGHT
    return Measured(
        source="joint.csv",
        axis="x",
        sample_rate_hz=RATE_HZ,
        time_s=time_s,
        position=x + 2e-6 * rng.standard_normal(len(x)),
        command=torque + NOISE * rng.standard_normal(len(x)),
        usable=np.ones(len(x), dtype=bool),
        position_unit="rad",
        command_unit="N*m",
    )


def test_friction_holds_the_constant_force_where_only_one_part_tells_them_apart():
    model, dropped = without_undetermined(make_signals(joint(), slope_s_m=900.0), C1)
    assert model.names == ("inertia", "viscous_friction", "coulomb_friction")
    assert "too short to hold another out" in dropped["offset"]


def test_a_motion_that_goes_both_ways_keeps_its_constant_force():
    one = joint()
    back = one.position[-1] - (one.position - one.position[0])
    turned = replace(
        one,
        time_s=np.arange(2 * len(one.time_s)) / RATE_HZ,
        position=np.concatenate([one.position, back]),
        command=np.concatenate([one.command, 2.0 * WEIGHT - one.command]),
        usable=np.ones(2 * len(one.time_s), dtype=bool),
    )
    model, dropped = without_undetermined(make_signals(turned, slope_s_m=900.0), C1)
    assert model.names == C1.names
    assert dropped == {}


def test_a_short_move_that_its_command_drives_is_not_refused_for_want_of_rows():
    data = joint()
    check_explains(data, make_signals(data, slope_s_m=900.0), C1)
    diagnose_axis(data, C1)


def test_what_one_move_leaves_on_rows_held_out_is_its_noise():
    error = diagnose_axis(joint(), C1).error
    assert error.held_out_before_rms < 3.0 * NOISE


def test_a_command_that_says_nothing_of_the_motion_is_refused_still():
    data = joint()
    noise = np.random.default_rng(6).standard_normal(len(data.command))
    other = replace(data, command=noise)
    with pytest.raises(DataError, match="explains none of the acceleration"):
        check_explains(other, make_signals(other, slope_s_m=900.0), C1)


def test_pieces_of_a_long_recording_in_which_nearly_nothing_moves_stand_not_for_it():
    rng = np.random.default_rng(7)
    time_s = np.arange(12_000) / 50.0
    moves = np.where(time_s % 60.0 < 1.5, np.sin(np.pi * (time_s % 60.0) / 1.5) ** 2, 0.0)
    x = np.cumsum(moves) / 50.0
    data = replace(
        joint(),
        sample_rate_hz=50.0,
        time_s=time_s,
        position=x + 1e-6 * rng.standard_normal(len(x)),
        command=moves,
        usable=np.ones(len(x), dtype=bool),
    )
    signals = make_signals(data, slope_s_m=900.0)
    assert signals.rows >= FEWEST_ROWS
    assert shortened(signals, 24.0).rows >= FEWEST_ROWS


@pytest.mark.slow
def test_no_power_is_told_of_frequencies_that_a_slow_recording_has_not():
    rng = np.random.default_rng(8)
    time_s = np.arange(1200) / 10.0
    x = np.cumsum(0.02 * np.sin(2.0 * np.pi * 0.1 * time_s)) / 10.0
    drift = np.cumsum(rng.standard_normal(len(x))) / 30.0
    data = replace(
        joint(),
        sample_rate_hz=10.0,
        time_s=time_s,
        position=x + 1e-7 * rng.standard_normal(len(x)),
        command=3.0 * np.sign(np.gradient(x)) + drift,
        usable=np.ones(len(x), dtype=bool),
    )
    told = diagnose_axis(data, C1)
    assert "20 Hz" not in " ".join((told.sentence, *told.notes))
    assert "below 2 Hz" in " ".join((told.sentence, *told.notes))


def test_a_command_of_which_the_motion_explains_a_quarter_is_refused_as_that_of_no_drive():
    data = joint()
    rng = np.random.default_rng(9)
    slow = np.convolve(rng.standard_normal(len(data.command)), np.ones(60) / 60.0, "same")
    velocity = np.gradient(data.position, 1.0 / RATE_HZ)
    other = replace(data, command=velocity / velocity.std() + 1.4 * slow / slow.std())
    with pytest.raises(DataError, match="explains none of the acceleration"):
        check_explains(other, make_signals(other, slope_s_m=900.0), C1)


@pytest.mark.parametrize(("left_over_change", "determined"), [(0.5, True), (2.0, False)])
def test_a_load_that_is_carried_all_the_time_is_explained_by_no_model_as_well(
    left_over_change, determined
):
    """What a model leaves is set against what the command changes by, not against its mean."""
    lifted = replace(joint(), command=joint().command + 20.0)
    found = nothing_sought(make_signals(lifted), C1)
    changes = float(np.std(lifted.command))
    error = ModelError("N*m", 1.0, left_over_change * changes, 0.0, 0.0, 20.0, None, None)
    why = why_undetermined(found, SimpleNamespace(as_twin=False, verdict="complete"), error, None)
    assert (why is None) == determined
    assert determined or "misses the command of the rest by" in why


@pytest.mark.parametrize(
    ("family", "share", "determined"),
    [(None, 0.65, False), (None, 0.95, True), ("timing", 0.65, True)],
)
def test_an_effect_too_unsure_to_be_named_determines_a_model_only_where_it_leaves_less_than_none(
    family, share, determined
):
    """One step and a rest leave an error of twice the command, which a doubtful effect lowers."""
    moved = joint()
    found = nothing_sought(make_signals(moved), C1)
    changes = float(np.std(moved.command))
    error = ModelError("N*m", 3.0, 3.0 * changes, 0.0, 0.0, 2.0 * changes, None, None)
    doubted = DoubtedMember(family, "backlash", 0.2, share)
    why = why_undetermined(
        found, SimpleNamespace(as_twin=False, verdict="complete"), error, doubted
    )
    assert (why is None) == determined


def test_what_depends_on_the_place_of_an_axis_that_never_turns_round_may_depend_on_time():
    data = OtherPlant(width_m_s=2e-3).run(seed=3, duration_s=20.0)
    t = data.time_s
    v = 0.3 + 0.15 * np.sin(2.0 * np.pi * 0.7 * t) + 0.09 * np.sin(2.0 * np.pi * 1.9 * t + 1.0)
    x = np.cumsum(v) * data.period_s
    high, low = (np.exp(-(((x / x[-1] - at) / 0.017) ** 2)) for at in (0.55, 0.25))
    bumps = high - 0.7 * low
    command = 0.3 * np.gradient(v, data.period_s) + 2.0 * v + 0.3 + bumps
    noise_v = np.random.default_rng(1).normal(0.0, 0.01, len(t))
    counted = np.round(x / 5e-7) * 5e-7
    one_way = replace(data, position=counted, command=command + noise_v, reference=None)
    axis = diagnose_axis(one_way, C1)
    assert axis.verdict == "unknown_structure"
    assert not axis.effects
    assert "depends on position or time, which are not told apart as the axis" in axis.sentence
    assert axis.unknown.compensation is None
