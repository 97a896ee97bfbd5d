"""What all tests share."""

import gc
import os
import tempfile
from pathlib import Path

import pauses
import pytest
import real_time
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

from motorctl.garbage import SELDOM

_USUAL = gc.get_threshold()
gc.set_threshold(*SELDOM)  # until all is imported; see pytest_collection_finish
_state = tempfile.TemporaryDirectory(prefix="motorctl-state-")
os.environ["XDG_STATE_HOME"] = _state.name  # what tests learn or choose is nobody's

# A run judges the change, not luck: the same examples each time, until a test's own text changes,
# however slow the computer is. `--hypothesis-profile explore` tries others.
_any_speed = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("same", _any_speed, derandomize=True, database=None, max_examples=50)
settings.register_profile(
    "explore", _any_speed, derandomize=False, print_blob=True, max_examples=300
)
settings.load_profile("same")


IN_LANES = "wall_clock(lanes=3)"
RARE = {
    "slow": ("slow",),
    "long": ("long", "few_of"),
    "wall_clock": ("wall_clock",),
    IN_LANES: (IN_LANES,),
}
"""Marks that few files give, and the words that give them: to import all the others takes longer
than what is asked of them."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files without any test of a mark that is asked for."""
    asked = config.option.markexpr.split(" and ")
    wanted = [mark for mark in RARE if mark in asked]
    if not wanted or collection_path.suffix != ".py" or collection_path.name == "conftest.py":
        return None
    text = collection_path.read_text(encoding="utf-8")
    if f"not {IN_LANES}" in asked:
        text = text.replace(IN_LANES, "")
    given = (any(word in text for word in RARE[mark]) for mark in wanted)
    return None if all(given) else True


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    anew = pytest.mark.flaky(reruns=pauses.ANEW, condition=pauses.was_interrupted)
    for item in items:
        if item.get_closest_marker("wall_clock") and not item.get_closest_marker("bears_pauses"):
            item.add_marker(anew)


def pytest_collection_finish() -> None:
    gc.set_threshold(*_USUAL)
    gc.collect()
    gc.freeze()  # thousands of tests and all modules: else each collection goes through them anew
    # As the diagnosis does by itself: threads wait longer than small matrices take, the more so
    # where other tests run beside, and round by their number.
    threadpool_limits(1, "blas")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    real_time.note(item)
    if item.get_closest_marker("wall_clock"):
        pauses.begin()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print how tests failed that were begun anew: whatever came of it, somebody should look."""
    failed: list[pytest.TestReport] = terminalreporter.stats.get("rerun", [])
    if failed:
        terminalreporter.section("failed and begun anew")
    for report in failed:
        terminalreporter.line(report.nodeid, bold=True)
        terminalreporter.line(report.longreprtext)
