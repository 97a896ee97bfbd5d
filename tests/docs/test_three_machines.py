"""The page of three machines tells what happens: its commands in virtual time, one by one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typed_page import DOCS, blocks_of, typed

TEXT = (DOCS / "three_machines.md").read_text()
CHAPTERS = {
    title: blocks_of(words)
    for title, words in re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", TEXT, re.M | re.S)
}
MACHINES = [title for title, blocks in CHAPTERS.items() if blocks]

pytestmark = [pytest.mark.slow, pytest.mark.long]


@pytest.mark.timeout(1500)
@pytest.mark.parametrize("machine", MACHINES)
def test_a_machine_is_begun_checked_simulated_and_diagnosed_as_told(
    tmp_path: Path, machine: str
) -> None:
    said, told = "", []
    for language, block in CHAPTERS[machine]:
        if language == "sh" and "/tmp/m.sock" not in block:
            said += typed(block, tmp_path)
        elif not language:
            told.append(block.strip())
    assert "valid: " in said
    place = 0
    for sentence in told:  # in the order of the page
        place = " ".join(said.split()).find(sentence, place)
        assert place >= 0, sentence
    assert list(tmp_path.glob("*_report/diagnosis.html"))
    if (tmp_path / "refined.yaml").is_file():
        before, after = (float(x) for x in re.findall(r"eF µrad ([\d.]+)", said)[1:3])
        assert after < 0.3 * before
