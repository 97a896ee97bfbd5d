"""What was learned is used for its own program and its own model alone."""

from __future__ import annotations

import copy
import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from config_bench import machine as written
from config_bench import problems, write

from motorctl.config import Machine, load
from motorctl.config.learned_file import (
    LearnedEntry,
    cycle_digest,
    learned_path,
    look_up,
    loop_digest,
    read_learned,
    require_nothing_learned,
    write_learned,
)
from motorctl.config.shipped import locate
from motorctl.config.summary import summarise
from motorctl.errors import DataError, UsageError


@pytest.fixture(scope="module")
def text() -> str:
    shipped = locate("published_gantry").read_text(encoding="utf-8")
    return shipped.replace("    program: published_x", "    program: published_x\n"
                           "    learning: {file: learned.json, max_share: 0.05}")  # fmt: skip


@pytest.fixture
def machine(tmp_path: Path, text: str) -> Machine:
    path = tmp_path / "gantry.yaml"
    path.write_text(text, encoding="utf-8")
    return load(path)


def learn(machine: Machine, volts: float = 0.2) -> LearnedEntry:
    """Write an entry for the program of x, as `motorctl learn` does."""
    program = machine.programs["published_x"]
    entry = LearnedEntry(
        program=cycle_digest(program, "x"),
        model=loop_digest(machine, "x"),
        period_s=3.5,
        volts=(volts, -volts, 0.0),
    )
    path = learned_path(machine, "x")
    assert path is not None
    write_learned(path, "published_x", entry)
    return entry


def changed(machine: Machine, text: str, old: str, new: str) -> Machine:
    assert old in text
    machine.source.write_text(text.replace(old, new, 1), encoding="utf-8")
    return load(machine.source)


def found(machine: Machine) -> tuple[LearnedEntry | None, str | None]:
    looked = look_up(machine, "x", machine.programs["published_x"])
    return looked.entry, looked.why_not


def test_it_stands_beside_the_configuration_and_is_used_for_its_program(machine: Machine) -> None:
    assert found(machine) == (None, None)
    require_nothing_learned(machine)
    assert any("learned nothing for 'published_x' yet" in n for n in summarise(machine)["notes"])
    entry = learn(machine)
    assert learned_path(machine, "x") == machine.source.parent / "learned.json"
    assert found(machine) == (entry, None)
    assert any("up to 0.2 V that it learned" in note for note in summarise(machine)["notes"])
    assert look_up(machine, "y", machine.programs["published_y"]).entry is None
    # With other repetitions of the same cycle, too.
    more = machine.programs["published_x"].model_copy(update={"cycles": 5})  # type: ignore[attr-defined]
    assert look_up(machine, "x", more).entry == entry
    with pytest.raises(UsageError, match=r"x has learned for 'published_x'.*learning: null"):
        require_nothing_learned(machine)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("inertia: {initial: 0.19,", "inertia: {initial: 0.191,", "with another model"),
        ("k1_1_s: 250", "k1_1_s: 251", "with another model"),
        ("controller: &controller C2", "controller: &controller C1", "with another model"),
        ("resolution_m: 0.5e-6", "resolution_m: 0.25e-6", "with another model"),
        ("max_velocity_m_s: 1.05", "max_velocity_m_s: 1.0", "for another motion of that name"),
        ("max_share: 0.05", "max_share: 0.01", r"0\.2 V, limit 0\.1 V \(axes\.x\.learning"),
    ],
)
def test_with_another_model_motion_or_limit_it_is_dropped_and_told(
    machine: Machine, text: str, old: str, new: str, why: str
) -> None:
    learn(machine)
    entry, told = found(changed(machine, text, old, new))
    assert entry is None
    assert told is not None
    assert told.startswith("axis x: what was learned for program 'published_x' is not used")
    assert re.search(why, told), told


def test_a_key_of_gains_that_did_not_exist_then_and_is_null_makes_no_other_loop(
    machine: Machine, text: str
) -> None:
    older = copy.deepcopy(machine.resolved)
    assert older["axes"]["x"]["gains"].pop("command_filter") is None  # type: ignore[index]
    before = dataclasses.replace(machine, resolved=older)
    entry = learn(before)
    assert found(machine) == (entry, None)
    own = "gains: {command_filter: {kind: low_pass, frequency_hz: 500}, k1"
    assert found(changed(machine, text, "gains: {k1", own))[0] is None


def test_entries_of_other_programs_stay_and_one_can_be_taken_out(machine: Machine) -> None:
    entry, path = learn(machine), learned_path(machine, "x")
    assert path is not None
    write_learned(path, "another", entry)
    learn(machine, 0.1)
    assert sorted(read_learned(path)) == ["another", "published_x"]
    assert read_learned(path)["another"] == entry
    np.testing.assert_array_equal(read_learned(path)["published_x"].values, [0.1, -0.1, 0.0])
    write_learned(path, "published_x", None)
    assert list(read_learned(path)) == ["another"]
    assert [file.name for file in path.parent.glob("learned*")] == ["learned.json"]


def test_a_damaged_file_is_left_alone_and_told(machine: Machine) -> None:
    path = learned_path(machine, "x")
    assert path is not None
    for text in ("{", '{"format": "another", "programs": {}}', "[]"):
        path.write_text(text)
        entry, told = found(machine)
        assert entry is None
        assert told is not None
        assert "is no file of what was learned" in told
        with pytest.raises(DataError, match="remove it"):
            write_learned(path, "p", None)
        assert path.read_text() == text


def test_an_axis_that_does_not_ask_has_nothing(machine: Machine) -> None:
    learn(machine)
    axis = machine.axes["x"].model_copy(update={"learning": None})
    silent = dataclasses.replace(machine, axes={**machine.axes, "x": axis})
    assert found(silent) == (None, None)
    assert silent.axes["x"].max_learned_v == 0.0
    assert machine.axes["x"].max_learned_v == pytest.approx(0.5)


def test_a_share_that_is_no_share_is_refused(tmp_path: Path) -> None:
    config = written()
    config["axes"]["x"]["learning"] = {"file": "a.json", "max_share": 0.5}
    (told,) = problems(tmp_path, config)
    assert told.key == "axes.x.learning.max_share"


def twins(folder: Path, files: tuple[str, str]) -> dict[str, Any]:
    """Return a configuration of two axes that are alike but for channel and learning file."""
    config = written()
    axis = config["axes"]["x"]
    for channel, (name, file) in enumerate(zip("xy", files, strict=True)):
        own = {"channel": channel, "program": None, "learning": {"file": file}}
        config["axes"][name] = axis | own
    return config


@pytest.mark.parametrize("other", ["a.json", "./a.json", "sub/../a.json", "{folder}/a.json"])
def test_two_axes_with_one_file_are_refused(tmp_path: Path, other: str) -> None:
    (tmp_path / "sub").mkdir()
    config = twins(tmp_path, ("a.json", other.format(folder=tmp_path)))
    (told,) = problems(tmp_path, config)
    assert told.key == "axes.y.learning.file"
    assert told.line is not None
    assert "the file of axis 'x'; should be one of its own, such as learned_y.json" in told.message


def test_what_one_axis_learned_is_none_of_its_twins(tmp_path: Path) -> None:
    machine = load(write(tmp_path, twins(tmp_path, ("a.json", "b.json"))))
    assert loop_digest(machine, "x") != loop_digest(machine, "y")
