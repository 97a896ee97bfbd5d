"""The demonstration tells the published experiment, what was missing, and what adding it gives."""

from __future__ import annotations

import html
import re
from pathlib import Path

import pytest
from refine_bench import axis_diagnosis, cogging, effect, found

from motorctl.close_loop import rounds as rounds_module
from motorctl.close_loop.judge import judge
from motorctl.config import load
from motorctl.demo.plant import undeclared_effects
from motorctl.demo.story import REFINED, Story, tell
from motorctl.demo.tables import before_and_after, found_beside_plant, gains, kept_effects
from motorctl.errors import UsageError
from motorctl.identify.columns.measured import measured
from motorctl.identify.compare.published import TABLES
from motorctl.identify.compare.runs import ratios
from motorctl.identify.diagnose.result import RecordingDiagnosis

OURS = {  # the prototype's table for the same plants, in um and V
    "x": {"C1": (65.7, 42.3, 4.04, 9.57), "C2": (36.6, 28.2, 3.46, 9.89)},
    "y": {"C1": (77.6, 52.6, 8.98, 9.35), "C2": (38.5, 34.9, 7.20, 9.79)},
}
STAGE_TRUTH = (0.05, 0.1, 0.08, 0.01, -0.004, -0.0002)
STAGE_COGGING = found(
    effect("cogging", pitch_m=0.024, orders=(1, 2)),
    (0.0175517, 0.0095885, 0.03, 0.0),
    5000.0,
)


def quiet(what: str, share: float) -> None:
    assert 0.0 <= share <= 1.0


def test_what_the_plants_have_beyond_their_configuration_is_told_with_its_amounts() -> None:
    machine = load("published_gantry")
    there = undeclared_effects(machine, "y")
    assert there.keys() == {"cogging", "presliding", "input_lag", "input_delay"}
    assert there["cogging"] == "pitch 50 mm, order 1: 0.34 V, order 2: 0.1 V, order 6: 0.12 V"
    assert there["presliding"] == "displacement 15 µm"
    assert there["input_lag"] == "time 390 µs"


@pytest.mark.slow
def test_an_effect_that_the_configuration_declares_is_not_told_as_unknown(tmp_path: Path) -> None:
    text = load("small_stage").source.read_text()
    config = tmp_path / "stage.yaml"
    assert text.count("      inertia:") == 1
    declared = "      cogging: {pitch_m: 0.024, orders: [1, 2]}\n      inertia:"
    config.write_text(text.replace("      inertia:", declared))
    assert "cogging" in undeclared_effects(load("small_stage"), "x")
    assert "cogging" not in undeclared_effects(load(config), "x")


@pytest.fixture(scope="module")
def stage_story(tmp_path_factory: pytest.TempPathFactory) -> Story:
    """Tell the story of the small stage, with a diagnosis that is given rather than made."""
    left = [(STAGE_COGGING,)]

    def diagnose_recording(
        recording, models, progress=None, evaluate_on=None, further=(), inertia=None
    ):  # type: ignore[no-untyped-def]
        new = left.pop() if left else ()
        known = () if new else STAGE_COGGING.theta
        axes = {
            name: axis_diagnosis(measured(recording, name), declared, new, (*STAGE_TRUTH, *known))
            for name, declared in models.items()
        }
        return RecordingDiagnosis(recording.source, 5000.0, recording.duration_s, axes)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rounds_module, "diagnose_recording", diagnose_recording)
        return tell(tmp_path_factory.mktemp("stage"), quiet, "small_stage")


