"""The rounds on the simulated stage, with diagnoses and tracking errors that are given.

How large an error a configuration has follows from what it declares; the model error is real.
"""

import dataclasses
import json

import numpy as np
import pytest
from refine_bench import axis_diagnosis, effect, found

from motorctl.close_loop import rounds as rounds_module
from motorctl.close_loop.attempts import Attempts, Proposal
from motorctl.close_loop.json_document import closed_loop_document, effects_added
from motorctl.close_loop.report import write_reports
from motorctl.close_loop.rounds import close_loop
from motorctl.close_loop.trial import Trial
from motorctl.config import load
from motorctl.errors import UsageError
from motorctl.identify.columns.measured import measured
from motorctl.identify.compare.measures import Measures
from motorctl.identify.diagnose.result import RecordingDiagnosis, UnknownStructure
from motorctl.log import read_recording
from motorctl.loop.simulation import simulate
from motorctl.model import EffectList

TRUTH = (0.05, 0.1, 0.08, 0.01, -0.004, -0.0002)
COGGING = found(
    effect("cogging", pitch_m=0.024, orders=(1, 2)),
    (0.02 * np.cos(0.5), 0.02 * np.sin(0.5), 0.03, 0.0),
    5000.0,
)
PRESLIDING = found(effect("presliding", displacement_m=5e-6), (0.08, 0.0), 800.0)
DRAG = found(effect("quadratic_drag"), (0.001,), 50.0)
SPLINE = effect("position_force", knots=(-0.06, 0.06, 6))
LEFT = {"cogging": 0.5, "presliding": 0.6, "quadratic_drag": 1.2, "position_force": 0.97}
"""Part of the tracking error that is left where an effect is declared."""


def quiet(what, share):
    assert 0.0 <= share <= 1.0


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    log = tmp_path_factory.mktemp("stage") / "run.parquet"
    simulate(load("small_stage"), log, duration_s=5.0)
    return read_recording(log)


@pytest.fixture
def given(monkeypatch, recording):
    """Let the rounds see this recording, errors that follow from the model, and no simulation."""

    def try_out(config, folder, names, motions, duration_s, rig, progress):
        machine = load(config)
        share = np.prod([LEFT.get(name, 1.0) for name in machine.axes["x"].declared.names])
        measures = Measures(40e-6 * share, 30e-6 * share, 5e-6 * share, 9.0)
        return Trial(
            config,
            machine,
            dict.fromkeys(names, recording),
            {name: {"x": measures} for name in names},
        )

    monkeypatch.setattr(rounds_module, "try_out", try_out)
    monkeypatch.setattr(rounds_module, "first_trial", lambda *a: (try_out(*a), a[3]))
    monkeypatch.setattr(rounds_module, "record_rich", lambda c, log, m, rig, p: (recording, m))

    def finding(*rounds, unknown=None):
        left = list(rounds)

        def diagnose_recording(
            recording, models, progress=None, evaluate_on=None, further=(), inertia=None
        ):
            new = left.pop(0) if left else ()
            (declared,) = models.values()
            known = [e for e in (COGGING, PRESLIDING) if e.name in declared.names]
            theta = [*TRUTH, *(value for part in known for value in part.theta)]
            axis = axis_diagnosis(measured(recording, "x"), declared, new, theta)
            if unknown is not None:
                values = np.zeros(len(SPLINE.parameters))
                axis = dataclasses.replace(
                    axis,
                    verdict="unknown_structure",
                    unknown=UnknownStructure(
                        ("position",), "of x", SPLINE, SPLINE.family(), values, values, 0.5
                    ),
                    model=EffectList([*axis.model.effects, SPLINE]),
                    theta=np.append(axis.theta, values),
                    std_error=np.append(axis.std_error, values),
                )
            return RecordingDiagnosis(recording.source, 5000.0, 5.0, {"x": axis})

        monkeypatch.setattr(rounds_module, "diagnose_recording", diagnose_recording)

    return finding


def closed(out, **options):
    return close_loop("small_stage", out, progress=quiet, **options)


