import dataclasses

import numpy as np
import pytest
import yaml
from refine_bench import (
    DELAY_S,
    LAG_S,
    PITCH_M,
    THETA,
    axis_diagnosis,
    cogging,
    effect,
    found,
    gantry_diagnosis,
    gantry_log,
    true_effects,
)

from motorctl.config import load
from motorctl.config.analysis import smallest_slope
from motorctl.config.shipped import shipped_config
from motorctl.errors import DataError, UsageError
from motorctl.identify.columns.measured import measured
from motorctl.identify.diagnose.result import RecordingDiagnosis, UnknownStructure
from motorctl.identify.refine.admissible import admissible
from motorctl.identify.refine.model_error import made_up_for
from motorctl.identify.refine.refinement import refine_config
from motorctl.identify.same_axis import require_same_machine
from motorctl.log import read_recording
from motorctl.model import EffectList

SHIPPED = shipped_config("published_gantry")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return gantry_log(tmp_path_factory.mktemp("log"))


@pytest.fixture(scope="module")
def diagnosis(log):
    return gantry_diagnosis(log)


@pytest.fixture(scope="module")
def refined(diagnosis, tmp_path_factory):
    return refine_config(diagnosis, SHIPPED, tmp_path_factory.mktemp("refined") / "n.yaml")


def estimates(machine, axis):
    model = machine.axes[axis]
    return dict(zip(model.model.parameter_names, model.estimates, strict=True))


def test_what_was_found_is_in_the_configuration_that_is_written(refined):
    machine = load(refined.write())
    for name, axis in machine.axes.items():
        assert axis.model.names[-3:] == ("cogging", "input_lag", "input_delay")
        assert axis.model.lag_s == pytest.approx(LAG_S)
        assert axis.model.delay_s == pytest.approx(DELAY_S[name])
        known = estimates(machine, name)
        for parameter, value in zip(axis.model.parameter_names, THETA[name], strict=False):
            assert known[parameter].initial == pytest.approx(value)
        made, theta = cogging(name)
        for parameter, value in zip(made.parameters, theta, strict=True):
            assert known[f"cogging_{parameter.name}"].initial == pytest.approx(value, abs=1e-6)


def test_bounds_are_five_standard_errors_or_thirty_percent_wide(log, tmp_path):
    def vague(axis):
        made, theta = cogging(axis)
        errors = np.full(len(theta), 0.1)
        return (found(made, theta, std_error=errors),)

    wide = gantry_diagnosis(log, vague, std_error=np.array([0.0] * 6 + [0.1] * 6))
    known = estimates(refine_config(wide, SHIPPED, tmp_path / "w.yaml").machine, "y")
    sine = known["cogging_sin_1"]
    assert sine.upper - sine.initial == pytest.approx(0.5, rel=1e-3)
    assert sine.initial - sine.lower == pytest.approx(0.5, rel=1e-3)
    inertia = known["inertia"]
    assert inertia.upper == pytest.approx(1.3 * THETA["y"][0], rel=1e-3)
    assert inertia.lower == pytest.approx(0.7 * THETA["y"][0], rel=1e-3)


def test_a_small_cosine_may_move_as_far_as_its_sine(refined):
    known = estimates(refined.machine, "y")
    cosine = known["cogging_cos_1"]  # of a wave of 0.34 V
    assert cosine.upper - cosine.lower >= 2 * 0.3 * 0.33


def test_the_rest_of_the_file_stays_as_its_author_wrote_it(refined):
    old, new = SHIPPED.read_text().splitlines(), refined.text.splitlines()
    removed = [line for line in old if line not in new]
    values = ("inertia:", "_friction:", "offset:", "em_quadratic:", "em_cubic:")
    assert removed
    assert all(line.strip().startswith(values) or "_friction:" in line for line in removed)
    assert "    controller: *controller" in new
    assert "    # C2 compensates the electromagnetic nonlinearity. Write C1 here for" in (
        "\n".join(new)
    )
    for line in refined.diff.splitlines():
        assert not line.startswith("-") or line.startswith("---") or line[1:] in removed


def test_every_added_number_says_its_unit(refined):
    text = refined.text
    for key, unit in (("pitch_m", "m"), ("sin_1", "V"), ("time_s", "s")):
        lines = [line for line in text.splitlines() if line.strip().startswith(f"{key}:")]
        assert lines
        assert all(line.partition("#")[2].split()[0] == unit for line in lines)


def test_the_header_tells_what_was_found_and_what_it_is_worth(refined):
    text = refined.text
    head = text[: text.index("name: published-gantry")]
    for words in ("run.parquet", "cogging", "input_lag", "0.2 -> 0.02 V rms", "0.018 V"):
        assert words in head
    assert text.startswith("# yaml-language-server")


