"""Reading a log runs no code but what its reader installed, allowed, or ran before."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import seventh_effect
import typer
from config_bench import machine, write
from fit_plant import simulate
from typer.testing import CliRunner

from motorctl.cli import diagnose, fit
from motorctl.config import chosen_code, load
from motorctl.errors import DataError, MotorctlError, UsageError

MARKS = """
with (__import__("pathlib").Path(__file__).parent / "imports").open("a") as mark:
    mark.write("x")
"""
EFFECT = Path(seventh_effect.__file__).read_text().replace("seventh_effect", "own_effect") + MARKS
NAMED = {"type": "own_code.effects:SeventhEffect", "pitch_m": 0.06}


@pytest.fixture
def code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with an effect that leaves a mark each time it is imported."""
    package = tmp_path / "place" / "own_code"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "effects.py").write_text(EFFECT)
    monkeypatch.syspath_prepend(package.parent)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(chosen_code, "ALLOWED_CODE", tmp_path / "allowed_code")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # files change within one second
    return package


def imports(code: Path) -> int:
    mark = code / "imports"
    return len(mark.read_text()) if mark.exists() else 0


def forget() -> None:
    """As in a new process."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "own_code"]:
        del sys.modules[name]


@pytest.fixture(scope="module")
def plant() -> Any:
    return simulate(seed=1, duration_s=3.0)


def a_log(folder: Path, plant: Any, **changes: Any) -> Path:
    """A log whose configuration names an effect that the computer of its writer had."""
    config = json.loads(json.dumps(load("published_gantry").resolved)) | changes
    columns = {"time_s": plant.time_s, "tick": np.arange(len(plant.time_s))}
    columns |= {"x.position_m": plant.position, "x.command_v": plant.command}
    columns |= {"x.reference_m": plant.reference}
    document = json.dumps({"rate_hz": plant.rate_hz, "config": config})
    path = folder / "stranger.parquet"
    pq.write_table(pa.table(columns).replace_schema_metadata({"motorctl": document}), path)
    return path


def with_effect(axis: str = "x") -> dict[str, Any]:
    axes = json.loads(json.dumps(load("published_gantry").resolved["axes"]))
    axes[axis]["model"]["own_effect"] = NAMED
    return axes


def run(command: Any, *arguments: object) -> Any:
    app = typer.Typer()
    app.callback()(lambda: None)
    command.register(app)
    name = command.__name__.rpartition(".")[2]
    return CliRunner().invoke(app, [name, *map(str, arguments)])


@pytest.mark.parametrize("command", [fit, diagnose])
@pytest.mark.parametrize("controller", [(), ("--model", "C1")])
def test_a_strangers_log_runs_no_code_and_says_which_it_names(
    command: Any, controller: tuple[str, ...], code: Path, tmp_path: Path, plant: Any
) -> None:
    log = a_log(tmp_path, plant, axes=with_effect())
    refused = run(command, log, *controller).exception
    assert isinstance(refused, DataError)
    assert imports(code) == 0
    assert f"'own_code.effects:SeventhEffect' ({code / 'effects.py'})" in str(refused)
    assert "--allow-code own_code.effects" in str(refused)
    assert "axes.x.model.own_effect.type" in str(refused)


@pytest.mark.parametrize("module", ["own_code", "own_code.effects"])
def test_it_runs_when_the_reader_allows_its_module(
    module: str, code: Path, tmp_path: Path, plant: Any
) -> None:
    forget()
    log = a_log(tmp_path, plant, axes=with_effect("y"))
    found = run(fit, log, "--allow-code", module, "--json")
    assert found.exception is None, found.exception
    assert imports(code) == 1
    assert isinstance(run(fit, log).exception, DataError)  # it was for once


def test_it_runs_where_root_has_listed_it(code: Path, tmp_path: Path, plant: Any) -> None:
    forget()
    listed = tmp_path / "allowed_code"
    listed.write_text("own_code\n")
    listed.chmod(0o644)
    assert run(fit, a_log(tmp_path, plant, axes=with_effect("y")), "--json").exception is None
    assert imports(code) == 1


@pytest.mark.slow
def test_ones_own_effect_runs_from_ones_own_log_without_a_word(
    code: Path, tmp_path: Path, plant: Any
) -> None:
    forget()
    load(write(tmp_path, machine(axes__x__model__own_effect=NAMED)))
    log = a_log(tmp_path, plant, axes=with_effect("y"))
    found = run(fit, log, "--json")
    assert found.exception is None, found.exception


@pytest.mark.slow
@pytest.mark.parametrize("change", ["effects.py", "__init__.py"])
def test_code_that_was_changed_since_is_not_what_was_chosen(
    change: str, code: Path, tmp_path: Path, plant: Any
) -> None:
    forget()
    load(write(tmp_path, machine(axes__x__model__own_effect=NAMED)))
    before = imports(code)
    with (code / change).open("a") as file:
        file.write("\nimport antigravity\n")
    forget()
    refused = run(fit, a_log(tmp_path, plant, axes=with_effect("y"))).exception
    assert isinstance(refused, DataError)
    assert imports(code) == before


def test_the_same_name_from_another_folder_is_not_what_was_chosen(
    code: Path, tmp_path: Path, plant: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    forget()
    load(write(tmp_path, machine(axes__x__model__own_effect=NAMED)))
    forget()
    other = tmp_path / "unpacked" / "own_code"
    other.mkdir(parents=True)
    for name in ("__init__.py", "effects.py"):
        (other / name).write_text((code / name).read_text())
    monkeypatch.syspath_prepend(other.parent)
    refused = run(fit, a_log(tmp_path, plant, axes=with_effect("y"))).exception
    assert isinstance(refused, DataError)
    assert imports(other) == 0


def test_what_others_could_have_written_is_no_choice_of_ones_own(
    code: Path, tmp_path: Path, plant: Any
) -> None:
    forget()
    load(write(tmp_path, machine(axes__x__model__own_effect=NAMED)))
    kept = tmp_path / "state" / "motorctl" / "chosen_code.json"
    assert kept.stat().st_mode & 0o777 == 0o600
    log = a_log(tmp_path, plant, axes=with_effect("y"))
    kept.chmod(0o666)
    assert isinstance(run(fit, log).exception, DataError)
    kept.chmod(0o600)
    assert run(fit, log, "--json").exception is None
    kept.write_text("[1")
    assert isinstance(run(fit, log).exception, DataError)


@pytest.mark.slow
def test_an_effect_that_was_only_to_be_tried_is_left_out_and_told(
    code: Path, tmp_path: Path, plant: Any
) -> None:
    forget()
    named = {"own_effect": "own_code.effects:SeventhEffect"}
    log = a_log(tmp_path, plant, further_effects=named)
    found = run(diagnose, log, "--axis", "x", "--json")
    assert found.exception is None, found.exception
    assert imports(code) == 0
    (note,) = (n for n in json.loads(found.stdout)["notes"] if "own_effect" in n)
    assert "was not tried" in note
    assert "--allow-code" in note


def test_a_log_without_code_of_its_own_is_read_though_nothing_can_be_remembered(
    code: Path, tmp_path: Path, plant: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/proc/nowhere")
    assert run(fit, a_log(tmp_path, plant), "--json").exception is None
    forget()
    load(write(tmp_path, machine(axes__x__model__own_effect=NAMED)))


def test_an_option_that_names_no_module_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"--allow-code \.\./x: should be the name of a module"):
        chosen_code.allowed_by(["../x"])
    assert issubclass(UsageError, MotorctlError)
