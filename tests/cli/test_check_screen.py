"""What `motorctl check` says first, on one screen."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from matplotlib.image import imread
from typer.testing import CliRunner

from motorctl.cli import check
from motorctl.config import load, shipped_configs, summarise
from motorctl.errors import UsageError

SHIPPED = sorted(shipped_configs())


def run(*arguments: object) -> str:
    app = typer.Typer()
    check.register(app)
    app.command("other")(lambda: None)
    result = CliRunner().invoke(app, ["check", *map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_machine_is_called_valid_first_and_fits_80_columns(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = run(name).splitlines()
    assert lines[0].startswith("valid: ")
    path = lines[1]  # as long as it is
    assert max(len(line.rstrip()) for line in lines if line != path) <= 80
    notes = next((k for k, line in enumerate(lines) if line.startswith("note")), len(lines))
    assert notes <= 24
    for axis in load(name).axes:
        assert any(line.startswith(f"{axis} ") for line in lines)


def test_all_tells_what_one_screen_leaves_out() -> None:
    short, whole = run("published_gantry"), run("published_gantry", "--all")
    assert whole.startswith("valid: ")
    for told in ("theta6", "Assumption 2", "MB an hour", "gamma_d", "encoder stuck"):
        assert told in whole
        assert told not in short
    assert "--all" in short


def test_the_least_margins_of_the_table_are_those_on_the_screen() -> None:
    rows = summarise(load("published_gantry"))["axes"]["y"]["margins"]
    least = min(row["phase_margin_deg"] for row in rows)
    assert f"margins over its bounds {least:.3g} deg" in run("published_gantry")


def test_a_thin_margin_is_remarked_with_its_number_and_a_way_out() -> None:
    notes = summarise(load("published_gantry"))["notes"]
    (thin,) = [note for note in notes if "thin margins" in note]
    assert thin == (
        "axis y: thin margins: 26.7 deg with inertia at its upper bound (1.2 V*s^2/m) and 0.2 ms "
        "of delay (usual: 30 deg, 6 dB); `motorctl tune y` finds gains at margins"
    )


def test_a_machine_with_wide_margins_gets_no_remark() -> None:
    assert not [n for n in summarise(load("small_stage"))["notes"] if "margin" in n]


def test_a_loop_that_is_unstable_somewhere_is_not_told_a_margin() -> None:
    shown = " ".join(run("modbus_gantry").split())
    assert "unstable within the bounds of its inertia" in shown
    assert "unstable with inertia at its" in shown


def test_the_loop_of_each_axis_is_drawn(tmp_path: Path) -> None:
    shown = run("published_gantry", "--out", tmp_path / "pictures").splitlines()
    for axis in ("x", "y"):
        picture = tmp_path / "pictures" / f"bode_{axis}.png"
        assert str(picture) in shown
        assert imread(picture).std() > 0.05  # something is drawn


def test_a_folder_that_cannot_be_made_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(UsageError, match="taken: cannot be written"):
        run("small_stage", "--out", tmp_path / "taken")


def test_a_filter_of_the_command_is_told_and_the_condition_on_ks1_does_not_apply_behind_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    path = tmp_path / "filtered.yaml"
    text = shipped_configs()["published_gantry"].read_text(encoding="utf-8")
    own = "command_filter: {kind: low_pass, frequency_hz: 500}"
    path.write_text(text.replace("gains: {k1_1_s: 250,", f"gains: {{{own}, k1_1_s: 250,", 1))
    short, whole = run(path), run(path, "--all")
    assert "axis x: the sufficient condition on ks1 does not apply behind the filter" in short
    assert "low-pass at 500 Hz, damping 0.7" in short
    assert "behind a low-pass at 500 Hz, damping 0.7" in whole
    assert whole.count("does not apply behind a filter") == 2  # at theta(0), over the bounds
