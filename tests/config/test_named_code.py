"""A configuration runs no code but what somebody with the right to it has allowed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from config_bench import MACHINE, machine, write
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from motorctl.cli import check
from motorctl.config import AllowedCode, code_of_file, load, shipped_config
from motorctl.errors import ConfigError, UsageError

MAIN = "from motorctl.cli import main; main()"
LEAVES_A_MARK = """
from pathlib import Path
Path(__file__).with_name("{mark}").write_text("was imported")
raise RuntimeError("nobody should have imported this")
"""


@pytest.fixture
def foreign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on Python's path with a package that leaves a mark wherever it is imported."""
    package = tmp_path / "stranger"
    (package / "deep").mkdir(parents=True)
    (package / "__init__.py").write_text(LEAVES_A_MARK.format(mark="mark"))
    (package / "deep" / "__init__.py").write_text(LEAVES_A_MARK.format(mark="mark"))
    (package / "deep" / "driver.py").write_text(LEAVES_A_MARK.format(mark="mark"))
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def marks(folder: Path) -> list[Path]:
    return list(folder.rglob("mark"))


def of_a_stranger(folder: Path) -> Path:
    data = machine(
        drivers__line__type="stranger.deep.driver:Driver",
        axes__x__model__tug={"type": "stranger:Tug"},
        further_effects={"pull": "stranger.deep:Pull"},
    )
    return write(folder, data)


def a_list(folder: Path, text: str) -> Path:
    path = folder / "allowed_code"
    path.write_text(text)
    path.chmod(0o644)
    return path


def run(*arguments: object) -> object:
    app = typer.Typer()
    check.register(app)
    app.command("other")(lambda: None)
    return CliRunner().invoke(app, ["check", *map(str, arguments)])


def test_code_is_told_with_its_file_and_nothing_of_it_is_imported(foreign: Path) -> None:
    path = of_a_stranger(foreign)
    told = {".".join(map(str, code.key)): code for code in code_of_file(path)}
    driver = told["drivers.line.type"]
    assert (driver.kind, driver.target) == ("driver", "stranger.deep.driver:Driver")
    assert (driver.origin, driver.package) == ("named", None)
    assert driver.file == str(foreign / "stranger" / "deep" / "driver.py")
    assert told["axes.x.model.tug.type"].file == str(foreign / "stranger" / "__init__.py")
    assert told["further_effects.pull"].target == "stranger.deep:Pull"
    assert not marks(foreign)
    assert "stranger" not in sys.modules


def test_check_code_tells_it_and_imports_nothing(foreign: Path) -> None:
    path, allowed = of_a_stranger(foreign), a_list(foreign, "stranger.deep # of Ann\n")
    done = run(path, "--code", "--only-allowed-code", allowed, "--json")
    rows = {row["key"]: row for row in json.loads(done.stdout)["code"]}
    assert {key: row["allowed"] for key, row in rows.items()} == {
        "drivers.line.type": True,
        "axes.x.model.tug.type": False,
        "further_effects.pull": True,
    }
    table = run(path, "--code")
    assert table.exit_code == 0
    assert "refuses it" in " ".join(table.stdout.split())
    assert not marks(foreign)


def test_what_the_list_does_not_have_is_refused_before_it_is_imported_all_at_once(
    foreign: Path,
) -> None:
    path, allowed = of_a_stranger(foreign), AllowedCode.read(a_list(foreign, "# nothing yet\n"))
    with pytest.raises(ConfigError) as no:
        load(path, allowed_code=allowed)
    assert {problem.key for problem in no.value.problems} == {
        "drivers.line.type",
        "axes.x.model.tug.type",
        "further_effects.pull",
    }
    for problem in no.value.problems:
        assert "is code that is not allowed here" in problem.message
        assert str(foreign / "allowed_code") in problem.message
        assert problem.line
    assert not marks(foreign)