@pytest.mark.slow
def test_rounds_go_on_until_nothing_more_is_found(given, tmp_path):
    given((COGGING,), (PRESLIDING,))
    loop = closed(tmp_path / "out")
    assert loop.ended == "nothing more is found"
    assert [r.accepted is not None for r in loop.rounds] == [True, True, False]
    assert effects_added(loop, "x") == ("cogging", "presliding")
    assert load(loop.refined).axes["x"].model.names[-2:] == ("cogging", "presliding")


@pytest.mark.slow
def test_no_accepted_round_makes_an_error_larger(given, tmp_path):
    given((COGGING, DRAG), (PRESLIDING,))
    loop = closed(tmp_path / "out")
    trials = [loop.first, *(r.accepted.trial for r in loop.rounds if r.accepted)]
    for motion in ("own", "unused"):
        errors = [(t.measures[motion]["x"].eF_m, t.measures[motion]["x"].L2_m) for t in trials]
        assert np.all(np.diff(errors, axis=0) <= 0.0)
    # rows are large: those that no later round asks for are given up
    assert [bool(r.before.recordings) for r in loop.rounds if r.accepted] == [False, False]
    assert [bool(t.recordings) for t in trials] == [True, False, True]


@pytest.mark.slow
def test_what_makes_an_error_larger_is_left_out_and_told(given, tmp_path):
    # the effect that explains least is left out first; the other one is worth having
    given((PRESLIDING, DRAG))
    loop = closed(tmp_path / "out")
    first = loop.rounds[0]
    assert len(first.attempts.tried) == 1  # together they still help

    given((DRAG,))
    loop = closed(tmp_path / "out")
    first = loop.rounds[0]
    assert [attempt.accepted for attempt in first.attempts.tried] == [False]
    assert first.attempts.dropped["x"][0].startswith("quadratic_drag: eF 30 -> 36 um")
    assert "helps" in loop.ended
    assert load(loop.refined).axes["x"].model.names == load("small_stage").axes["x"].model.names


@pytest.mark.slow
def test_the_weakest_effect_goes_first(given, tmp_path, monkeypatch):
    monkeypatch.setitem(LEFT, "quadratic_drag", 3.0)
    given((COGGING, DRAG))
    loop = closed(tmp_path / "out")
    first = loop.rounds[0]
    assert [attempt.accepted for attempt in first.attempts.tried] == [False, True]
    assert effects_added(loop, "x") == ("cogging",)
    assert list(first.attempts.dropped) == ["x"]


@pytest.mark.slow
def test_a_spline_without_a_name_has_to_earn_its_place(given, tmp_path, monkeypatch):
    given(unknown=True)
    loop = closed(tmp_path / "out", rounds=1)
    assert effects_added(loop, "x") == ()
    assert "position_force takes no more than 3 % off" in loop.rounds[0].attempts.dropped["x"][0]
    monkeypatch.setitem(LEFT, "position_force", 0.5)
    given(unknown=True)
    loop = closed(tmp_path / "out", rounds=1)
    assert effects_added(loop, "x") == ("position_force",)


@pytest.mark.slow
def test_every_round_is_kept_and_reported(given, tmp_path):
    out = tmp_path / "out"
    stale = out / "round_7"
    for folder in (out / "round_0", stale):
        folder.mkdir(parents=True)
        (folder / "config.yaml").write_text("of an earlier time")
    given((COGGING,), (DRAG,))
    loop = closed(out)
    page = write_reports(loop).read_text()
    assert not stale.exists()
    for k in (1, 2):
        assert load(out / f"round_{k}" / "attempt_1" / "config.yaml")
        assert list((out / f"round_{k}").glob("*.html"))
        assert f'href="round_{k}/' in page
    assert "quadratic_drag: eF" in page
    assert "tried: x with cogging: no error became larger" in page

    document = json.loads(json.dumps(closed_loop_document(loop)))
    own = document["axes"]["x"]["tracking"]["own"]
    assert own["ratio"]["eF"] == pytest.approx(own["before"]["eF"] / own["after"]["eF"])
    assert document["axes"]["x"]["effects"] == ["cogging"]
    assert document["rounds"][0]["accepted"].endswith("round_1/attempt_1/config.yaml")
    assert document["rounds"][1]["left_out"]["x"]
    attempt = document["rounds"][0]["attempts"][0]
    assert (attempt["tried"], attempt["beside"]) == (["x"], None)
    share = document["rounds"][0]["shares"]["x"]
    assert share["added"] == ["cogging"]
    assert share["tracking"]["own"]["ratio"]["eF"] == pytest.approx(2.0)
    assert document["rounds"][1]["shares"] == {}


