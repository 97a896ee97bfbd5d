"""The report of a diagnosis, its terminal output and `motorctl diagnose`."""

import base64
import io
import json
import sys
from dataclasses import replace
from html.parser import HTMLParser
from types import ModuleType

import diagnosis_bench as bench
import numpy as np
import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

from motorctl.cli import diagnose
from motorctl.errors import DataError, UsageError
from motorctl.identify.compare.measures import Measures
from motorctl.identify.diagnose.report.next_steps import next_steps, write_programs
from motorctl.identify.diagnose.report.page import TrackedAxis, TrackingComparison, write_report
from motorctl.identify.diagnose.report.terminal import print_diagnosis
from motorctl.motion import load_program_file

pytestmark = pytest.mark.slow

VERDICTS = {
    "effect": lambda: bench.axis_diagnosis("cogging", "stribeck"),
    "unknown_structure": bench.unknown_axis,
    "insufficient_data": bench.insufficient_axis,
    "complete": bench.axis_diagnosis,
}
DIFF = """\
--- a.yaml
+++ b.yaml
@@ -1 +1,2 @@
 offset: {}
+cogging: {pitch_m: <0.03>}
"""


@pytest.mark.slow
def test_options_that_are_words_or_lists_are_told_on_terminal_and_page(tmp_path):
    diagnosis = bench.recording(
        x=bench.axis_diagnosis("hard_stop", "cross_axis", "stribeck", "cogging")
    )
    console = Console(width=100, record=True, file=io.StringIO())
    print_diagnosis(console, diagnosis, {})
    told = console.export_text()
    page = Page(write_report(tmp_path, diagnosis)[0].read_text()).text
    for name, words in (("side", "lower"), ("axes", "y")):
        assert f"{name} = {words}" in told
        assert f"{name} {words}" in page
    assert "amplitude_1 = " in told
    for said_already in ("orders = ", "sign_shape = "):
        assert said_already not in told


class Page(HTMLParser):
    """What a page holds: its text, its pictures, and all that it would load."""

    def __init__(self, html):
        super().__init__()
        self.words, self.pictures, self.loaded, self.open = [], [], [], []
        self.feed(html)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if tag == "img":
            self.pictures.append(given["src"])
        elif tag not in ("meta", "br", "img"):
            self.open.append(tag)
        for key in ("src", "href", "srcset", "data", "action"):
            if key in given and tag != "img":
                self.loaded.append(given[key])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "title"):
            self.words.append(data)


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """Return a diagnosis with an axis of every verdict, the files of its report, and its page."""
    axes = {name[0]: make() for name, make in VERDICTS.items()}
    named = bench.recording(notes=("the clock jumped <once>",), **axes)
    diagnosis = replace(named, refused={"w": "axis w: no motion"})
    measures = [Measures(12e-6, 8e-6, 3.2e-6, 7.1), Measures(4e-6, 2e-6, 0.8e-6, 7.0)]
    folder = tmp_path_factory.mktemp("report")
    files = write_report(
        folder / "deep" / "down",
        diagnosis,
        comparison=TrackingComparison((TrackedAxis("circle", "e", *measures),)),
        config_change=DIFF,
        commands=("motorctl check b.yaml",),
    )
    return diagnosis, files, Page(files[0].read_text(encoding="utf-8"))


def test_the_page_needs_nothing_but_itself(everything):
    _, files, page = everything
    assert page.loaded == []
    html = files[0].read_text(encoding="utf-8")
    assert "url(" not in html
    assert "@import" not in html
    assert "<script" not in html
    prefix = "data:image/png;base64,"
    for picture in page.pictures:
        assert picture.startswith(prefix)
        assert base64.b64decode(picture.removeprefix(prefix)).startswith(b"\x89PNG")
    assert page.open == []


def test_the_page_is_small_enough_to_mail(everything):
    assert everything[1][0].stat().st_size < 5e6


def test_pictures_are_files_too_and_every_one_is_in_the_page(everything):
    _, files, page = everything
    assert files[0].name == "diagnosis.html"
    names = {path.name for path in files[1:]}
    assert {"e_cogging.png", "e_stribeck.png", "e_residual.png", "e_spectrum.png"} <= names
    assert {"u_unknown.png", "u_residual.png", "c_spectrum.png"} <= names
    assert not any(name.startswith("i_") for name in names)  # nothing to draw
    assert all(path.exists() and path.parent == files[0].parent for path in files)
    prefix = "data:image/png;base64,"
    inside = {base64.b64decode(p.removeprefix(prefix)) for p in page.pictures}
    assert inside == {path.read_bytes() for path in files[1:]}


