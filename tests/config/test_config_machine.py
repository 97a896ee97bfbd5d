"""A valid file becomes the machine that it describes; the machine becomes the same file again."""

import json
import math

import numpy as np
import pytest
from config_bench import MACHINE, BenchDriver, drop, machine, write

from motorctl.config import (
    config_schema,
    load,
    load_resolved,
    shipped_config,
    shipped_configs,
    summarise,
)
from motorctl.control import fill_by_name
from motorctl.control.law_records import LAW_GIVEN
from motorctl.errors import ConfigError, UsageError
from motorctl.loop.axis_records import AXIS_GIVEN
from motorctl.model import known_effects

SHIPPED = sorted(shipped_configs())


def same(one, other):
    """Tell whether two machines are equal; lists of effects compare by what they are made of."""
    assert list(one.axes) == list(other.axes)
    for a, b in zip(one.axes.values(), other.axes.values(), strict=True):
        plain = [
            {k: v for k, v in vars(axis).items() if k not in ("declared", "model")}
            for axis in (a, b)
        ]
        assert plain[0] == plain[1]
        assert a.model.module_name == b.model.module_name
        assert a.declared.module_name == b.declared.module_name
    assert one.programs == other.programs
    assert one.resolved == other.resolved
    return (one.name, one.rate_hz, one.loop, one.log_directory) == (
        other.name,
        other.rate_hz,
        other.loop,
        other.log_directory,
    )


@pytest.fixture
def bench(tmp_path):
    return load(write(tmp_path, MACHINE))


def test_numbers_arrive_where_the_loop_looks_for_them(bench):
    axis = bench.axes["x"]
    assert bench.rate_hz == 2000.0
    assert bench.period_s == 0.0005
    assert axis.limits.travel_m == (-0.1, 0.3)
    assert axis.limits.stop.jerk_m_s3 == 1000.0
    assert axis.gains.ks_v_s_m == 40.0
    assert axis.model.parameter_names[-1] == "em_cubic"
    assert [e.initial for e in axis.estimates] == [0.2, 0.2, 0.1, -0.01, -0.0005]
    assert (axis.estimates[0].lower, axis.estimates[0].upper) == (0.1, 0.4)
    assert bench.drivers["line"].cls is BenchDriver
    assert bench.drivers["line"].options.port == "/dev/ttyX"
    assert bench.programs["there"].axes == ("x",)


def test_what_is_left_out_has_its_default(bench):
    axis = bench.axes["x"]
    assert axis.encoder.direction == 1
    assert axis.adaptation.rate_limit_1_s is None
    assert axis.estimates[1].covariance == 50.0
    assert bench.loop.overrun_policy == "count"


@pytest.mark.slow
def test_an_effect_with_nothing_behind_its_name_is_declared_with_defaults(tmp_path):
    loaded = load(write(tmp_path, machine(axes__x__model__offset=None)))
    assert loaded.axes["x"].estimates[-1].initial == 0.0
    assert loaded.axes["x"].model.names[-1] == "offset"


def test_c1_is_the_declared_list_without_its_electromagnetic_effects(tmp_path):
    axis = load(write(tmp_path, machine(axes__x__controller="C1"))).axes["x"]
    assert axis.model.names == ("inertia", "viscous_friction", "coulomb_friction")
    assert axis.declared.names[-2:] == ("em_quadratic", "em_cubic")
    assert len(axis.estimates) == 3


def test_the_chosen_controller_takes_the_place_of_what_the_axes_say(tmp_path):
    path = write(tmp_path, MACHINE)
    chosen = load(path, controller="C1")
    written = load(write(tmp_path, machine(axes__x__controller="C1")))
    assert same(chosen, written)


@pytest.mark.slow
def test_an_effect_of_ones_own_is_found_by_its_type(tmp_path):
    spring = {
        "type": "config_bench:Spring",
        "centre_m": 0.1,
        "parameters": {"linear": {"initial": 2.0, "bounds": [0.0, 5.0]}},
    }
    axis = load(write(tmp_path, machine(axes__x__model__spring=spring))).axes["x"]
    assert axis.model.parameter_names[-2:] == ("spring_linear", "spring_cubic")
    assert axis.estimates[-2].upper == 5.0
    still = np.zeros(1)
    columns = axis.model.regressor(np.array([0.3]), still, still, still, still, still)
    assert columns[0, -2:] == pytest.approx([0.2, 0.008])


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("controller", ["C1", "C2"])
def test_every_shipped_configuration_is_valid_with_either_controller(name, controller):
    loaded = load(name, controller=controller)
    assert loaded.source == shipped_config(name)
    assert all(axis.controller == controller for axis in loaded.axes.values())


