"""Refuses a wrong command line once, where every check would fail for it."""

from __future__ import annotations

import pytest

from motorctl.model.conformance.test_effect import named_effect


def pytest_collection_modifyitems(config: pytest.Config) -> None:
    """Look at the options. Raises pytest.UsageError where they are wrong."""
    named_effect(config)