def test_the_force_is_told_where_the_force_constant_is_known(diagnosis, tmp_path):
    x = diagnosis.axes["x"]
    data = dataclasses.replace(x.data, force_per_command=69.0)
    axes = {"x": dataclasses.replace(x, data=data)}
    known = dataclasses.replace(diagnosis, axes=axes)
    assert "13.8 -> 1.38 N" in refine_config(known, SHIPPED, tmp_path / "n.yaml").text


def test_the_same_diagnosis_gives_the_same_text(refined, diagnosis, tmp_path):
    assert refine_config(diagnosis, SHIPPED, tmp_path / "n.yaml").text == refined.text


def test_an_axis_that_was_not_diagnosed_stays_as_it_is(log, tmp_path):
    alone = gantry_diagnosis(log, axes=("y",))
    machine = refine_config(alone, SHIPPED, tmp_path / "n.yaml").machine
    before = load(SHIPPED)
    assert estimates(machine, "x") == estimates(before, "x")
    assert machine.axes["x"].model.names == before.axes["x"].model.names
    assert "cogging" in machine.axes["y"].model.names


@pytest.mark.slow
def test_a_model_that_two_axes_share_is_written_out_for_each(log, tmp_path):
    keys = yaml.safe_load(SHIPPED.read_text())
    model = keys["axes"]["x"]["model"]
    shared = tmp_path / "shared.yaml"
    keys["axes"]["y"]["model"] = model  # the dumper writes an anchor and an alias
    keys["programs"] = {}
    for axis in keys["axes"].values():
        del axis["program"]
    shared.write_text(yaml.safe_dump(keys, sort_keys=False))
    assert "model: *" in shared.read_text()
    for axis, other in (("x", "y"), ("y", "x")):
        alone = gantry_diagnosis(log, axes=(axis,))
        machine = refine_config(alone, shared, tmp_path / f"{axis}.yaml").machine
        assert "cogging" in machine.axes[axis].model.names
        assert "cogging" not in machine.axes[other].model.names
        assert estimates(machine, other) == estimates(load(shared), other)
    both = refine_config(gantry_diagnosis(log), shared, tmp_path / "both.yaml").machine
    assert estimates(both, "y")["inertia"].initial == THETA["y"][0]
    assert estimates(both, "x")["inertia"].initial == THETA["x"][0]


@pytest.mark.slow
def test_effects_in_any_style_are_refined(log, tmp_path):
    text = SHIPPED.read_text()
    lines = text.splitlines()
    offset = next(k for k, line in enumerate(lines) if line.strip().startswith("offset:"))
    lines[offset] = "      offset:   # as the effect has it"
    config = tmp_path / "null.yaml"
    config.write_text("\n".join(lines) + "\n")
    alone = gantry_diagnosis(log, axes=("x",))
    machine = refine_config(alone, config, tmp_path / "n.yaml").machine
    assert estimates(machine, "x")["offset"].initial == pytest.approx(THETA["x"][3])
    as_json = tmp_path / "flow.yaml"
    as_json.write_text(yaml.safe_dump(yaml.safe_load(text), default_flow_style=True, width=10**6))
    machine = refine_config(alone, as_json, tmp_path / "n.yaml").machine
    assert machine.axes["x"].model.names[-1] == "input_delay"


def test_files_of_points_are_found_from_the_new_place(diagnosis, tmp_path):
    config, new = tmp_path / "gantry.yaml", tmp_path / "deep" / "new.yaml"
    new.parent.mkdir()
    (tmp_path / "way.csv").write_text("time_s,x_m\n" + "".join(f"{k / 10},0\n" for k in range(20)))
    lines = SHIPPED.read_text().replace(
        "programs:\n", "programs:\n  way: {kind: points, axes: [x], file: way.csv}\n"
    )
    config.write_text(lines)
    refined = refine_config(diagnosis, config, new)
    assert "way" in refined.machine.programs
    assert "file: ../way.csv" in refined.text


@pytest.mark.slow
def test_an_input_map_that_turns_back_is_drawn_in_until_it_can_be_inverted(log, tmp_path):
    recording = read_recording(log)
    declared = load(SHIPPED).axes["x"].declared
    theta = (*THETA["x"][:4], -0.03, -0.003)  # dv/du at 10 V is -0.5
    bent = RecordingDiagnosis(
        "run", 5000.0, 5.0,
        {"x": axis_diagnosis(measured(recording, "x"), declared, true_effects("x"), theta)},
    )  # fmt: skip
    refined = refine_config(bent, SHIPPED, tmp_path / "n.yaml")
    axis = refined.machine.axes["x"]
    start = np.array([estimate.initial for estimate in axis.estimates])
    assert smallest_slope(axis.model, start, 10.0, axis.limits.travel_m)[0] >= 0.05
    assert "not monotonic" in refined.text
    # It is drawn towards what was declared, and may go on in either direction.
    for name, estimate in estimates(refined.machine, "x").items():
        if name.startswith("em_"):
            assert estimate.lower < estimate.initial < estimate.upper


