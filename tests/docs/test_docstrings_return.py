"""The check that docstrings say "Return" or "Yield", as numpydoc has it."""

from pathlib import Path

import pytest
from docstrings_return import main


def written(folder: Path, signature: str, words: str, body: str) -> int:
    """Return what the check says of a module with one function."""
    text = f'def {signature}:\n    """{words}"""\n    {body}\n'
    (folder / "module.py").write_text(text)
    return main([str(folder)])


@pytest.mark.parametrize(
    ("signature", "words", "body"),
    [
        ("rest() -> float", "Give the rest [s].", "return 1.0"),
        ("rest()", "Gives the rest [s].", "return 1.0"),
        ("rests()", "Give each rest [s].", "yield 1.0"),
        ("rest() -> float", "Give the rest [s].", "..."),
    ],
)
def test_what_returns_something_does_not_give(
    tmp_path: Path, signature: str, words: str, body: str
) -> None:
    assert written(tmp_path, signature, words, body) == 1
    assert written(tmp_path, signature, words.replace("Give", "Return"), body) == 0


@pytest.mark.parametrize(
    ("signature", "words", "body"),
    [
        ("leave() -> None", "Give up priority and CPU.", "..."),
        ("leave()", "Give up priority and CPU.", "return None"),
        ("leave()", "Give back the port.", "call(lambda: 3)"),
        ("told() -> float", "Give a command, and return the answer to it.", "return 1.0"),
        ("given() -> float", "Given by hand.", "return 1.0"),
    ],
)
def test_what_only_does_something_may_give(
    tmp_path: Path, signature: str, words: str, body: str
) -> None:
    assert written(tmp_path, signature, words, body) == 0


@pytest.mark.slow
def test_no_docstring_of_the_project_gives_what_is_returned() -> None:
    assert main([]) == 0
