"""What one more worker brings, and what the scheduler takes for each task.

Everything is counted in processor time, which others on the same computer do not lengthen much.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from distributed import Client, as_completed

from motorctl.fleet.cluster import engine
from motorctl.fleet.run import IN_FLIGHT, diagnose_fleet
from motorctl_benchmarks.fleet.own_cluster import address_of

WORKERS = (1, 2, 4)


@dataclass(frozen=True)
class Throughput:
    """A run of all logs by so many workers."""

    workers: int
    logs: int
    worker_s: float
    """Processor time of all workers."""
    client_s: float
    """That of the command, with the scheduler in it."""

    @property
    def logs_a_worker_second(self) -> float:
        """Of a worker's processor time."""
        return self.logs / self.worker_s


def throughputs(logs: Path, folder: Path) -> list[Throughput]:
    """Look at the same logs with 1, 2 and 4 workers, each into a new store."""
    found = []
    for workers in WORKERS:
        with engine(None, workers) as client:
            # each worker's first log compiles and imports: that is not what is asked
            for k in range(2):
                store = folder / f"{workers}-{k}"
                spent = _Spent()
                with spent.by(client):
                    run = diagnose_fleet(
                        [f"{logs}/**/*.parquet"],
                        store,
                        diagnoses=0,
                        scheduler=address_of(client),
                    )
        found.append(Throughput(workers, run.looked_at, spent.worker_s, spent.client_s))
    return found


def scheduling_s(tasks: int) -> float:
    """Return the processor time of client and scheduler for one tiny task [s].

    As many tasks as a run keeps are in flight; the client submits another for each that is done.
    """
    with engine(None, 1) as client:
        submit = [client.submit(int, k, pure=False) for k in range(IN_FLIGHT)]
        spent = _Spent()
        with spent.by(client):
            running = as_completed(submit)
            left = tasks - len(submit)
            for future in running:
                future.release()
                if left > 0:
                    left -= 1
                    running.add(client.submit(int, left, pure=False))
    return spent.client_s / tasks


class _Spent:
    worker_s = 0.0
    client_s = 0.0

    @contextmanager
    def by(self, client: Client) -> Iterator[None]:
        before, own = _workers_s(client), time.process_time()
        yield
        self.client_s = time.process_time() - own
        self.worker_s = _workers_s(client) - before


def _workers_s(client: Client) -> float:
    return float(sum(client.run(time.process_time).values()))
