"""The page on Python is true: its examples run one after the other."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from daemon_rig import Daemon

import motorctl

PAGE = Path(__file__).parents[2] / "docs" / "python.md"
TEXT = PAGE.read_text()
BLOCKS = re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


def test_the_page_names_every_public_name() -> None:
    results = {"AsyncConnection", "Connection", "Samples", "Subscription"}
    assert not [name for name in {*motorctl.__all__} - results if name not in TEXT]


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    with Daemon(tmp_path / "daemon") as running:
        yield running


@pytest.mark.slow
@pytest.mark.wall_clock(lanes=3)
def test_the_examples_of_the_page_run_one_after_the_other(
    daemon: Daemon,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert len(BLOCKS) == 5
    names: dict[str, Any] = {}
    said = []
    for block in BLOCKS:
        exec(block.replace("/tmp/m.sock", str(daemon.socket)), names)
        said.append(capsys.readouterr().out)
    logs, lacks, running, _, samples = said
    assert "('x', 'y') 5000.0 5.0" in logs
    assert "position - reference" in logs
    assert "cogging" in lacks
    assert "+      cogging:" in lacks
    assert "idle" in running
    assert "0 lost" in samples
    assert daemon.state("y") == "idle"
