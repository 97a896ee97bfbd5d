"""The arithmetic of docs/recording.md follows from what it says was measured."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "recording.md").read_text()
HOURS_A_YEAR = 8760


def test_what_a_flash_disk_is_written_in_a_year_is_what_the_table_above_it_comes_to() -> None:
    row = re.search(
        r"two axes of 6 parameters, 5 kHz \| ([\d.]+) GB \| ([\d.]+) GB \| ([\d.]+) TB", PAGE
    )
    worn = re.search(r"([\d.]+) GB in an hour of two axes at 5 kHz, (\d+) TB in a year", PAGE)
    assert row
    assert worn
    recorded_gb, closed_gb, closed_tb = map(float, row.groups())
    assert float(worn[1]) == pytest.approx(recorded_gb + closed_gb)
    assert float(worn[2]) == pytest.approx(float(worn[1]) * HOURS_A_YEAR / 1e3, abs=0.5)
    assert closed_tb == pytest.approx(closed_gb * HOURS_A_YEAR / 1e3, rel=0.03)
