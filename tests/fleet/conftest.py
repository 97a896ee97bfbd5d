"""Logs that the tests of a fleet share: simulated once."""

from __future__ import annotations

from pathlib import Path

import pytest
from fleet_logs import plant_log


@pytest.fixture(scope="package")
def good_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return plant_log(tmp_path_factory.mktemp("fleet") / "stage-1.parquet")
