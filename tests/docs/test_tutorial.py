"""The tutorial tells what happens: its commands in virtual time, as a reader types them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typed_page import DOCS, blocks_of, typed

TEXT = (DOCS / "tutorial.md").read_text()
BLOCKS = blocks_of(TEXT)
COMMANDS = [block for language, block in BLOCKS if language == "sh"]
SHOWN = "\n".join(block for language, block in BLOCKS if not language)
ERRORS = re.compile(r"([xy]): eM µm ([\d.]+), eF µm ([\d.]+), L2\[e\] µm ([\d.]+), uM V ([\d.]+)")
CLOSE = 0.05
"""Of a figure: processors round differently, and the adaptation goes on from there."""
pytestmark = [pytest.mark.slow, pytest.mark.long]


def errors(text: str) -> list[tuple[str, list[float]]]:
    return [(axis, [float(value) for value in told]) for axis, *told in ERRORS.findall(text)]


@pytest.mark.timeout(1500)
def test_the_tutorial_finds_adds_and_gains_what_it_tells(tmp_path: Path) -> None:
    virtual = [block for block in COMMANDS if "/tmp/m.sock" not in block]
    assert len(virtual) == 6
    said = "".join(typed(block, tmp_path) for block in virtual)
    assert "valid: published-gantry" in said

    (told,) = re.findall(r"axis y: The model lacks (.+): held-out", SHOWN)
    assert f"axis y: The model lacks {told}: held-out" in said
    assert f"added {told.replace(' and ', ', ')}" in said
    assert (tmp_path / "report" / "diagnosis.html").is_file()
    assert (tmp_path / "report" / "y_cogging.png").is_file()
    assert (tmp_path / "pictures" / "tracking_error_y.png").is_file()

    found = errors(said)
    assert len(errors(SHOWN)) == 3
    for axis, figures in errors(SHOWN):
        assert any(
            axis == other and figures == pytest.approx(values, rel=CLOSE) for other, values in found
        ), (axis, figures, found)
    before, after = (
        float(re.search(rf"│ {run} +│ +[\d.]+ │ +([\d.]+) │", SHOWN)[1])  # type: ignore[index]
        for run in ("before", "after")
    )
    final = [values[1] for axis, values in found if axis == "y"]
    assert final[:2] == pytest.approx([before, after], rel=CLOSE)