def test_what_does_not_follow_an_input_map_that_is_drawn_in_stays_with_its_bounds():
    axis = load(SHIPPED).axes["x"]
    bent = [
        dataclasses.replace(e, initial=value, lower=value - 1e-4, upper=value + 3e-4)
        for e, value in zip(axis.estimates, (*THETA["x"][:4], -0.03, -0.003), strict=True)
    ]
    drawn, notes = admissible(axis, axis.model, bent, axis.estimates, [])
    assert "not monotonic" in notes[0]
    assert drawn[:4] == bent[:4]
    assert drawn[4:] != bent[4:]


@pytest.mark.slow
def test_what_was_fitted_with_an_input_map_follows_it_where_that_is_drawn_in(log, tmp_path):
    data = measured(read_recording(log), "y")
    machine = load(SHIPPED)
    declared = machine.axes["y"].declared
    true = np.array(THETA["y"])
    change = np.array([0.0, 0.0, 0.0, 0.0, -0.022, -0.0019]) - [0.0, 0.0, 0.0, 0.0, *true[4:]]
    # As a fit does whose recording hardly tells the input map: the others make up for it.
    fitted = true + made_up_for(data, declared, change, range(4))
    bent = RecordingDiagnosis(
        "run", 5000.0, 5.0, {"y": axis_diagnosis(data, declared, true_effects("y"), fitted)}
    )
    refined = refine_config(bent, SHIPPED, tmp_path / "n.yaml")
    start = np.array([e.initial for e in refined.machine.axes["y"].estimates])
    assert (np.abs(start[:3] - true[:3]) < 0.5 * np.abs(fitted[:3] - true[:3])).all()
    assert "and the others make up for it" in " ".join(refined.text.split())


@pytest.mark.slow
def test_ripple_and_dead_zone_can_be_started_with(log, tmp_path):
    def rippled(axis):
        ripple = effect("force_ripple", pitch_m=PITCH_M, orders=(1, 2))
        zone = effect("dead_zone", half_width_v=0.2)
        return found(ripple, (0.2, 0.1, 0.05, 0.0)), found(zone, (0.19,))

    machine = refine_config(
        gantry_diagnosis(log, rippled, ("x",)), SHIPPED, tmp_path / "n.yaml"
    ).machine
    assert set(machine.axes["x"].model.names) >= {"force_ripple", "dead_zone"}


@pytest.mark.slow
def test_a_complete_model_is_fitted_anew_only_where_that_helps(log, tmp_path):
    def nothing(_):
        return ()

    # The shipped start values are off: fitted ones leave less of the command.
    better = refine_config(gantry_diagnosis(log, nothing), SHIPPED, tmp_path / "n.yaml")
    assert better.changed
    assert all(axis.refined_error_v < axis.start_error_v for axis in better.axes.values())
    better.write()
    again = refine_config(gantry_diagnosis(log, nothing), better.out, tmp_path / "m.yaml")
    assert not again.changed
    assert all("unchanged" in axis.done[0] for axis in again.axes.values())
    assert estimates(again.machine, "x") == estimates(better.machine, "x")


@pytest.mark.slow
@pytest.mark.parametrize("verdict", ["insufficient_data", "unknown_structure"])
def test_nothing_is_injected_where_nothing_that_helps_was_found(log, tmp_path, verdict):
    # the declared parameters are bent then by what is missing
    told = gantry_diagnosis(log, lambda _: (), verdict=verdict)
    refined = refine_config(told, SHIPPED, tmp_path / "n.yaml")
    assert not refined.changed
    assert estimates(refined.machine, "x") == estimates(load(SHIPPED), "x")
    assert "told in one sentence" in refined.text