def test_a_module_in_the_list_is_imported_and_one_of_a_longer_name_is_not(tmp_path: Path) -> None:
    path = write(tmp_path, MACHINE)
    for text, allowed in (
        ("config_bench\n", True),
        ("# mine\n\n  config_bench  # this one\n", True),
        ("config_benches\n", False),
        ("config\n", False),
        ("", False),
    ):
        permission = AllowedCode.read(a_list(tmp_path, text))
        if allowed:
            assert load(path, allowed_code=permission).name
        else:
            with pytest.raises(ConfigError, match="not allowed"):
                load(path, allowed_code=permission)


def test_without_a_list_nothing_that_is_named_is_allowed(tmp_path: Path) -> None:
    allowed = AllowedCode.read(tmp_path / "is not there")
    with pytest.raises(ConfigError, match="not allowed"):
        load(write(tmp_path, MACHINE), allowed_code=allowed)


@pytest.mark.parametrize("name", ["published_gantry", "small_stage", "can_gantry", "dual_gantry"])
def test_what_comes_with_motorctl_needs_no_line(tmp_path: Path, name: str) -> None:
    nothing = AllowedCode.read(tmp_path / "is not there")
    assert load(name, allowed_code=nothing).name
    for code in code_of_file(shipped_config(name)):
        assert (code.origin, code.package) == ("motorctl", "motorctl")


def test_by_hand_everything_runs_as_ever(tmp_path: Path) -> None:
    assert load(write(tmp_path, MACHINE)).name
    shown = run(write(tmp_path, MACHINE))
    assert shown.exit_code == 0
    told = " ".join(shown.stdout.split())
    assert "Code that this file runs" in told
    assert "config_bench:BenchDriver" in told


def test_a_list_that_others_may_write_is_refused(tmp_path: Path) -> None:
    path = a_list(tmp_path, "config_bench\n")
    for mode in (0o664, 0o646):
        path.chmod(mode)
        with pytest.raises(UsageError, match="others than its owner may write it: chmod go-w"):
            AllowedCode.read(path)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_list_that_belongs_to_another_user_is_refused(tmp_path: Path) -> None:
    path = a_list(tmp_path, "config_bench\n")
    os.chown(path, 12345, -1)
    with pytest.raises(UsageError, match="belongs to user 12345; only root"):
        AllowedCode.read(path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (b"my_driver:Class\n", ":1: 'my_driver:Class' should be the name of a module"),
        (b"good\n../bad\n", ":2: '../bad' should be"),
        (b"*\n", ":1: '\\*' should be"),
        (b"\xff\xfe\n", "it is no text"),
        (b"a\n" * 60_000, "more than 100000 bytes"),
    ],
)
def test_a_list_that_is_none_is_one_message(tmp_path: Path, text: bytes, told: str) -> None:
    path = a_list(tmp_path, "")
    path.write_bytes(text)
    with pytest.raises(UsageError, match=told):
        AllowedCode.read(path)
    with pytest.raises(UsageError, match="cannot be read: Is a directory"):
        AllowedCode.read(tmp_path)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.sampled_from(["driver", "effect", "further"]), target=st.text(max_size=30))
def test_whatever_is_named_is_a_name_that_is_known_or_refused_without_an_import(
    tmp_path: Path, where: str, target: str
) -> None:
    data = {
        "driver": {"drivers__line__type": f"stranger:{target}"},
        "effect": {"axes__x__model__tug": {"type": target}},
        "further": {"further_effects": {"pull": target}},
    }[where]
    path = write(tmp_path, machine(**data))
    before = set(sys.modules)
    try:
        found = code_of_file(path)
    except ConfigError:
        return  # no YAML at all
    named = [code for code in found if code.origin == "named"]
    assert named
    with pytest.raises(ConfigError):
        load(path, allowed_code=AllowedCode(tmp_path, frozenset()))
    assert set(sys.modules) == before


def test_the_daemon_refuses_before_it_imports_and_says_what_to_do(foreign: Path) -> None:
    path, allowed = of_a_stranger(foreign), a_list(foreign, "")
    done = subprocess.run(
        [sys.executable, "-c", MAIN, "run", path, "--only-allowed-code", allowed],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(foreign)},
    )
    assert done.returncode == 2
    assert f"adds a line 'stranger.deep.driver' to {allowed}" in done.stderr
    assert "Traceback" not in done.stderr
    assert not marks(foreign)
