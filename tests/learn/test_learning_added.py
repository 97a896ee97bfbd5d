"""What is written for an axis to add is what its machine reads, and what its log then shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from motorctl.config import Machine, load
from motorctl.config.learned_file import learned_path
from motorctl.config.shipped import locate
from motorctl.errors import RunError, UsageError
from motorctl.learn.cycles import Repetition
from motorctl.learn.what_is_added import require_added, require_same_file


def written(points: int) -> np.ndarray:
    return 0.2 * np.sin(2.0 * np.pi * np.arange(points) / points)


def ran(learned: np.ndarray) -> Repetition:
    error = np.zeros((2, len(learned)))
    return Repetition("x", "run", 1.0, error, learned, np.zeros(len(learned)))


def stage(folder: Path) -> Machine:
    folder.mkdir(exist_ok=True)
    text = locate("small_stage").read_text(encoding="utf-8")
    path = folder / "stage.yaml"
    learning = "    program: shuttle\n    learning: {file: learned.json}"
    path.write_text(text.replace("    program: shuttle", learning), encoding="utf-8")
    return load(path)


def status_of(config: Path) -> dict[str, Any]:
    return {"daemon": {"config": str(config)}}


def test_a_copy_of_the_configuration_in_another_folder_is_refused(tmp_path: Path) -> None:
    there, copy = stage(tmp_path / "there"), stage(tmp_path / "copy")
    place = learned_path(copy, "x")
    assert place is not None
    with pytest.raises(UsageError, match=r"copy/learned\.json.*reads .*there/learned\.json.*--co"):
        require_same_file(copy, "x", place, status_of(there.source))
    require_same_file(copy, "x", place, status_of(copy.source))
    # Another name of the folder is no other folder.
    (tmp_path / "link").symlink_to(tmp_path / "copy")
    require_same_file(copy, "x", place, status_of(tmp_path / "link" / "stage.yaml"))


def test_a_run_without_the_voltage_that_was_written_ends_with_what_the_machine_said() -> None:
    with pytest.raises(RunError, match=r"added 0 V rms, and not the 0\.141 V .*: another model"):
        require_added(ran(np.zeros(1000)), written(1000), ["another model"])
    with pytest.raises(RunError, match=r"added 0\.113 V rms"):  # that of the run before
        require_added(ran(0.8 * written(1000)), written(1000), [])


def test_where_a_tick_lies_and_how_many_a_cycle_has_makes_no_other_voltage() -> None:
    require_added(ran(np.roll(written(1000), 1)), written(1000), [])
    require_added(ran(written(999)), written(1000), [])
    require_added(ran(np.zeros(1000)), np.zeros(1000), [])
