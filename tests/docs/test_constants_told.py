"""The check that every number of the identification says what it is."""

from pathlib import Path

import pytest
from constants_told import PACKAGE, main, untold

TOLD = '"""Longest rest [s]. Chosen by hand."""\n'


@pytest.mark.parametrize(
    "line",
    [
        "REST_S = 0.5",
        "REST_S: float = -0.5",
        "SLOW, FAST = 1, 2",
        'SPEEDS = {"m": 50.0}',
        "N = 1 << 3",
    ],
)
def test_a_number_without_a_string_under_it_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "module.py").write_text(f"{line}\n\n\ndef rest(): ...\n")
    assert main([str(tmp_path)]) == 1
    (tmp_path / "module.py").write_text(f"{line}\n{TOLD}")
    assert main([str(tmp_path)]) == 0


def test_only_numbers_in_capitals_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(
        'NAME = "x"\nON = True\ncount = 3\nFIRST = []\nTWICE = [2 * n for n in (1, 2)]\n'
    )
    assert not list(untold(path))


def test_no_number_of_the_identification_is_without_words() -> None:
    assert main([str(PACKAGE)]) == 0
