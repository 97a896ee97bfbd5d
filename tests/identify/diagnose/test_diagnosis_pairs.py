"""Effects that look alike: told apart where the data can, and said to be alike where it cannot."""

import pytest
from diagnosis_cases import diagnosed, moving, names, undecided_between

from motorctl.errors import DataError
from motorctl_benchmarks.diagnosis.cases import draw_case

RICH = [
    ("input_lag", "input_delay", 11),
    ("input_delay", "input_lag", 12),
    ("stribeck", "presliding", 13),
    ("presliding", "stribeck", 14),
    ("cogging", "periodic_disturbance", 15),
    ("periodic_disturbance", "cogging", 16),
    ("force_ripple", "cogging", 17),
    ("cogging", "force_ripple", 29),
    ("asymmetric_friction", "dead_zone", 18),
    ("dead_zone", "asymmetric_friction", 19),
]
QUICK = (13, 17)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "rival", "seed"),
    [pytest.param(*c, marks=() if c[2] in QUICK else pytest.mark.long) for c in RICH],
)
def test_rich_motion_tells_it_from_its_double(tmp_path, effect, rival, seed):
    found = diagnosed(draw_case(seed, effects=(effect,)), tmp_path)
    assert found.verdict == "effect"
    assert names(found) == [effect]
    assert rival not in found.effects[0].indistinguishable_from
    assert found.effects[0].confidence > 0.8


@pytest.mark.slow
def test_what_does_not_repeat_from_magnet_to_magnet_is_told_beside_the_cogging(tmp_path):
    case = draw_case(20, effects=("cogging",))
    assert "aperiodic" in case.truth["cogging"]
    found = diagnosed(case, tmp_path)
    assert names(found) == ["cogging", "position_force"]
    assert any("a wave that does not repeat exactly" in note for note in found.notes)


ONE_SPEED = [(0.95, 0.04, 0.5, 0.3)]
"""Share of the travel, speed [m/s], acceleration [m/s^2], dwell [s]."""
SMOOTH = [(0.9, 0.15, 0.3, 0.0), (0.1, 0.15, 0.3, 0.0)] * 6
ONE_WAY = [(0.1 + 0.05 * k, 0.03, 0.2, 0.0) for k in range(1, 17)]
NEVER_SLOW = [(0.9, 1.0, 15.0, 0.0), (0.1, 1.0, 15.0, 0.0)] * 20
LONG = pytest.mark.long
POOR = [
    pytest.param("cogging", "periodic_disturbance", 1.0, ONE_SPEED, 21, id="cogging-one-speed"),
    pytest.param(
        "periodic_disturbance", "cogging", 1.0, ONE_SPEED, 22, id="time-one-speed", marks=LONG
    ),
    pytest.param("force_ripple", "cogging", 1.0, ONE_SPEED, 23, id="ripple-one-speed", marks=LONG),
    pytest.param("input_lag", "input_delay", 1.0, SMOOTH, 23, id="lag-smooth", marks=LONG),
    pytest.param("input_delay", "input_lag", 1.0, SMOOTH, 24, id="delay-smooth", marks=LONG),
    pytest.param(
        "asymmetric_friction", "dead_zone", 1.0, ONE_WAY, 27, id="asymmetry-one-way", marks=LONG
    ),
    pytest.param("stribeck", "presliding", 0.1, NEVER_SLOW, 25, id="stribeck-weak"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "rival", "strength", "moves", "seed"), POOR)
def test_poor_motion_is_said_not_to_tell_them_apart(tmp_path, effect, rival, strength, moves, seed):
    case = moving(draw_case(seed, effects=(effect,), strength=strength), 0.1, moves)
    try:
        found = diagnosed(case, tmp_path)
    except DataError as refusal:
        told = str(refusal)
        assert "speeds up or slows down" in told or "explains none" in told, told
        return
    assert undecided_between(found, effect, rival), (found.verdict, names(found))
    if found.verdict == "insufficient_data":
        assert found.missing


@pytest.mark.slow
def test_a_small_load_that_is_taken_up_is_no_gain_of_the_command(tmp_path):
    """A gain wins by having no noise in its column, unless a load is asked as one number, too."""
    case = draw_case(910022, effects=("payload_change",), strength=0.2)
    found = diagnosed(case, tmp_path, duration_s=24.0)
    assert [effect.name for effect in found.effects] == ["payload_change"]
