"""The reference tells every key and column, and cannot be behind the program."""

import re
from enum import IntEnum

import pytest
import reference
from reference import COLUMNS, KEYS, ROOT, described_members, main, pages

from motorctl.hal.registry import installed_drivers
from motorctl.log import LogAxis
from motorctl.log.columns import log_columns
from motorctl.log.sample import AxisState, FaultCause, SampleFlag


def test_the_pages_are_up_to_date():
    assert main(["--check"]) == 0, "python tools/reference.py"


def test_a_page_that_is_behind_is_found_and_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(reference, "ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    assert main(["--check"]) == 1
    assert "docs/reference/keys.md and docs/reference/log_columns.md" in capsys.readouterr().out
    assert not (tmp_path / KEYS).exists()
    assert main([]) == 0
    assert main(["--check"]) == 0


def test_every_column_of_a_log_is_told_and_every_code():
    page = pages()[COLUMNS]
    for column in log_columns([LogAxis("AXIS", ("inertia",), dual_drive=True)]):
        assert f"| `{column.name.replace('hat_inertia', 'hat_…')}` |" in page
    for codes in (AxisState, FaultCause, SampleFlag):
        for code in codes:
            assert re.search(rf"\| {code.value}( \(bit \d+\))? \| `{code.name}` \| \S", page)


def test_every_option_of_every_driver_is_told_with_its_meaning():
    page = (ROOT / KEYS).read_text()
    for entry in installed_drivers():
        section = page.partition(f"\n## drivers.NAME, type {entry.name}\n")[2].partition("\n## ")[0]
        for option in entry.driver.Options.model_fields:
            assert re.search(rf"\| `{option}` \| \S", section), (entry.name, option)


def test_a_code_that_nothing_tells_is_refused():
    class Told(IntEnum):
        ONE = 1
        """First."""
        TWO = 2

    with pytest.raises(SystemExit, match=r"Told.TWO has no string"):
        described_members(Told)
