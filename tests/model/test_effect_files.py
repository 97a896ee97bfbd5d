"""A file of effects with a mistake is refused with file, member and cure; the others stay."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from config_bench import machine, problems
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.errors import UsageError
from motorctl.model import catalog, effects

EDDY_BRAKE = Path(__file__).parents[2] / "docs" / "eddy_brake.py"
CACHES = (
    catalog.built_in_entries,
    catalog.built_in_effects,
    catalog.known_effects,
    catalog.basic_effects,
)


@contextmanager
def in_the_folder(folder: Path, text: str, name: str = "eddy_brake") -> Iterator[Path]:
    """Let the folder of effects hold one more file."""
    file = folder / f"{name}.py"
    file.write_text(text, encoding="utf-8")
    effects.__path__.append(str(folder))
    for cache in CACHES:
        cache.cache_clear()
    try:
        yield file
    finally:
        effects.__path__.remove(str(folder))
        sys.modules.pop(f"motorctl.model.effects.{name}", None)
        for cache in CACHES:
            cache.cache_clear()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ("class EddyBrake(Effect):", "class EddyBrake(Effect)", "failed to import: SyntaxError"),
        (
            '"friction_over_velocity"',
            '"friction_over_lunch"',
            "picture names 'friction_over_lunch'",
        ),
        ('{"peak_velocity_m_s": 0.2', '{"peak_speed_m_s": 0.2', "steps names 'peak_speed_m_s'"),
        ("0.2 * self.options.peak_velocity", "0.2 * self.options.peak_speed", "steps raises Attr"),
        ('    name = "eddy_brake"\n', "", "no class derived from Effect has name = 'eddy_brake'"),
        ('name = "eddy_brake"', 'name = "cogging"', "name is that of "),
        ("\ndef column(", "\ndef columns(", "column is missing: expected column(j, x, v"),
    ],
)
def test_a_mistake_in_a_file_of_the_folder_takes_no_other_down(
    tmp_path: Path, before: str, after: str, told: str
) -> None:
    there = set(catalog.built_in_effects())
    text = EDDY_BRAKE.read_text(encoding="utf-8")
    assert before in text
    with in_the_folder(tmp_path, text.replace(before, after)) as file:
        assert set(catalog.built_in_effects()) == there
        result = CliRunner().invoke(make_app(), ["effects", "--json"])
        assert result.exit_code == 0, result.output
        (row,) = [one for one in json.loads(result.stdout)["effects"] if one["error"]]
        assert row["name"] == "eddy_brake"
        assert str(file) in row["error"]
        assert told in row["error"]
        with pytest.raises(UsageError) as refused:
            catalog.effect_class("eddy_brake")
        assert told in str(refused.value)


def test_a_configuration_that_names_it_is_told_why_at_its_line(tmp_path: Path) -> None:
    config = machine(axes__x__model__eddy_brake={"peak_velocity_m_s": 0.4})
    with in_the_folder(tmp_path, "import nothing_of_this_name\n"):
        (problem,) = problems(tmp_path, config)
    assert problem.key == "axes.x.model.eddy_brake"
    assert "ModuleNotFoundError: No module named 'nothing_of_this_name'" in problem.message


def test_without_one_that_every_machine_has_it_is_told_which_file_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inertia = catalog.basic_effects()["acceleration"]
    with in_the_folder(tmp_path, EDDY_BRAKE.read_text(encoding="utf-8")):
        monkeypatch.setattr(inertia, "kind", "sideways")
        words = r"proportional_to = 'acceleration'.*inertia\.py\): kind is 'sideways'; expected one"
        with pytest.raises(UsageError, match=words):
            catalog.basic_effects()
        monkeypatch.undo()
