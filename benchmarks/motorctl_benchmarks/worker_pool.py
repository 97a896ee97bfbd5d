"""Cases on the workers of a local Dask cluster, each on one thread; results come in order."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol, TextIO, TypeVar

import dask
from distributed import Client, KilledWorker, as_completed, get_worker

from motorctl.errors import RunError, UsageError
from motorctl.fleet.cluster import engine
from motorctl.latency.progress import Progress

MOST_RESIDENT_BYTES = 1_500_000_000
"""Memory [B] with which a worker is exchanged for a fresh process once its case is done. What numba
compiles for a configuration stays as long as its process, 0.1 to 0.2 GB for each loop that a
campaign closes. Larger takes memory, smaller spends time on starts. Chosen by hand."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_BESIDE: dict[str, int | bool] = {
    # a case that ends its process is told, and not begun again: it would end the next one, too
    "distributed.scheduler.allowed-failures": 0,
    # cases start processes of their own
    "distributed.worker.daemon": False,
}
PAGES = Path("/proc/self/statm")


class Documented(Protocol):
    """A result that can be written down."""

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""


Task = TypeVar("Task")
Result = TypeVar("Result", bound=Documented)


def run_tasks(
    run: Callable[[Task], Result],
    tasks: Sequence[Task],
    progress: Progress,
    workers: int | None = None,
    out: Path | None = None,
) -> list[Result]:
    """Run every task in worker processes; return the results in the tasks' order.

    Parameters
    ----------
    run
        What is done with a task: a function of a module, so that a process can be given it.
    tasks
        In the order in which they are begun.
    progress
        Called with the share done, 0 to 1.
    workers
        Processes; as many as there are CPUs for this process, if not given.
    out
        A file to which every result is written as a line of JSON, as soon as it is there.

    Raises
    ------
    UsageError
        The file cannot be written.
    RunError
        A worker dies.
    """
    most = min(workers or len(os.sched_getaffinity(0)), len(tasks))
    done: dict[int, Result] = {}
    places: dict[Any, int] = {}
    waiting = iter(enumerate(tasks))
    died: KilledWorker | None = None
    with _opened(out) as file, _told_first(lambda: died), _cluster(most) as client:
        running = as_completed()

        def begin(count: int) -> None:
            for k, task in itertools.islice(waiting, count):
                future = client.submit(_done, run, task, pure=False)
                places[future.key] = k
                running.add(future)

        begin(most)
        for future in running:
            try:
                result, resident, worker = future.result()
            except KilledWorker as error:
                died = error
                break
            future.release()
            if resident > MOST_RESIDENT_BYTES:
                client.restart_workers([worker])
            begin(1)
            done[places.pop(future.key)] = result
            if file is not None:
                file.write(json.dumps(result.document()) + "\n")
                file.flush()
            progress(len(done) / len(tasks))
    if died is not None:
        raise RunError(
            f"a worker process died after {len(done)} of {len(tasks)} cases; where memory is "
            "short, fewer --workers help"
        ) from died
    return [done[k] for k in range(len(tasks))]


def _done(run: Callable[[Task], Result], task: Task) -> tuple[Result, int, str]:
    """Do a task; return its result, how much memory is resident then [B], and where that is."""
    return run(task), resident_bytes(), str(get_worker().address)


@contextlib.contextmanager
def _told_first(died: Callable[[], Exception | None]) -> Iterator[None]:
    """Let pass that a cluster cannot end in time whose worker died: that is what is to be told."""
    try:
        yield
    except TimeoutError:
        if died() is None:
            raise


@contextlib.contextmanager
def _cluster(workers: int) -> Iterator[Client]:
    """Run workers that are not ended for their memory: they are exchanged between cases."""
    with (
        _one_thread_each(),
        dask.config.set(_BESIDE),
        engine(None, workers, memory_bytes=0) as client,
    ):
        yield client


def resident_bytes(pages: Path = PAGES) -> int:
    """Return how much memory of this process is resident [B]; 0 where nobody tells."""
    try:
        return int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that are started meanwhile compute on one thread: there is one a CPU."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _opened(path: Path | None) -> Iterator[TextIO | None]:
    if path is None:
        yield None
        return
    try:
        file = path.open("w", encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    with file:
        yield file