def test_the_published_gantry_has_the_published_numbers():
    x, y = load("published_gantry").axes.values()
    assert x.gains == y.gains
    assert x.gains.model_dump() == {
        "k1_1_s": 250.0,
        "ks_v_s_m": 95.0,
        "gamma_d": 500.0,
        "d_hat_max_v": 1.0,
        "velocity": "published",
        "command_filter": None,
    }
    assert [e.covariance for e in y.estimates] == [2, 50, 100, 500, 0.05, 0.005]
    assert [e.initial for e in y.estimates] == [0.55, 0.2, 0.1, 0, -0.0186, -0.0003]
    assert [e.lower for e in x.estimates] == [0.05, 0.08, 0.05, -0.5, -0.015, -0.002]
    assert (x.controller, y.controller) == ("C2", "C2")


def test_the_small_stage_homes_by_switch_and_index():
    homing = load("small_stage").axes["x"].homing
    assert homing.method == "switch_index"
    assert homing.search_velocity_m_s < 0.0 < homing.latch_velocity_m_s


def test_one_word_switches_the_published_gantry_to_c1(tmp_path):
    text = shipped_config("published_gantry").read_text()
    changed = text.replace("controller: &controller C2", "controller: &controller C1")
    axes = load(write(tmp_path, changed)).axes.values()
    assert [axis.controller for axis in axes] == ["C1", "C1"]


def test_a_file_goes_before_a_shipped_configuration_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load("small_stage").name == "small-stage"
    write(tmp_path, MACHINE).rename(tmp_path / "small_stage")
    assert load("small_stage").name == "bench"


def test_an_unknown_shipped_name_is_met_with_the_nearest():
    with pytest.raises(UsageError, match="did you mean 'small_stage'"):
        shipped_config("smal_stage")
    with pytest.raises(ConfigError, match="no such file"):
        load("smal_stage")


@pytest.mark.parametrize("name", SHIPPED)
def test_the_resolved_document_gives_the_same_machine_through_json(name):
    loaded = load(name)
    plain = json.loads(json.dumps(loaded.resolved, allow_nan=False))
    assert same(load_resolved(plain, hardware=True), loaded)


def test_the_resolved_document_is_itself_a_configuration_file(tmp_path, bench):
    again = load(write(tmp_path, json.dumps(bench.resolved)))
    assert same(again, bench)


def test_an_infinite_slope_of_friction_survives_json(tmp_path):
    data = machine(axes__x__model__coulomb_friction__slope_s_m=math.inf)
    loaded = load(write(tmp_path, data))
    plain = json.loads(json.dumps(loaded.resolved, allow_nan=False))
    assert load_resolved(plain).axes["x"].model.effects[2].options.slope_s_m == math.inf


def test_a_log_is_read_where_its_driver_is_not_installed(bench):
    plain = json.loads(json.dumps(bench.resolved))
    plain["drivers"]["line"] |= {"type": "elsewhere:Driver", "ip": "10.0.0.1"}
    found = load_resolved(plain, "run.parquet")
    assert found.axes["x"].model.names == bench.axes["x"].model.names
    assert found.drivers == {}
    assert found.resolved == plain
    with pytest.raises(ConfigError, match=r"run\.parquet: drivers.line.type: .*elsewhere"):
        load_resolved(plain, "run.parquet", hardware=True)


def test_a_log_is_read_where_its_file_of_points_is_gone(tmp_path):
    points = tmp_path / "points.csv"
    rows = [f"{t / 100},{0.05 * (1 - math.cos(t / 100 * math.pi))}" for t in range(201)]
    points.write_text("time_s,x_m\n" + "\n".join(rows) + "\n")
    data = machine(programs__rec={"kind": "points", "axes": ["x"], "file": "points.csv"})
    loaded = load(write(tmp_path, data | {"name": "points"}))
    assert set(load_resolved(loaded.resolved).programs) == {"there", "rec"}
    points.unlink()
    assert set(load_resolved(loaded.resolved).programs) == {"there"}


def test_loading_a_log_changes_nothing_in_it(bench):
    plain = json.loads(json.dumps(bench.resolved))
    before = json.dumps(plain)
    load_resolved(plain)
    assert json.dumps(plain) == before


def test_a_broken_resolved_document_is_told_by_key_without_a_line(bench):
    plain = json.loads(json.dumps(bench.resolved))
    drop(plain, "axes.x.gains.ks_v_s_m")
    with pytest.raises(ConfigError) as raised:
        load_resolved(plain, "run.parquet")
    (told,) = raised.value.problems
    assert (told.file, told.line, told.key) == ("run.parquet", None, "axes.x.gains.ks_v_s_m")


