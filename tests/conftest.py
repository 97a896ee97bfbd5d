"""What all tests share."""

import os
import tempfile

import pauses
import pytest
import real_time

_state = tempfile.TemporaryDirectory(prefix="motorctl-state-")
os.environ["XDG_STATE_HOME"] = _state.name  # what tests learn or choose is nobody's


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    anew = pytest.mark.flaky(reruns=pauses.ANEW, condition=pauses.was_interrupted)
    for item in items:
        if item.get_closest_marker("wall_clock"):
            item.add_marker(anew)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    real_time.note(item)
    if item.get_closest_marker("wall_clock"):
        pauses.begin()
