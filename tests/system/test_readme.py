"""The README and its example tell what the package is."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from motorctl.cli import make_app
from motorctl.model import Spans, catalog, effects, known_effects
from motorctl.model.columns import state_columns

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
SPANS = Spans((0.0, 0.4), 1.2, 10.0, 8.0, (0.0, 24.0), 2e-4, 200.0, 0.5e-6)


def test_the_table_of_effects_holds_every_effect_in_its_own_words() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| (.+ \| .+) \|$", README, re.MULTILINE))
    known = {name: f"{cls.title} | {cls.compensated}" for name, cls in known_effects().items()}
    assert {name: rows.get(name) for name in known} == known


def test_every_command_that_the_readme_shows_exists_with_its_options() -> None:
    shown = re.findall(r"^motorctl ([a-z-]+)([^#\n]*)", README, re.MULTILINE)
    assert len(shown) > 15
    for command, rest in shown:
        told = CliRunner().invoke(make_app(), [command, "--help"], env={"COLUMNS": "200"}).output
        assert "Usage" in told, command
        for option in re.findall(r"--[a-z-]+", rest):
            assert option in told, f"{command} {option}"


def test_pictures_and_files_that_the_readme_names_are_there() -> None:
    for target in re.findall(r"\]\((?!http)([^)]+)\)", README):
        assert (ROOT / target).is_file(), target
    for picture in (ROOT / "docs").glob("*.png"):
        assert picture.stat().st_size < 300_000


@pytest.fixture
def eddy_brake() -> Iterator[type]:
    """Let the folder of effects hold the README's example."""
    folder = str(ROOT / "docs")
    effects.__path__.append(folder)
    catalog.built_in_entries.cache_clear()
    catalog.built_in_effects.cache_clear()
    catalog.known_effects.cache_clear()
    yield catalog.effect_class("eddy_brake")
    effects.__path__.remove(folder)
    catalog.built_in_entries.cache_clear()
    catalog.built_in_effects.cache_clear()
    catalog.known_effects.cache_clear()
    sys.modules.pop("motorctl.model.effects.eddy_brake", None)


def test_the_example_of_an_own_effect_brakes_most_at_its_velocity(eddy_brake) -> None:  # type: ignore[no-untyped-def]
    brake = eddy_brake(eddy_brake.Options(peak_velocity_m_s=0.3))
    v = np.linspace(0.0, 1.2, 1201)
    zero = np.zeros_like(v)
    (column,) = state_columns(brake, zero, v, zero, v, zero)
    assert v[np.argmax(column)] == pytest.approx(0.3, abs=1e-3)
    assert column.max() == pytest.approx(0.15)


def test_the_example_gives_diagnosis_forms_below_and_above_the_top_speed(eddy_brake) -> None:  # type: ignore[no-untyped-def]
    tried = [form.options.peak_velocity_m_s for form in eddy_brake.trials(SPANS)]
    assert min(tried) < 0.1 * SPANS.speed_m_s < SPANS.speed_m_s < max(tried)
    assert set(eddy_brake.trials(SPANS)[0].steps(SPANS)) == {"peak_velocity_m_s"}