@pytest.mark.slow
def test_a_spline_compensates_what_has_no_name(log, tmp_path):
    spline = effect("position_force", knots=(0.012345678912, 0.4, 8))
    theta = np.linspace(-0.1, 0.1, len(spline.parameters))
    unknown = UnknownStructure(
        ("position",), "a force of the position", spline, spline.family(), theta, theta, 0.9
    )
    x = gantry_diagnosis(log, lambda _: (), axes=("x",), verdict="unknown_structure").axes["x"]
    x = dataclasses.replace(
        x,
        unknown=unknown,
        model=EffectList([*x.model.effects, spline]),
        theta=np.append(x.theta, theta),
        std_error=np.append(x.std_error, 0.01 * np.abs(theta)),
    )
    told = RecordingDiagnosis("run", 5000.0, 5.0, {"x": x})
    machine = refine_config(told, SHIPPED, tmp_path / "n.yaml").machine
    known = estimates(machine, "x")
    assert known["position_force_knot_0"].initial == pytest.approx(-0.1)
    # a small coefficient is known no better than a large one
    assert known["position_force_knot_3"].upper - known["position_force_knot_3"].lower >= 0.06


@pytest.mark.slow
def test_splines_that_are_too_many_are_left_out_and_told(log, tmp_path):
    def crowded(_):
        force = effect("position_force", knots=(0.0, 0.4, 30))
        friction = effect("position_dependent_friction", knots=(0.0, 0.4, 40))
        drag = effect("quadratic_drag")
        return tuple(found(e, np.full(len(e.parameters), 0.01)) for e in (force, friction, drag))

    told = gantry_diagnosis(log, crowded, axes=("x",))
    refined = refine_config(told, SHIPPED, tmp_path / "n.yaml")
    added = refined.axes["x"].added
    assert added == ("position_force", "quadratic_drag")
    assert "position_dependent_friction is left out" in refined.text


def test_what_a_recording_could_not_carry_starts_at_zero(log, tmp_path):
    full = gantry_diagnosis(log, axes=("x",)).axes["x"]
    short = EffectList([e for e in full.declared.effects if e.name != "em_cubic"])
    x = axis_diagnosis(
        full.data, short, full.effects, THETA["x"][:5], dropped={"em_cubic": "too little voltage"}
    )
    told = RecordingDiagnosis("run", 5000.0, 5.0, {"x": x})
    refined = refine_config(told, SHIPPED, tmp_path / "n.yaml")
    assert estimates(refined.machine, "x")["em_cubic"].initial == 0.0
    assert "em_cubic starts at 0: too little voltage" in refined.text


def test_a_delay_that_was_known_is_not_counted_twice(log, tmp_path):
    config = tmp_path / "delayed.yaml"
    config.write_text(SHIPPED.read_text().replace("input_delay_s: 0\n", "input_delay_s: 4.0e-4\n"))
    refined = refine_config(gantry_diagnosis(log), config, tmp_path / "n.yaml")
    axis = refined.machine.axes["x"]
    assert axis.adaptation.input_delay_s == 0.0
    assert axis.model.delay_s == pytest.approx(DELAY_S["x"])


def test_an_effect_that_is_left_out_bends_no_other(log, tmp_path):
    refined = refine_config(
        gantry_diagnosis(log), SHIPPED, tmp_path / "n.yaml", without={"x": ["cogging"]}
    )
    names = refined.machine.axes["x"].model.names
    assert "cogging" not in names
    assert "input_lag" in names
    assert estimates(refined.machine, "x")["inertia"].initial == THETA["x"][0]


def test_a_configuration_that_would_not_be_valid_is_refused_and_nothing_written(log, tmp_path):
    recording = read_recording(log)
    declared = load(SHIPPED).axes["x"].declared
    light = (0.004, *THETA["x"][1:])  # the gains would be far too high
    told = RecordingDiagnosis(
        "run", 5000.0, 5.0,
        {"x": axis_diagnosis(measured(recording, "x"), declared, true_effects("x"), light)},
    )  # fmt: skip
    with pytest.raises(UsageError, match="unstable"):
        refine_config(told, SHIPPED, tmp_path / "n.yaml")
    assert list(tmp_path.iterdir()) == []


def test_a_recording_of_another_machine_is_refused(log):
    recording, machine = read_recording(log), load("published_gantry")
    require_same_machine(recording, machine, ["x", "y"])
    stage = load("small_stage")
    with pytest.raises(DataError, match=r"axis 'y' is not in the configuration"):
        require_same_machine(recording, stage, ["x", "y"])
    with pytest.raises(DataError, match=r"encoder\.resolution_m is 1e-07(.|\n)*travel_m"):
        require_same_machine(recording, stage, ["x"])


@pytest.mark.parametrize("units", [{"command_unit": "A"}, {"position_unit": "rad"}])
def test_other_units_than_a_configuration_s_are_refused(log, units):
    recording = read_recording(log)
    axes = {"x": dataclasses.replace(recording.axes["x"], **units)}
    other = dataclasses.replace(recording, axes=axes)
    with pytest.raises(UsageError, match="m and V"):
        require_same_machine(other, load("published_gantry"), ["x"])
