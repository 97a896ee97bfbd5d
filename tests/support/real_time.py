"""Which tests run in real time: those that carry the mark `wall_clock`, and no others may.

A peer in another thread or process, or a loop on the wall clock, is disturbed by tests beside it.
Whatever starts one calls `begins`, so that a test that forgot the mark fails every time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a rig also serves where there is no pytest, as in a virtual machine
    import pytest

_running: list[pytest.Item] = []


def note(item: pytest.Item) -> None:
    """Note which test is about to run."""
    _running[:] = [item]


def begins() -> None:
    """Fail the test that runs now if it has no mark `wall_clock`."""
    for item in _running:
        import pytest

        if item.get_closest_marker("wall_clock") is None:
            pytest.fail(f"{item.nodeid} runs in real time: it needs pytest.mark.wall_clock")


def does_not_matter() -> None:
    """Let the test that runs now go without the mark: other work cannot disturb what it judges."""
    _running.clear()
