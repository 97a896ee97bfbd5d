"""Help that is never cut, and what a shell offers at the tabulator."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from served_socket import served
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.cli.whole_help import SECTIONS
from motorctl.config import shipped_configs

AXIS: dict[str, Any] = {
    "state": "idle", "homed": True, "position_m": 0.0, "velocity_m_s": 0.0, "reference_m": 0.0,
    "following_error_m": 0.0, "command_v": 0.0, "travel_m": [0.0, 1.0], "max_voltage_v": 10.0,
    "fault": None, "theta_hat": {},
}  # fmt: skip
MACHINE = {
    "machine": "bench",
    "axes": {"x": AXIS, "y": AXIS},
    "loop": {"rate_hz": 1000.0},
    "recording": {"file": None},
}


def shown(*words: str, **environment: str) -> str:
    return CliRunner().invoke(make_app(), list(words), env=environment, prog_name="motorctl").stdout


def offered(*words: str) -> list[str]:
    line = " ".join(("motorctl", *words))
    return shown(
        _MOTORCTL_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words))
    ).split()


@pytest.mark.parametrize("words", [(), ("log",), ("fault",), ("service",)], ids=str)
def test_no_help_in_a_list_of_commands_is_cut_or_wider_than_80_columns(
    words: tuple[str, ...],
) -> None:
    text = shown(*words, "--help", COLUMNS="80")
    assert "..." not in text.partition("Options:")[2]
    assert max(map(len, text.splitlines())) <= 80


def test_every_command_is_listed_once() -> None:
    text = shown("--help", COLUMNS="80")
    for name in (name for names in SECTIONS.values() for name in names):
        lines = [line for line in text.splitlines() if line.startswith(f"  {name} ")]
        assert len(lines) == 1, name


def test_commands_and_options_are_offered() -> None:
    assert offered("est") == ["estop"]
    assert offered("status", "--w") == ["--watch"]


def test_shipped_configurations_and_files_are_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").touch()
    (tmp_path / "mine.csv").touch()
    (tmp_path / "machines").mkdir()
    assert set(shipped_configs()) <= set(offered("check", ""))
    assert offered("check", "m") == ["modbus_gantry", "machines/", "mine.yaml"]
    assert offered("simulate", "mine") == ["mine.yaml"]


def test_the_axes_of_the_daemon_whose_socket_was_named_are_offered(tmp_path: Path) -> None:
    async def answer(_: object) -> dict[str, Any]:
        return MACHINE

    with served(tmp_path / "m.sock", answer) as place:
        assert offered("move", "--socket", os.fspath(place), "") == ["x", "y"]
        assert offered("move", "--socket", os.fspath(place), "y") == ["y"]


def test_without_a_daemon_no_axis_is_offered_and_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", os.fspath(tmp_path))
    assert offered("home", "") == []
