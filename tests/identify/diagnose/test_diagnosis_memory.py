"""What a diagnosis needs: memory grows with the motion, not with all that is tried on it."""

from __future__ import annotations

import gc
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from fit_plant import C1
from other_plant import OtherPlant
from threadpoolctl import threadpool_info, threadpool_limits

from motorctl.errors import DataError
from motorctl.identify.columns import measured
from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose import recording
from motorctl.identify.diagnose.search.held_out_blocks import (
    make_blocks,
    make_problem,
    total_with,
    with_columns,
)
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.smooth_functions import SmoothFunctions
from motorctl.identify.diagnose.search.whole_model import NUISANCES, seen_inertia
from motorctl.log import AxisRecording, Recording

LATER = """
import numpy as np
from motorctl.identify.diagnose.freed_memory import give_freed_memory_back

def resident_mb():
    with open("/proc/self/statm") as pages:
        return int(pages.read().split()[1]) * 4096 / 1e6

arrays = [np.ones(12_000) for _ in range(2000)]  # of 96 kB: none gets pages of its own
last = arrays[-1]
del arrays[:]
kept = resident_mb()
give_freed_memory_back()
print(kept - resident_mb())
"""


@pytest.fixture
def declared(monkeypatch):
    """Return the declared model on a motion in sixteen stretches, as one of half an hour is."""
    monkeypatch.setattr(measured, "LONGEST_STRETCH", 1024)
    signals = make_signals(OtherPlant().run(seed=3, duration_s=16.0), slope_s_m=900.0)
    assert len(signals.stretches) > 10
    blocks = make_blocks(signals.rows, signals.row_period_s)
    return Hypothesis(Regressors(signals, C1, blocks)).refreshed()


def test_functions_of_place_and_speed_are_never_all_there_at_once(declared):
    smooth = SmoothFunctions(declared.regressors.signals)
    together = sum(smooth.columns(name).nbytes for name in NUISANCES)
    del smooth
    declared.regressors.signals = declared.regressors.signals.with_stretches(
        declared.regressors.signals.stretches
    )  # without what was kept
    assert declared.problem.columns.size  # formed before
    gc.collect()
    tracemalloc.start()
    seen = seen_inertia(declared)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert seen is not None
    assert most < together


@pytest.mark.parametrize("lengths", [(1000,), (7, 400, 593), (250,) * 4, (999, 1)])
def test_columns_that_come_in_parts_have_the_products_of_the_whole(lengths):
    draw = np.random.default_rng(5)
    X, y, added = draw.normal(size=(3, 1000)), draw.normal(size=1000), draw.normal(size=(4, 1000))
    problem = make_problem(make_blocks(1000, 0.01), X, y)
    parts = np.split(added, np.cumsum(lengths)[:-1], axis=1)
    assert np.array_equal(total_with(problem, parts), with_columns(problem, added).total)


def test_functions_of_place_and_speed_are_the_same_apart_and_together(declared):
    smooth = SmoothFunctions(declared.regressors.signals)
    apart = np.concatenate(list(smooth.columns_apart(NUISANCES)), axis=1)
    np.testing.assert_array_equal(apart, np.vstack([smooth.columns(name) for name in NUISANCES]))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux for its memory")
def test_memory_that_one_axis_needed_is_given_back():
    run = subprocess.run([sys.executable, "-c", LATER], capture_output=True, text=True, check=True)
    assert float(run.stdout) > 100.0


def test_it_is_given_back_after_each_axis_whatever_became_of_it(monkeypatch):
    given = []
    monkeypatch.setattr(recording, "give_freed_memory_back", lambda: given.append(True))
    still = np.zeros(1000)
    axes = {name: AxisRecording(name, still, still) for name in "xy"}
    with pytest.raises(DataError, match="no motion"):
        recording.diagnose_recording(
            Recording("still", 1000.0, np.arange(1000) / 1000.0, axes), dict.fromkeys("xy", C1)
        )
    assert len(given) == 2


def test_matrices_are_multiplied_in_one_thread_whatever_the_computer_has(monkeypatch):
    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    seen: list[set[int]] = []

    def looked(*_: object) -> None:
        seen.append(threads())
        raise DataError("seen")

    monkeypatch.setattr(recording, "diagnose_axis", looked)
    still = np.zeros(1000)
    one = Recording(
        "still", 1000.0, np.arange(1000) / 1000.0, {"x": AxisRecording("x", still, still)}
    )
    with threadpool_limits(2, "blas"):
        with pytest.raises(DataError, match="seen"):
            recording.diagnose_recording(one, {"x": C1})
        assert seen == [{1}]
        assert threads() == {2}
