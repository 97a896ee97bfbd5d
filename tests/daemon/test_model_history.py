"""The history of a machine's models: nothing that was written is lost by what is added."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorctl.config import load, shipped_config
from motorctl.daemon.model_history import ModelChange, ModelHistory, changes_between


def changes(axis: str = "x") -> list[ModelChange]:
    machine = load(shipped_config("published_gantry"))
    return changes_between(
        machine, machine, {axis: "a.yaml"}, [axis], "proven", story=["found"], log="run.parquet"
    )


def test_what_was_added_is_read_in_order(tmp_path: Path) -> None:
    history = ModelHistory("bench", tmp_path)
    for axis in ("x", "y", "x"):
        history.add(changes(axis))
    assert [change.axis for change in ModelHistory("bench", tmp_path).read()] == ["x", "y", "x"]


def test_lines_of_a_later_version_stay(tmp_path: Path) -> None:
    history, file = ModelHistory("bench", tmp_path), tmp_path / "bench.jsonl"
    later = b'{"axis": "x", "what": "melted"}'
    file.write_bytes(later + b"\n")
    history.add(changes())
    assert file.read_bytes().splitlines()[0] == later
    assert [change.what for change in history.read()] == ["proven"]


def test_a_history_that_cannot_be_read_is_not_written_over(tmp_path: Path) -> None:
    history, file = ModelHistory("bench", tmp_path), tmp_path / "bench.jsonl"
    file.mkdir()  # as a disk that fails: it is there, and cannot be read
    with pytest.raises(OSError, match=r"bench\.jsonl"):
        history.add(changes())
    assert file.is_dir()
