"""The check that every number of identification and model says what it is."""

from pathlib import Path

import pytest
from constants_told import PACKAGES, main, untold

TOLD = '"""Longest rest [s]. Larger takes time, smaller misses it. Chosen by hand."""\n'


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


@pytest.mark.parametrize(
    ("words", "missing"),
    [
        ("Longest rest [s].", ["what breaks", "where it comes from"]),
        ("Longest rest [s]. Chosen by hand.", ["what breaks"]),
        ("Longest rest that is measured [s]. Larger takes time.", ["where it comes from"]),
        ("No more than so many rests are larger. Measured on one machine.", ["what breaks"]),
        (
            "Speeds in which nothing is larger by definition.",
            ["what breaks", "where it comes from"],
        ),
        ("Rests; fewer tell nothing, more take time. Learned by learn_rests.py.", []),
        ("Width [inch]. Only looks depend on it. Convention.", []),
        ("Width [inch]. Only looks depend on it.", ["where it comes from"]),
        ("Seed of the noise. Any other would do as well. Convention.", []),
        ("Factor of the kernel. Published in Andrews 1991, eq. 6.2.", []),
        ("Seconds in a minute. By definition.", []),
    ],
)
def test_a_number_says_what_breaks_and_where_it_comes_from(
    tmp_path: Path, words: str, missing: list[str]
) -> None:
    path = tmp_path / "module.py"
    path.write_text(f'REST_S = 0.5\n"""{words}"""\n')
    found = [told for _, _, told in untold(path)]
    assert len(found) == len(missing)
    assert all(expected in told for expected, told in zip(missing, found, strict=True))


def test_only_numbers_in_capitals_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(
        'NAME = "x"\nON = True\ncount = 3\nFIRST = []\nTWICE = [2 * n for n in (1, 2)]\n'
    )
    assert not list(untold(path))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_no_number_of_identification_and_model_is_without_words(package: Path) -> None:
    assert main([str(package)]) == 0