def test_what_the_records_are_given_are_keys_of_an_axis():
    axis = load("published_gantry").axes["x"]
    late = load("published_gantry").drivers["gantry"].late
    learning = axis.gains.flat() | axis.limits.flat() | axis.adaptation.flat()
    moving = axis.limits.flat() | axis.encoder.flat() | axis.homing.flat() | late.flat()
    for fields, given in ((LAW_GIVEN, learning), (AXIS_GIVEN, moving)):
        assert {name for name, _ in fields} <= set(given)
    assert moving["stop_jerk_m_s3"] == axis.limits.stop.jerk_m_s3
    assert moving["following_error_minimum_m"] == axis.limits.following_error.minimum_m


def test_a_field_that_nobody_gives_is_no_silent_zero():
    record = np.zeros(1, [("gain", "f8"), ("limit", "f8"), ("forgotten", "f8")])[0]
    fill_by_name(record, ("gain", "limit"), {"gain": 2.0, "limit": None, "other": 1.0})
    assert (record["gain"], record["limit"]) == (2.0, math.inf)
    with pytest.raises(KeyError, match="forgotten"):
        fill_by_name(record, ("forgotten",), {"gain": 2.0})


def test_the_shipped_schema_is_up_to_date():
    shipped = json.loads((shipped_config(SHIPPED[0]).parent / "motorctl.schema.json").read_text())
    assert shipped == config_schema(), "motorctl check --schema > configs/motorctl.schema.json"


def test_the_schema_knows_every_effect_and_refuses_its_misspellings():
    schema = config_schema()
    model = schema["$defs"]["AxisKeys"]["properties"]["model"]
    assert set(model["properties"]) == set(known_effects())
    assert model["additionalProperties"] == {"$ref": "#/$defs/EffectKeys"}
    assert schema["$defs"]["EffectKeys"]["required"] == ["type"]
    friction = schema["$defs"]["effect_coulomb_friction"]
    assert "slope_s_m" in friction["properties"]
    assert friction["additionalProperties"] is False


def test_every_key_of_the_schema_is_described():
    def undescribed(part, where):
        if isinstance(part, list):
            part = dict(enumerate(part))
        if isinstance(part, dict):
            for key, value in part.items():
                if key == "if":
                    continue  # a condition, which describes nothing
                if key == "properties":
                    yield from (f"{where}.{k}" for k, v in value.items() if "description" not in v)
                yield from undescribed(value, f"{where}.{key}")

    assert list(undescribed(config_schema(), "")) == []


def test_every_reference_in_the_schema_leads_somewhere():
    schema = config_schema()

    def references(part):
        if isinstance(part, dict):
            if "$ref" in part:
                yield part["$ref"]
            for item in part.values():
                yield from references(item)
        elif isinstance(part, list):
            for item in part:
                yield from references(item)

    found = set(references(schema))
    assert found
    assert {reference.removeprefix("#/$defs/") for reference in found} <= set(schema["$defs"])


def test_the_summary_tells_which_guarantees_hold():
    summary = summarise(load("published_gantry"))
    x, y = summary["axes"]["x"], summary["axes"]["y"]
    assert x["robust_gain"]["at_initial"]["satisfied"]
    assert not y["robust_gain"]["at_initial"]["satisfied"]
    assert all(corner["satisfied"] for corner in x["assumption_2"]["corners"])
    assert x["margins"][0]["phase_margin_deg"] == pytest.approx(59.6, abs=0.1)
    assert summary["programs"]["published_x"]["axes"]["x"]["max_acceleration_m_s2"] == (
        pytest.approx(35.6)
    )
    assert any("axis y: ks 95 is below" in note for note in summary["notes"])
    json.dumps(summary, allow_nan=False)


def test_a_corner_of_the_bounds_that_breaks_assumption_2_is_a_note_not_an_error(tmp_path):
    wide = {"initial": -0.0005, "bounds": [-0.01, 0.0]}
    summary = summarise(load(write(tmp_path, machine(axes__x__model__em_cubic=wide))))
    assert any("Assumption 2 fails in 2 of 4 corners" in note for note in summary["notes"])


def test_a_command_filter_above_what_a_sampled_one_can_be_is_refused_with_its_key(tmp_path):
    text = shipped_config("published_gantry").read_text()
    before = "d_hat_max_v: 1, velocity: published}"
    path = tmp_path / "gantry.yaml"
    own = "command_filter: {kind: notch, frequency_hz: 2400}}"
    path.write_text(text.replace(before, f"{before[:-1]}, {own}", 1))
    with pytest.raises(ConfigError, match=r"axes\.x\.gains\.command_filter\.frequency_hz.*2250"):
        load(path)
