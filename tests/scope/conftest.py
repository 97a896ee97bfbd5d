"""Where pictures of the scope's page go, and a log that its tests show."""

from __future__ import annotations

from pathlib import Path

import pytest
from recorded_rows import make_rows, write_log

from motorctl.log.sample import AxisState, FaultCause


def pytest_addoption(parser: pytest.Parser) -> None:
    """Take a folder for pictures: `pytest tests/scope -m slow --screenshots docs`."""
    parser.addoption("--screenshots", metavar="DIR", help="where pictures of the scope's page go")


@pytest.fixture
def pictures(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return the folder for pictures; one that is gone later where none is named."""
    return Path(request.config.getoption("--screenshots", default=None) or tmp_path)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log in which axis x goes into a fault, and y begins to run later."""
    ticks, samples = make_rows(4000)
    samples["state"][:1000, 1] = AxisState.IDLE
    samples["state"][:500, 0] = AxisState.IDLE
    samples["state"][3000:, 0] = AxisState.FAULT
    samples["fault"][3000:, 0] = FaultCause.FOLLOWING_ERROR
    path: Path = write_log(
        tmp_path / "run.parquet", (ticks, samples), {"rate_hz": 1000.0, "machine": "bench"}
    )
    return path
