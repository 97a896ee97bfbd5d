"""Where pictures of the scope's page go."""

from __future__ import annotations

from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Take a folder for pictures: `pytest tests/scope -m slow --screenshots docs`."""
    parser.addoption("--screenshots", metavar="DIR", help="where pictures of the scope's page go")


@pytest.fixture
def pictures(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return the folder for pictures; one that is gone later where none is named."""
    return Path(request.config.getoption("--screenshots", default=None) or tmp_path)
