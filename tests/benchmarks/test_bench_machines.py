"""Machines of other hands: their recordings, what may be said of them, and the bench's subject."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from motorctl.errors import DataError, UsageError
from motorctl_benchmarks.command import bench
from motorctl_benchmarks.diagnosis.answer import Answer, Named
from motorctl_benchmarks.measure import measure
from motorctl_benchmarks.other_machines import generators, run_machine
from motorctl_benchmarks.other_machines.clean_machines import (
    CLEAN_KINDS,
    FRICTIONS,
    NOISES,
    unevenly_recorded,
)
from motorctl_benchmarks.other_machines.figures import (
    judgements,
    lines_by_generator,
    machine_figures,
)
from motorctl_benchmarks.other_machines.findings import (
    MachinesOptions,
    machine_findings,
    machine_mistakes,
)
from motorctl_benchmarks.other_machines.generators import (
    LOADERS,
    Generator,
    MachineKey,
    clean_keys,
    generator,
    machine_keys,
    parse_machine_key,
    usable_generators,
)
from motorctl_benchmarks.other_machines.machine_recording import MachineRecording
from motorctl_benchmarks.other_machines.mistakes import MISTAKES
from motorctl_benchmarks.other_machines.run_machine import MachineOutcome, measured_of
from motorctl_benchmarks.other_machines.truth import truth_of

CHEAP = [
    ("energy", "cogging"),
    ("energy", "command_delay"),
    ("scipy_ode", "command_lag"),
    ("mujoco", "none"),
    ("mujoco", "gravity_sine"),
]
COLUMNS = ("time_s", "position", "command")


def need(name):
    if name not in usable_generators():
        pytest.skip(f"{name}: what it needs is not installed")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), CHEAP)
def test_the_same_kind_and_seed_make_the_same_finite_recording(name, kind):
    need(name)
    first, again = (generator(name).machine(kind, 7) for _ in range(2))
    for column in COLUMNS:
        values = getattr(first, column)
        assert values.shape == first.time_s.shape
        assert np.isfinite(values).all()
        assert np.array_equal(values, getattr(again, column))
    assert first.story == again.story
    assert first.kind == kind
    assert first.time_s[-1] - first.time_s[0] > 10.0


@pytest.mark.slow
def test_another_seed_makes_another_machine():
    first, second = (generator("energy").machine("cogging", seed) for seed in (7, 8))
    assert first.story != second.story
    assert not np.array_equal(first.position[:5000], second.position[:5000])


@pytest.mark.parametrize("name", LOADERS)
def test_of_every_kind_something_is_known(name):
    need(name)
    kinds = generator(name).kinds
    groups = {kind: truth_of(kind).group for kind in kinds}
    assert set(groups.values()) == {"known", "outside", "clean"}
    assert {truth_of(kind).group for kind in MISTAKES} == {"mistake"}
    assert groups["none"] == groups["gravity_constant"] == "clean"
    assert groups["cogging"] == "known"
    assert groups["backlash_motor"] == groups["voltage_clipping"] == "known"
    assert groups["eddy_brake"] == "outside"
    assert all(groups[kind] == "outside" for kind in kinds if kind.startswith("unknown_"))


def answer(verdict, *names, sure=0.95):
    """Name effects; a|b is a, indistinguishable from b."""
    named = []
    for name in names:
        first, *twins = name.split("|")
        named.append(Named(first, sure, tuple(twins)))
    return Answer(verdict, tuple(named))


@pytest.mark.parametrize(
    ("kind", "given", "right", "judged"),
    [
        ("cogging", answer("effect", "cogging"), True, "named"),
        ("cogging", answer("unknown_structure", "cogging"), True, "named"),
        ("cogging", answer("effect", "position_force"), True, "family"),
        ("cogging", answer("effect", "cogging", "hard_stop"), True, "family"),
        ("cogging", answer("effect", "stribeck"), False, "false"),
        ("cogging", answer("effect", "cogging", "stribeck"), False, "named and false"),
        ("cogging", answer("effect", "stribeck|cogging"), False, "named and false"),
        ("cogging", answer("complete"), False, "complete"),
        ("cogging", answer("unknown_structure"), False, "unknown_structure"),
        ("cogging", answer("failed"), False, "failed"),
        ("current_saturation", answer("effect", "em_cubic"), True, "named"),
        ("current_saturation", answer("effect", "em_cubic", "em_quadratic"), True, "named"),
        ("current_saturation", answer("effect", "dead_zone"), True, "family"),
        ("measurement_ripple", answer("effect", "cogging"), False, "false"),
        ("warming_friction", answer("effect", "gain_drift"), True, "family"),
        ("warming_friction", answer("effect", "stribeck"), True, "family"),
        ("payload_step", answer("effect", "stribeck"), False, "false"),
        ("asymmetric_friction", answer("complete"), True, "complete"),
        ("asymmetric_friction", answer("insufficient_data"), True, "insufficient_data"),
        ("asymmetric_friction", answer("unknown_structure"), False, "unknown_structure"),
        ("asymmetric_friction", answer("complete", "cogging"), False, "false"),
        ("flexible_load", answer("effect", "flexible_mode"), True, "named"),
        ("flexible_load", answer("unknown_structure"), True, "unknown_structure"),
        ("flexible_load", answer("complete"), False, "complete"),
        ("flexible_motor", answer("unknown_structure"), False, "unknown_structure"),
        ("voltage_clipping", answer("unknown_structure"), False, "unknown_structure"),
        ("voltage_clipping", answer("effect", "em_cubic"), True, "family"),
        ("voltage_clipping", answer("effect", "cogging"), False, "false"),
        ("eddy_brake", answer("effect", "quadratic_drag"), True, "family"),
        ("eddy_brake", answer("complete"), False, "complete"),
        ("backlash_motor", answer("effect", "flexible_mode"), False, "false"),
        ("backlash_motor", answer("unknown_structure", "backlash"), True, "named"),
        ("backlash_motor", answer("unknown_structure"), False, "unknown_structure"),
        ("backlash_load", answer("unknown_structure"), True, "unknown_structure"),
        ("unknown_shaker", answer("unknown_structure"), True, "unknown_structure"),
        ("unknown_shaker", answer("unknown_structure", "cogging"), False, "false"),
        ("unknown_shaker", answer("effect", "periodic_disturbance"), True, "named"),
        ("unknown_shaker", answer("insufficient_data"), False, "insufficient_data"),
        ("none", answer("complete"), True, "complete"),
        ("none", answer("insufficient_data"), True, "insufficient_data"),
        ("none", answer("unknown_structure"), False, "unknown_structure"),
        ("gravity_constant", answer("effect", "gravity"), False, "false"),
    ],
)
def test_an_answer_is_scored_by_what_may_be_said_of_its_kind(kind, given, right, judged):
    truth = truth_of(kind)
    assert truth.right(given) is right
    assert truth.judged(given) == judged


@pytest.mark.parametrize(("generator", "right"), [("scipy_ode", True), ("mujoco", False)])
def test_a_current_loop_that_a_generator_simulates_beside_the_limit_is_no_false_name(
    generator, right
):
    """One of 700 Hz is a lag of 0.23 ms: so much was named on such machines."""
    both = answer("effect", "voltage_clipping", "input_lag")
    assert truth_of("voltage_clipping", generator).right(both) is right


def outcome(kind, given, seed=1, result="answered", name="energy"):
    return MachineOutcome(MachineKey(name, kind, seed), result, given)


def figures(outcomes):
    return {figure.name: figure for figure in machine_figures(outcomes)}


def test_every_group_has_its_share_and_its_target():
    found = figures(
        [
            outcome("cogging", answer("effect", "cogging")),
            outcome("cogging", answer("effect", "position_force", sure=0.8), name="mujoco"),
            outcome("stribeck", answer("effect", "cogging", sure=0.85)),
            outcome("stribeck", Answer("failed", failure="DataError: short"), result="refused"),
            outcome("eddy_brake", answer("unknown_structure")),
            outcome("unknown_shaker", answer("effect", "cogging", "stribeck")),
            outcome("none", answer("unknown_structure")),
            outcome("none", answer("complete")),
        ]
    )
    assert {name: figure.value for name, figure in found.items()} == {
        "known": 50.0,
        "known_exact": 25.0,
        "outside": 50.0,
        "clean": 100.0,
        "clean_said": 50.0,
        "false_names": pytest.approx(200.0 / 3.0),
        "false_cases": 12.5,
        "refused": 1.0,
        "crashed": 0.0,
        "calibration_error": pytest.approx(100.0 * (2 * 0.825 + 3 * (0.95 - 1 / 3)) / 5),
    }
    assert found["known"].met is False
    assert found["known_exact"].target is None
    assert found["outside"].met is False
    assert found["clean"].met is True
    assert found["false_cases"].met is False
    assert found["crashed"].met is True


def test_a_crash_misses_its_target_and_groups_without_machines_are_left_out():
    crash = outcome("none", Answer("failed", failure="ValueError: no"), result="crashed")
    found = figures([crash])
    assert found["crashed"].met is False
    assert not found.keys() & {"known", "outside"}
    assert judgements([crash, crash]) == {"none": {"crashed": 2}}


def test_each_generator_is_told_apart_and_mistakes_can_be_run_again():
    wrong = outcome("cogging", answer("complete"), seed=50_004)
    right = outcome("cogging", answer("effect", "position_force"), name="scipy_ode")
    (row,) = machine_mistakes([wrong, right])
    assert parse_machine_key(row["case"]) == wrong.key
    assert (row["truth"], row["answer"]) == ("cogging", "complete, named nothing")
    first, second = lines_by_generator([wrong, right])
    assert first.startswith("energy: known effects: named or family (of 1): 0 %;")
    assert second.startswith("scipy_ode: known effects: named or family (of 1): 100 %;")


def recording(count=2000, unit="N m"):
    time_s = 2.0 + np.arange(count) * 1e-3
    return MachineRecording(
        generator="hand-made",
        kind="cogging",
        story="a story",
        time_s=time_s,
        position=np.sin(time_s),
        command=np.cos(time_s),
        reference=None,
        position_unit="rad",
        command_unit=unit,
        resolution=1e-6,
        friction_shape="tanh",
        noise=0,
    )


def test_the_diagnosis_gets_columns_and_units_and_no_cause():
    given = recording()
    data = measured_of(given, "energy:x")
    assert data.sample_rate_hz == 1000.0
    assert np.allclose(data.time_s, given.time_s, atol=1e-9)
    assert (data.position_unit, data.command_unit) == ("rad", "N*m")
    assert data.reference is None
    assert data.usable.all()
    assert measured_of(recording(unit="V"), "x").command_unit == "V"
    assert not {"cogging", "a story", "tanh"} & {str(value) for value in vars(data).values()}


def fails_with(error):
    def fail(*_arguments, **_settings):
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "result"),
    [
        (DataError("too short"), "refused"),
        (UsageError("no such axis"), "refused"),
        (ValueError("array is\nempty"), "crashed"),
    ],
)
def test_a_diagnosis_that_fails_is_the_outcome_of_its_case(monkeypatch, error, result):
    monkeypatch.setattr(
        run_machine, "generator", lambda _: Generator(("cogging",), lambda *_: recording())
    )
    monkeypatch.setattr(run_machine, "diagnose_axis", fails_with(error))
    found = run_machine.run_machine(MachineKey("energy", "cogging", 1))
    assert found.result == found.judged == result
    assert not found.right
    assert str(found) == f"{result}: {type(error).__name__}: {' '.join(str(error).split())}"
    assert bool(found.traceback) is (result == "crashed")
    json.dumps(found.document(), allow_nan=False)


def test_a_generator_that_fails_is_no_fault_of_the_diagnosis(monkeypatch):
    broken = Generator(("cogging",), fails_with(RuntimeError("the solver failed")))
    monkeypatch.setattr(run_machine, "generator", lambda _: broken)
    found = run_machine.run_machine(MachineKey("energy", "cogging", 1))
    assert found.result == "not recorded"
    assert "the solver failed" in str(found)


def test_a_generator_whose_library_is_absent_is_left_out(monkeypatch):
    monkeypatch.setitem(generators.NEEDS, "mujoco", "no_such_engine")
    assert usable_generators() == ("energy", "scipy_ode")
    assert {key.generator for key in machine_keys(1, 0)} == {"energy", "scipy_ode"}
    with pytest.raises(UsageError, match=r"no_such_engine is not installed \(pip install"):
        parse_machine_key("mujoco:none:1")


def test_so_many_seeds_of_every_kind_are_drawn():
    keys = [key for key in machine_keys(3, 50_000) if key.generator == "energy"]
    assert len(keys) == len(set(keys)) == 3 * (len(generator("energy").kinds) + len(MISTAKES))
    assert {key.seed for key in keys} == {50_000, 50_001, 50_002}
    assert parse_machine_key(str(keys[-1])) == keys[-1]


def test_clean_machines_have_each_friction_with_each_noise_of_every_generator():
    keys = clean_keys(200, 870)
    assert len(keys) == len(set(keys)) == 200
    assert all(truth_of(key.kind).group == "clean" for key in keys)
    first = keys[: len(usable_generators()) * len(FRICTIONS) * len(NOISES)]
    assert {key.kind for key in first} == set(CLEAN_KINDS)
    assert {key.seed for key in first} == {870}
    assert {key.generator for key in first} == set(usable_generators())
    assert parse_machine_key(str(keys[-1])) == keys[-1]


@pytest.mark.slow
def test_a_clean_machine_to_order_has_its_friction_and_noise():
    drawn, _ = run_machine._recorded(MachineKey("energy", "clean_arctan_coarse", 3))
    assert (drawn.friction_shape, drawn.noise) == ("arctan", NOISES["coarse"])


@pytest.mark.parametrize(("seed", "how"), [(2, "taken unevenly"), (4, "stamped late")])
def test_uneven_samples_come_through_the_reader_of_files(seed, how):
    count = 12_000
    time_s = np.arange(count) * 1e-3
    position = np.round(0.1 * np.sin(2.0 * time_s) / 1e-6) * 1e-6
    given = replace(recording(count), time_s=time_s, position=position, position_unit="m")
    data, told = unevenly_recorded(given, seed)
    assert told.startswith(f"samples {how}")
    assert not data.usable.all()
    assert (data.position_unit, data.command_unit, data.resolution) == ("m", "N*m", 1e-6)
    there = np.interp(data.time_s, time_s, position)
    apart = 3e-6 if how == "taken unevenly" else 0.2 * 1.5e-3  # of a stamp that is late
    assert np.max(np.abs(data.position - there)[data.usable][5:-5]) < apart
    again, _ = unevenly_recorded(given, seed)
    assert np.array_equal(data.position, again.position)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "one:50000"], "GENERATOR:KIND:SEED"),
        (["--only", "energy:cogging"], "GENERATOR:KIND:SEED"),
        (["--only", "energy:cogging:-1"], "GENERATOR:KIND:SEED"),
        (["--only", "steam:cogging:1"], "generators are energy, scipy_ode, mujoco"),
        (["--only", "energy:warp:1"], "energy makes no 'warp'; it makes none, gravity_constant"),
        (["--only", "energy:none:1", "--cases", "2"], "--only names the cases"),
        (["--only", "energy:none:1", "--seed", "2"], "--only names the cases"),
        (["--only", "energy:none:1", "--clean", "2"], "--only names the cases"),
        (["--cases", "2", "--clean", "2"], "only one of the two"),
    ],
)
def test_options_that_say_nothing_of_machines_are_refused(arguments, words):
    result = CliRunner().invoke(bench, ["machines", *arguments])
    assert isinstance(result.exception, UsageError)
    assert words in str(result.exception)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_machine_of_each_generator_is_answered(tmp_path):
    keys = tuple(MachineKey(name, "cogging", 50_000) for name in usable_generators())
    out, shares = tmp_path / "machines.jsonl", []
    plot = tmp_path / "reliability.png"
    options = MachinesOptions(workers=2, out=out, plot=plot, only=keys)
    result = measure("machines", partial(machine_findings, options=options), shares.append)
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert shares[-1] == 1.0
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    assert {row["generator"] for row in rows} == set(usable_generators())
    assert all(row["answer"]["verdict"] != "failed" for row in rows)
    assert {"known", "false_cases", "crashed"} <= {figure.name for figure in result.found.figures}
    assert {row["case"] for row in result.found.mistakes} <= {str(key) for key in keys}
    json.dumps(result.document()["judged"])


@pytest.mark.slow
def test_the_stairs_of_a_coarse_encoder_hide_no_lag():
    outcome = run_machine.run_machine(MachineKey("scipy_ode", "command_lag", 920))
    assert outcome.noise == 3
    assert outcome.right, str(outcome)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "named"),
    [
        # friction that only turns over more steeply than declared, beside a ripple of the thrust
        (MachineKey("energy", "force_ripple", 860), {"force_ripple"}),
        # the contact yields by three counts of a coarse encoder, which dry friction would not
        (MachineKey("scipy_ode", "presliding", 901), {"presliding"}),
        # friction that turns over otherwise than declared, to which Stribeck's bends itself
        pytest.param(
            MachineKey("scipy_ode", "stribeck", 3200), {"stribeck"}, marks=pytest.mark.long
        ),
        # friction of another shape beside a payload: Stribeck's would decay within its corner
        pytest.param(
            MachineKey("energy", "payload_step", 3400), {"payload_change"}, marks=pytest.mark.long
        ),
        # dry friction that holds the axis at its turns, for 10 to 50 ms
        (MachineKey("mujoco", "none", 2900), set()),
    ],
    ids=str,
)
def test_the_corner_of_any_friction_is_no_effect(key, named):
    assert set(run_machine.run_machine(key).answer.names) == named


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["none", "gravity_constant"])
def test_turns_that_dry_friction_sharpens_are_no_missing_effect(kind):
    """What smoothing leaves of such turns, the clean twin's leave as well."""
    outcome = run_machine.run_machine(MachineKey("mujoco", kind, 3500))
    assert outcome.answer.verdict == "complete", str(outcome.answer)


