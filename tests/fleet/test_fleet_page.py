"""What docs/fleet.md says of the store is so: its columns, and its examples run."""

from __future__ import annotations

import re
from pathlib import Path

import duckdb
import pytest
from fleet_bench import store_of
from fleet_logs import told_anew

from motorctl.fleet.findings import FIELDS

TEXT = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


def test_the_page_names_every_column() -> None:
    table = TEXT[TEXT.index("| column |") : TEXT.index("With DuckDB")]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("|")]
    named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert named == list(FIELDS)


def test_the_examples_of_the_page_run(
    good_log: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    other = told_anew(good_log, tmp_path / "2.parquet", machine="stage-2")
    store_of(tmp_path / "findings", [good_log, other])
    monkeypatch.chdir(tmp_path)

    weeks, refused = blocks("sql")
    rows = duckdb.sql(weeks).fetchall()
    assert [(row[0], row[1], row[5]) for row in rows] == [("stage-1", "x", 1), ("stage-2", "x", 1)]
    assert duckdb.sql(refused).fetchall() == []
    (newest,) = re.findall(r"`(QUALIFY [^`]*)`", TEXT)
    every = "SELECT count(*) FROM (SELECT * FROM 'findings/findings/*/*.parquet'"
    every_row, newest_rows = (duckdb.sql(f"{every} {end})").fetchall() for end in ("", newest))
    assert every_row == newest_rows

    (python,) = blocks("python")
    exec(python, {})
    said = capsys.readouterr().out
    assert "stage-2" in said
    assert "viscous_friction" in said