@pytest.mark.slow
def test_the_page_tells_what_was_found_beside_what_is_there_and_what_it_gives(
    stage_story: Story,
) -> None:
    loop = stage_story.loop
    assert set(kept_effects(loop, "x")) == {"cogging"}
    rows = {name: (there, told) for name, there, told, _ in found_beside_plant(loop, "x")}
    assert rows["cogging"][0].startswith("pitch 24 mm")
    assert "24" in rows["cogging"][1]
    assert rows["input_lag"] == ("time 200 µs", "not found")

    page = html.unescape(stage_story.page.read_text())
    order = [page.index(f"<h2>{k}.") for k in range(1, 6)]
    assert order == sorted(order)
    for _, motion, cells in before_and_after(loop):
        assert motion in page
        for cell in cells.values():
            assert f"<td>{cell}</td>" in page
    assert gains(loop) in page
    assert loop.refined.is_file()


@pytest.mark.slow
def test_the_page_needs_no_other_file_to_be_looked_at(stage_story: Story) -> None:
    page = stage_story.page.read_text()
    sources = re.findall(r'(?:src|srcset)="([^"]*)"', page)
    assert len(sources) == len(stage_story.pictures)
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "<script" not in page
    assert "<link" not in page
    for target in re.findall(r'href="([^"]*)"', page):
        assert (stage_story.page.parent / target).is_file(), target
    for picture in stage_story.pictures:
        assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_refined_model_stands_beside_c1_and_c2_on_the_same_trajectory(
    stage_story: Story,
) -> None:
    assert [run.label for run in stage_story.outcome.runs] == ["C1", "C2", REFINED]
    before, after = stage_story.loop.overall["x"].tracking["own"]
    _, c2, refined = stage_story.outcome.measures("x").values()
    assert (c2, refined) == (before, after)
    assert after.eF_m < before.eF_m


def test_a_place_where_nothing_can_be_written_is_refused_at_once(tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("a file")
    with pytest.raises(UsageError, match="taken: cannot be written"):
        tell(taken, quiet)
    assert taken.read_text() == "a file"


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Story:
    return tell(tmp_path_factory.mktemp("demo"), quiet)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("axis", ["x", "y"])
def test_compensation_reaches_the_promised_ratios_on_the_published_plants(
    story: Story, axis: str
) -> None:
    c1, c2 = (run.axes[axis].measures for run in story.experiment.comparison.runs)
    ratio = ratios(c1, c2)
    assert ratio["eM"] >= 1.4
    assert ratio["eF"] >= 1.4
    assert ratio["L2[e]"] >= 1.1


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("run", [0, 1])
def test_measures_lie_within_a_fifth_of_the_prototypes(story: Story, axis: str, run: int) -> None:
    compared = story.experiment.comparison.runs[run]
    found_here = compared.axes[axis].measures
    values = (
        found_here.eM_m * 1e6,
        found_here.eF_m * 1e6,
        found_here.L2_m * 1e6,
        found_here.uM_V,
    )
    assert values == pytest.approx(OURS[axis][compared.label], rel=0.2)


@pytest.mark.slow
def test_the_demonstration_finds_the_cogging_that_no_configuration_declares(story: Story) -> None:
    made = kept_effects(story.loop, "y")["cogging"]
    truth, _ = cogging("y")
    assert made.effect.options.pitch_m == pytest.approx(truth.options.pitch_m, rel=1e-3)
    assert set(truth.options.orders) <= set(made.effect.options.orders)


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["own", "unused"])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_with_what_was_found_the_error_falls_on_both_motions(
    story: Story, axis: str, motion: str
) -> None:
    before, after = judge(story.loop.first, story.loop.last, story.loop.first)[axis].tracking[
        motion
    ]
    assert after.L2_m < before.L2_m / 1.5
    assert after.eF_m < before.eF_m


@pytest.mark.slow
def test_the_demonstration_shows_the_published_tables_and_every_picture(story: Story) -> None:
    page = story.page.read_text()
    assert f"{TABLES['x']['C1'].eM_m * 1e6:.1f}" in page
    kinds = {picture.stem for picture in story.pictures}
    for axis in ("x", "y"):
        assert {f"{what}_{axis}" for what in ("tracking_error", "command", "outcome")} <= kinds
    assert page.count("data:image/png;base64,") == len(story.pictures)
