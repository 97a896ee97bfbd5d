"""Workers of a campaign: fresh processes where they have grown, and results in order."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pytest

from motorctl.errors import RunError
from motorctl_benchmarks import worker_pool
from motorctl_benchmarks.worker_pool import resident_bytes, run_tasks

LEFT_MB = 100
kept: list[Any] = []


@dataclass(frozen=True)
class Seen:
    """What a task saw of its process."""

    task: int
    process: int
    resident_mb: float

    def document(self) -> dict[str, Any]:
        return asdict(self)


def leave_memory_behind(task: int) -> Seen:
    kept.append(np.ones(LEFT_MB * 1_000_000 // 8))
    return Seen(task, os.getpid(), resident_bytes() / 1e6)


def die_at_two(task: int) -> Seen:
    if task == 2:
        os._exit(1)
    return Seen(task, os.getpid(), 0.0)


@pytest.mark.slow
def test_a_worker_that_has_grown_is_exchanged_for_a_fresh_process(monkeypatch, tmp_path):
    shares, out = [], tmp_path / "seen.jsonl"
    one = run_tasks(leave_memory_behind, [0], shares.append, 1)[0].resident_mb
    monkeypatch.setattr(worker_pool, "MOST_RESIDENT_BYTES", 1e6 * (one + 0.5 * LEFT_MB))
    found = run_tasks(leave_memory_behind, range(4), shares.append, 1, out)
    assert [seen.task for seen in found] == list(range(4))
    assert len({seen.process for seen in found}) == 2
    assert max(seen.resident_mb for seen in found) < one + 1.5 * LEFT_MB
    assert len(out.read_text().splitlines()) == 4
    assert shares[1:] == [0.25, 0.5, 0.75, 1.0]


@pytest.mark.slow
@pytest.mark.long
def test_workers_that_stay_small_stay():
    found = run_tasks(leave_memory_behind, range(4), lambda _: None, 2)
    assert [seen.task for seen in found] == list(range(4))
    assert len({seen.process for seen in found}) <= 2


@pytest.mark.slow
def test_a_worker_that_dies_is_told_with_how_many_cases_were_done():
    with pytest.raises(RunError, match="died after 2 of 4 cases"):
        run_tasks(die_at_two, range(4), lambda _: None, 1)


def test_where_nobody_tells_of_memory_none_is_counted(tmp_path):
    assert resident_bytes(tmp_path / "absent") == 0
    assert resident_bytes() > 1_000_000