@pytest.mark.long
@pytest.mark.slow
def test_what_the_gantry_lacks_is_found_and_its_error_falls(tmp_path):
    loop = close_loop("published_gantry", tmp_path / "out", rounds=1, progress=quiet)
    document = closed_loop_document(loop)
    overall = document["axes"]
    # What the matched velocity is worth is told apart, and is in no effect's share.
    step = document["velocity"]["axes"]["x"]["tracking"]["own"]
    rounds = document["rounds"][0]["attempts"][-1]["axes"]["x"]["tracking"]["own"]
    assert document["velocity"]["kept"] == ["x", "y"]
    assert step["before"] == rounds["after"]
    assert step["after"] == overall["x"]["tracking"]["own"]["after"]
    assert step["ratio"]["eF"] > 1.5
    assert {"cogging", "input_lag"} <= set(overall["x"]["effects"])
    assert "cogging" in overall["y"]["effects"]
    for axis, least in (("x", 2.0), ("y", 3.0)):
        for motion in ("own", "unused"):
            assert overall[axis]["tracking"][motion]["ratio"]["eF"] >= least
        error = overall[axis]["model_error"]
        assert error["after_rms"] < 0.2 * error["before_rms"]


def test_a_round_goes_on_with_what_the_one_before_had_no_attempt_left_for(
    given, tmp_path, monkeypatch
):
    given((DRAG,), (COGGING,))
    full = Attempts((), {}, {}, waiting=(Proposal({"x": ()}),))
    left, seen = [full, full, Attempts((), {}, {})], []

    def try_found(diagnosis, before, first, folder, run, after):
        seen.append((diagnosis, folder.name, after))
        return left.pop(0)

    monkeypatch.setattr(rounds_module, "try_found", try_found)
    monkeypatch.setattr(rounds_module, "match_velocity", lambda *_: None)
    loop = closed(tmp_path / "out", rounds=2)
    assert loop.ended == "the limit of 2 rounds is reached"
    assert [place for _, place, _ in seen] == ["round_1", "round_2"]
    assert [after for *_, after in seen] == [None, full]
    assert seen[0][0] is seen[1][0]  # nothing was changed: it would be found again

    left, seen = [full, Attempts((), {}, {})], []
    loop = closed(tmp_path / "out", rounds=4)
    assert len(loop.rounds) == 2
    assert "limit" not in loop.ended


def test_without_virtual_time_it_says_how_the_machine_itself_is_taken(monkeypatch, tmp_path):
    machine = load("small_stage")
    monkeypatch.setattr(machine.drivers["stage"].cls, "supports_virtual_time", False)
    config = tmp_path / "real.yaml"
    config.write_text(machine.source.read_text().replace("realtime: wait", "realtime: degrade"))
    on_the_machine = r"virtual time.* motorctl close-loop \S+ --socket SOCKET"
    with pytest.raises(UsageError, match=on_the_machine):
        close_loop(config, tmp_path / "out", progress=quiet)
    assert not (tmp_path / "out").exists()


def test_an_axis_without_a_program_has_no_motion_of_its_own(tmp_path):
    config = tmp_path / "still.yaml"
    shipped = load("small_stage").source.read_text()
    config.write_text(shipped.replace("    program: shuttle\n", ""))
    with pytest.raises(UsageError, match="no program for axis x"):
        close_loop(config, tmp_path / "out", motion="own", progress=quiet)