def test_the_verdicts_come_before_everything_else(everything):
    diagnosis, _, page = everything
    first_table = page.text.index("Tracking error")
    for axis in diagnosis.axes.values():
        assert 0 <= page.text.index(axis.sentence) < first_table
    assert page.text.index("axis w: no motion") < first_table


def test_the_page_tells_numbers_with_units_evidence_and_what_was_rejected(everything):
    page = everything[2]
    assert "30.000 ± 0.030 mm" in page.text  # the pitch
    assert "0.2693 ± 0.0020 V" in page.text  # the amplitude
    assert "9.424 ± 0.070 N" in page.text
    assert "The gain remains without its best stretch of 2 s." in page.text
    assert "periodic_disturbance 31 % its line wanders with the speed" in page.text
    assert "depends on: position, velocity" in page.text
    assert "The axis never reversed slowly." in page.text


def test_the_page_shows_tracking_errors_and_their_ratio(everything):
    page = everything[2]
    assert "circle e before 12.0 8.0 3.20 7.10 after 4.0 2.0 0.80 7.00" in page.text
    assert "before / after 3.00 4.00 4.00 1.01" in page.text


def test_the_change_of_the_configuration_is_shown_as_it_is(everything):
    _, files, page = everything
    assert "+cogging: {pitch_m: <0.03>}" in page.text
    assert "the clock jumped <once>" in page.text
    assert "<0.03>" not in files[0].read_text(encoding="utf-8")
    assert "motorctl check b.yaml" in page.text


def test_what_is_refined_already_is_not_asked_for_again(everything, tmp_path):
    assert "motorctl refine" not in everything[2].text
    assert "Run a motion that shows presliding" in everything[2].text
    small = bench.recording(x=replace(bench.axis_diagnosis("cogging"), traces=None))
    (page,) = write_report(tmp_path, small)
    assert "motorctl refine run.parquet --config CONFIG.yaml" in page.read_text(encoding="utf-8")


def test_a_report_can_be_given_the_name_of_its_page(tmp_path):
    diagnosis = bench.recording(x=bench.insufficient_axis())
    assert write_report(tmp_path / "new" / "mine.html", diagnosis) == [
        tmp_path / "new" / "mine.html"
    ]


