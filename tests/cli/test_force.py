"""A file of a person's own is never written over unasked."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.errors import UsageError

OLD = b"a morning's work"


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    path = tmp_path / "kept.yaml"
    path.write_bytes(OLD)
    return path


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "small_stage", "--log"),
        ("refine", "no_such.parquet", "--config", "small_stage", "--out"),
        ("tune", "x", "--config", "small_stage", "--out"),
    ],
    ids=lambda command: command[0],
)
def test_what_is_there_is_refused_before_anything_else_is_done(
    kept: Path, command: tuple[str, ...]
) -> None:
    result = CliRunner().invoke(make_app(), [*command, str(kept)])
    assert isinstance(result.exception, UsageError)
    assert str(result.exception) == f"{kept}: is there already; --force replaces it"
    assert kept.read_bytes() == OLD


def test_force_goes_on_to_what_comes_next(kept: Path) -> None:
    words = ["refine", "no_such.parquet", "--config", "small_stage", "--force", "--out", str(kept)]
    result = CliRunner().invoke(make_app(), words)
    assert "no_such.parquet" in str(result.exception)  # the recording is asked for
