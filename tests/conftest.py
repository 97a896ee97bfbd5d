"""What all tests share."""

import pytest
import real_time


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    real_time.note(item)
