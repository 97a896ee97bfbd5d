"""A file that is written beside another takes its place whole, or leaves it as it was."""

from pathlib import Path

import pytest

from motorctl.errors import UsageError
from motorctl.identify.refine.written_beside import put_in_place, written_beside


def test_what_was_there_is_replaced_whole(tmp_path: Path) -> None:
    path = tmp_path / "refined.yaml"
    path.write_text("old")
    assert put_in_place(written_beside(path, "new"), path) == path
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_take_its_place_is_told_and_leaves_nothing_beside(tmp_path: Path) -> None:
    path = tmp_path / "refined.yaml"
    path.mkdir()
    (path / "kept").touch()
    written = written_beside(path, "new")
    with pytest.raises(UsageError, match="cannot be written"):
        put_in_place(written, path)
    assert list(tmp_path.iterdir()) == [path]
    assert list(path.iterdir()) == [path / "kept"]
