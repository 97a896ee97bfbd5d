"""Options of the simulated gantry: presets, what differs from them, and clear refusals."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from motorctl_sim import SimOptions
from motorctl_sim.options.presets import PRESETS


def problems(**options):
    with pytest.raises(ValidationError) as caught:
        SimOptions.model_validate(options)
    return {".".join(map(str, e["loc"])): e["msg"] for e in caught.value.errors()}


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_valid_and_survives_a_round_through_json(preset):
    options = SimOptions(preset=preset, seed=5)
    assert len(options.plants) == len(PRESETS[preset])
    assert SimOptions.model_validate_json(options.model_dump_json()) == options


def test_the_published_gantry_has_the_published_plants():
    x, y = SimOptions().plant(0), SimOptions().plant(1)
    assert (x.inertia_v_s2_m, y.inertia_v_s2_m) == (0.197, 0.670)
    assert [h.amplitude_v for h in x.cogging.harmonics] == [0.034, 0.039, 0.142]
    assert [h.amplitude_v for h in y.cogging.harmonics] == [0.34, 0.10, 0.12]
    assert [h.order for h in y.cogging.harmonics] == [1, 2, 6]
    assert x.input_delay.time_s == pytest.approx(0.46 * 0.2e-3)
    assert y.presliding.displacement_m == 15e-6


def test_one_more_effect_takes_one_table_and_leaves_the_rest_as_it_is():
    stribeck = {"force_v": 0.05, "velocity_m_s": 0.005}
    options = SimOptions.model_validate({"plants": {0: {"stribeck": stribeck}}})
    assert options.plant(0).stribeck.force_v == 0.05
    assert options.plant(0).cogging == SimOptions().plant(0).cogging
    assert options.plant(1) == SimOptions().plant(1)


def test_a_table_changes_only_the_keys_that_it_names():
    options = SimOptions.model_validate({"plants": {0: {"cogging": {"pitch_m": 0.06}}}})
    assert options.plant(0).cogging.pitch_m == 0.06
    assert options.plant(0).cogging.harmonics == SimOptions().plant(0).cogging.harmonics


@pytest.mark.parametrize("off", [None, False])
def test_null_or_off_takes_an_effect_away(off):
    options = SimOptions.model_validate({"plants": {"0": {"cogging": off}}})
    assert options.plant(0).cogging is None
    assert SimOptions.model_validate(options.model_dump(mode="json")) == options


def test_plants_can_be_a_list_in_the_order_of_channels():
    changed = {"offset_v": 0.5}
    options = SimOptions.model_validate({"plants": [None, changed]})
    assert options.plant(0) == SimOptions().plant(0)
    assert options.plant(1).offset_v == 0.5


@given(channel=st.integers(0, 50))
def test_channels_beyond_the_preset_take_its_plants_in_turn(channel):
    options = SimOptions.model_validate({"plants": {0: {"offset_v": 0.5}}})
    expected = 0.5 if channel == 0 else (0.012, 0.004)[channel % 2]
    assert options.plant(channel).offset_v == expected


@pytest.mark.parametrize(
    ("change", "where", "says"),
    [
        ({"coging": {"pitch_m": 0.05}}, "coging", "Extra inputs are not permitted"),
        ({"cogging": {"pitch_m": -1}}, "cogging.pitch_m", "greater than 0"),
        ({"cogging": {"pich_m": 1}}, "cogging.pich_m", "Extra inputs"),
        ({"stribeck": {"force_v": 1}}, "stribeck.velocity_m_s", "required"),
        ({"inertia_v_s2_m": float("nan")}, "inertia_v_s2_m", "finite"),
        ({"inertia_v_s2_m": "heavy"}, "inertia_v_s2_m", "valid number"),
        ({"presliding": {"kind": "maxwell"}}, "presliding.kind", "'dahl' or 'lugre'"),
        ({"presliding": {"micro_damping_v_s_m": 1}}, "presliding", "needs kind: lugre"),
        ({"input_delay": {"time_s": 1.0}}, "input_delay.time_s", "less than or equal to 0.01"),
        ({"travel_m": [0.5, 0.1]}, "", "travel_m: the first (0.5) must lie below"),
        ({"initial_position_m": 2.0}, "", "initial_position_m 2.0 is outside travel_m"),
        ({"limit_switches_m": [1, 0]}, "", "limit_switches_m"),
        ({"home_switch": {"to_m": None}}, "home_switch", "has no edge"),
        ({"home_switch": {"from_m": 1, "to_m": 0}}, "home_switch", "must lie below to_m"),
        (
            {"position_force": {"profile": {"position_m": [0, 1], "force_v": [1]}}},
            "position_force.profile.force_v",
            "at least 2",
        ),
        (
            {"position_force": {"profile": {"position_m": [0, 1, 2], "force_v": [1, 2]}}},
            "position_force.profile",
            "3 knots, force_v 2",
        ),
        (
            {"position_force": {"profile": {"position_m": [1, 0], "force_v": [1, 2]}}},
            "position_force.profile",
            "must increase",
        ),
        ({"coulomb_friction_v": 0.0}, "", "presliding needs coulomb_friction_v"),
        (
            {"payload_change": {"time_s": 1, "inertia_v_s2_m": -0.3}},
            "",
            "takes away more than 95 %",
        ),
        (
            {
                "flexible_mode": {"frequency_hz": 80, "damping_ratio": 0.01, "fraction": 0.6},
                "backlash": {"gap_m": 1e-5, "fraction": 0.4},
            },
            "",
            "less than 5 % of the inertia",
        ),
    ],
)
def test_a_wrong_option_is_refused_where_it_stands(change, where, says):
    found = problems(plants={0: change})
    key = f"plants.0.{where}".rstrip(".")
    assert key in found
    assert says in found[key]


@pytest.mark.parametrize(
    ("options", "where", "says"),
    [
        ({"preset": "gantree"}, "preset", "'published_gantry'"),
        ({"sead": 3}, "sead", "Extra inputs"),
        ({"seed": -1}, "seed", "greater than or equal to 0"),
        ({"substep_s": 1.0}, "substep_s", "less than or equal to 0.001"),
        ({"plants": {"x": {}}}, "plants.x.[key]", "valid integer"),
        ({"plants": {0: 5}}, "plants.0", "valid dictionary"),
        ({"plants": 5}, "plants", "valid dictionary"),
        ({"faults": [{"kind": "fire", "at_s": 1}]}, "faults.0.kind", "'encoder_lost'"),
        ({"faults": [{"kind": "encoder_jump", "at_s": 1}]}, "faults.0", "needs jump_m"),
        (
            {"faults": [{"kind": "estop", "at_s": 1, "force_v": 1}]},
            "faults.0",
            "force_v belongs to kind: force_step",
        ),
        (
            {"faults": [{"kind": "encoder_jump", "at_s": 1, "jump_m": 1, "duration_s": 1}]},
            "faults.0",
            "takes no duration_s",
        ),
        (
            {"plants": {0: {"cross_axis": {"channel": 0}}}},
            "",
            "plants.0.cross_axis.channel 0 is the axis itself",
        ),
        (
            {"plants": {1: {"end_stop": {"stiffness_v_m": 1e9}}}},
            "",
            "plants.1.end_stop.stiffness_v_m is too stiff",
        ),
        (
            {"plants": {0: {"presliding": None, "friction_slope_s_m": 1e6}}},
            "",
            "plants.0.friction_slope_s_m damps too fast",
        ),
        (
            {"substep_s": 1e-3, "plants": {0: {"presliding": {"displacement_m": 1e-7}}}},
            "",
            "is too stiff",
        ),
    ],
)
def test_wrong_options_of_the_machine_are_refused(options, where, says):
    found = problems(**options)
    assert where in found
    assert says in found[where]


def test_an_unknown_preset_is_the_only_problem_told():
    assert list(problems(preset="gantree", plants={0: {"offset_v": 1}})) == ["preset"]


def test_every_option_has_a_schema():
    schema = SimOptions.model_json_schema()
    plant = schema["$defs"]["Plant"]["properties"]
    assert {"cogging", "flexible_mode", "backlash", "encoder_error"} <= set(plant)