def test_a_report_that_cannot_be_written_is_one_message(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(UsageError, match="taken"):
        write_report(tmp_path / "taken", bench.recording(x=bench.insufficient_axis()))
    with pytest.raises(UsageError, match="taken"):
        write_programs(bench.recording(x=bench.insufficient_axis()), tmp_path / "taken")


def test_the_motion_that_is_missing_is_a_program_that_can_be_run(tmp_path):
    diagnosis = bench.recording(x=bench.insufficient_axis())
    (path,) = write_programs(diagnosis, tmp_path)["x"]
    assert path.name == "x_motion_for_presliding.yaml"
    program = load_program_file(path, ["x"])
    assert program.cycles == 10
    assert program.axes == ("x",)
    assert path.read_text().startswith("# slow reversals over 20 mm\n")
    (step,) = next_steps(diagnosis, None, {"x": (path,)})["x"]
    assert step.command == f"motorctl program x {path} --wait"


def test_two_motions_for_the_same_effect_are_two_files(tmp_path):
    axis = bench.insufficient_axis()
    without = replace(axis.missing[0], program=None, effects=("cogging",))
    twice = replace(axis, missing=(axis.missing[0], without, axis.missing[0]))
    first, none, second = write_programs(bench.recording(x=twice), tmp_path)["x"]
    assert none is None
    assert first != second
    assert sorted(tmp_path.iterdir()) == sorted([first, second])


def test_an_effect_is_followed_by_the_command_that_adds_it():
    diagnosis = bench.recording(x=bench.axis_diagnosis("cogging"))
    (step,) = next_steps(replace(diagnosis, source="my run.parquet"), "m.yaml")["x"]
    assert step.command == ("motorctl refine 'my run.parquet' --config m.yaml --out refined.yaml")
    assert "cogging" in step.text


def printed(diagnosis, width=100, **given):
    console = Console(width=width, record=True, file=None, force_terminal=False)
    with console.capture() as capture:
        print_diagnosis(console, diagnosis, next_steps(diagnosis, **given))
    return capture.get()


@pytest.mark.parametrize("verdict", sorted(VERDICTS))
@pytest.mark.parametrize("width", [40, 100])
def test_the_terminal_says_the_verdict_first(verdict, width):
    diagnosis = bench.recording(x=VERDICTS[verdict]())
    lines = printed(diagnosis, width).splitlines()
    words = " ".join(" ".join(lines).split())
    assert words.split("axis x: ", 1)[1].startswith(diagnosis.axes["x"].sentence)
    assert max(map(len, (line for line in lines if "motorctl" not in line))) <= width


def test_the_terminal_shows_parameters_before_and_after():
    text = printed(bench.recording(x=bench.axis_diagnosis("stribeck")))
    row = next(line for line in text.splitlines() if "viscous_friction" in line)
    alone, together = row.split()[1], row.split()[6]
    assert float(together) == pytest.approx(0.25)
    assert abs(float(alone) - 0.25) > 0.02
    assert "± " in row
    assert "velocity_m_s = 20.000 ± 0.020 mm/s" in text
    assert "not periodic_disturbance (reaches 31 % of its score)" in text


def test_the_terminal_takes_no_words_for_markup():
    axis = replace(bench.axis_diagnosis(), sentence="is [bold]fine[/bold]", notes=("[red]n",))
    text = printed(bench.recording(x=axis, notes=["[a] b"]))
    assert "is [bold]fine[/bold]" in text
    assert "[red]n" in text
    assert "[a] b" in text


@pytest.fixture
def foreign(tmp_path):
    """Write a recording that can be read."""
    t = np.arange(2000) / 1000.0
    columns = np.column_stack([t, 0.1 * np.sin(t), np.cos(t)])
    header = "time_s,x.position_m,x.command_v"
    path = tmp_path / "run.csv"
    np.savetxt(path, columns, delimiter=",", header=header, comments="")
    return path


@pytest.fixture
def invoke(monkeypatch):
    """Run the command with a search whose answer is given."""
    app = typer.Typer()
    app.callback()(lambda: None)
    diagnose.register(app)

    def call(answer, *arguments):
        def search(recording, models, progress=None, evaluate_on=None, further=(), inertia=None):
            assert list(models) == ["x"]
            assert evaluate_on is None
            assert not further
            progress("searching", 0.5)
            if isinstance(answer, Exception):
                raise answer
            return answer

        module = ModuleType("motorctl.identify.diagnose.recording")
        module.diagnose_recording = search
        monkeypatch.setitem(sys.modules, module.__name__, module)
        return CliRunner().invoke(app, ["diagnose", *map(str, arguments)])

    return call


@pytest.mark.parametrize("verdict", sorted(VERDICTS))
def test_every_verdict_is_a_success_of_the_command(invoke, foreign, verdict):
    diagnosis = bench.recording(x=VERDICTS[verdict]())
    told = invoke(diagnosis, foreign)
    assert told.exit_code == 0, told.exception
    assert diagnosis.axes["x"].sentence in " ".join(told.stdout.split())
    told = invoke(diagnosis, foreign, "--json", "--axis", "x", "--model", "C1")
    assert told.exit_code == 0, told.exception
    assert json.loads(told.stdout)["axes"]["x"]["verdict"] == verdict


def test_out_holds_report_pictures_and_programs(invoke, foreign, tmp_path):
    out = tmp_path / "out"
    told = invoke(bench.recording(x=bench.insufficient_axis()), foreign, "--out", out, "--json")
    names = {path.name for path in out.iterdir()}
    assert names == {"diagnosis.html", "x_motion_for_presliding.yaml"}
    assert set(json.loads(told.stdout)["files"]) == {str(out / name) for name in names}
    page = Page((out / "diagnosis.html").read_text(encoding="utf-8"))
    assert f"motorctl program x {out / 'x_motion_for_presliding.yaml'} --wait" in page.text


def test_a_configuration_that_gave_the_model_is_the_one_to_refine(invoke, foreign, monkeypatch):
    monkeypatch.setattr("motorctl.identify.same_axis.check_belongs", lambda *_: None)
    diagnosis = bench.recording(x=bench.axis_diagnosis("cogging"))
    told = invoke(diagnosis, foreign, "--model", "published_gantry")
    assert "--config published_gantry --out" in " ".join(told.stdout.split())


def test_bad_data_is_one_message_and_exit_status_2(invoke, foreign, tmp_path):
    told = invoke(DataError("x: no motion"), foreign)
    assert isinstance(told.exception, DataError)
    assert told.exception.exit_status == 2
    told = invoke(bench.recording(), tmp_path / "none.parquet")
    assert told.exception.exit_status == 2
    told = invoke(bench.recording(), foreign, "--axis", "z")
    assert isinstance(told.exception, UsageError)


def test_the_coefficients_of_a_spline_are_one_row():
    text = printed(bench.recording(x=bench.axis_diagnosis("position_force")))
    assert "knot_0…6 = 7 from -0.2 to 0.3 V" in text
    assert "position_force_knot_0…6" in text
    assert "knot_3" not in text