LATE, STUCK = "mistake_late_command", "mistake_stuck_encoder"


def said(*notes, failure="", named=()):
    given = answer("failed" if failure else "effect", *named)
    return replace(given, failure=failure, notes=notes)


@pytest.mark.parametrize(
    ("given", "right", "misleads"),
    [
        (said("the motion answers to the command 6 ms before it was recorded"), True, False),
        (said(failure="DataError: the position freezes at 3 s"), False, True),
        (said("a note", named=("input_delay",)), False, True),
        (said("a note"), False, False),
        (said(failure="DataError: too short"), False, False),
    ],
)
def test_a_mistake_is_told_or_missed_or_taken_for_something_else(given, right, misleads):
    result = "refused" if given.failure else "answered"
    case = outcome(LATE, given, result=result)
    assert (case.right, not case.right and case.misleads) == (right, misleads)


def test_mistakes_have_figures_of_their_own_and_count_in_no_other():
    told = outcome(LATE, said("6 ms before it was recorded", named=("input_delay",)))
    missed = outcome(STUCK, answer("effect", "payload_change"), seed=2)
    found = figures([told, missed, outcome("none", answer("complete"))])
    assert (found["mistakes_told"].value, found["mistakes_misled"].value) == (50.0, 50.0)
    assert found["false_cases"].value == 0.0
    assert found["clean"].value == 100.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_that_users_make_is_told(kind):
    # a coarse encoder, as that of machine 7, hides milliseconds
    case = run_machine.run_machine(MachineKey("energy", kind, 840 if kind == LATE else 7))
    assert case.right, str(case)


@pytest.mark.slow
def test_a_motor_that_weakens_with_its_heat_is_not_called_a_payload():
    """Its loss shows as an effect of the input, which has no place where the command is left."""
    found = run_machine.run_machine(MachineKey("scipy_ode", "unknown_winding_heat", 900))
    assert "payload_change" not in found.answer.names, found
    assert found.right, found


@pytest.mark.slow
def test_a_limit_of_the_supply_that_few_moves_meet_is_named():
    found = run_machine.run_machine(MachineKey("scipy_ode", "voltage_clipping", 900))
    assert found.answer.names == {"voltage_clipping"}, found
