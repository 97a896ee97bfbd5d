"""Refuses a wrong command line once, where every check would fail for it."""

from __future__ import annotations

import pytest

from motorctl.hal.conformance.test_driver import rig_maker


def pytest_collection_modifyitems(config: pytest.Config) -> None:
    """Look at the options. Raises pytest.UsageError where they are wrong."""
    rig_maker(config)
