"""The check that no code quotes an effect by its name."""

from pathlib import Path

import pytest
from effects_quoted import effect_names, main


def checked(folder: Path, source: str) -> int:
    """Return what the check says of a module."""
    (folder / "module.py").write_text(source)
    return main([str(folder)])


@pytest.mark.parametrize(
    "source",
    [
        'KINDS = {"cogging"}\n',
        "def told(name):\n    return name == 'input_lag'\n",
        'def told(axis):\n    return f"{axis}: cogging is named"\n',
        'WORDS = "force_ripple,cogging"\n',
        'def told(name):\n    match name:\n        case "gravity":\n            return 1\n',
        'MASS = "inertia"\n',
    ],
)
def test_a_quotation_in_any_string_is_refused_with_file_and_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], source: str
) -> None:
    assert checked(tmp_path, source) == 1
    assert "module.py:" in capsys.readouterr().out


@pytest.mark.parametrize(
    "source",
    [
        '"""Cogging, as in cogging of a motor."""\n',
        'def told():\n    """Return cogging."""\n',
        "# cogging\nA = 1\n",
        'WORDS = "the inertia of a load, an offset"\n',
        'WORDS = "coggings"\n',
    ],
)
def test_prose_and_ordinary_words_are_not(tmp_path: Path, source: str) -> None:
    assert checked(tmp_path, source) == 0


def test_every_effect_of_the_catalogue_is_looked_for() -> None:
    from motorctl.model.catalog import built_in_effects

    assert set(effect_names()) == set(built_in_effects())
