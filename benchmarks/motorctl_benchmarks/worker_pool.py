"""Cases in worker processes, each on one thread; results are written down as they come."""

from __future__ import annotations

import contextlib
import itertools
import json
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, Protocol, TextIO, TypeVar

from motorctl.errors import RunError, UsageError
from motorctl.latency.progress import Progress

MOST_RESIDENT_BYTES = 1_500_000_000
"""Memory [B] with which a worker is exchanged for a fresh process once its case is done. What numba
compiles for a configuration stays as long as its process, 0.1 to 0.2 GB for each loop that a
campaign closes. Larger takes memory, smaller spends time on starts. Chosen by hand."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

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
    workers = workers or len(os.sched_getaffinity(0))
    done: dict[int, Result] = {}
    with contextlib.ExitStack() as stack:
        file = stack.enter_context(_opened(out))
        stack.enter_context(_one_thread_each())
        waiting = iter(enumerate(tasks))
        running: dict[Future[tuple[Result, int]], tuple[int, _Worker]] = {}

        def begin_next(worker: _Worker) -> None:
            for k, task in itertools.islice(waiting, 1):
                running[worker.begin(run, task)] = k, worker

        pool = [stack.enter_context(_Worker()) for _ in range(min(workers, len(tasks)))]
        try:
            for worker in pool:
                begin_next(worker)
            while running:
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    result, resident = future.result()
                    k, worker = running.pop(future)
                    if resident > MOST_RESIDENT_BYTES:
                        worker.begin_anew()
                    begin_next(worker)
                    done[k] = result
                    if file is not None:
                        file.write(json.dumps(result.document()) + "\n")
                        file.flush()
                    progress(len(done) / len(tasks))
        except BrokenProcessPool as error:
            raise RunError(
                f"a worker process died after {len(done)} of {len(tasks)} cases; where memory is "
                "short, fewer --workers help"
            ) from error
    return [done[k] for k in range(len(tasks))]


class _Worker(contextlib.AbstractContextManager["_Worker"]):
    """A process that does one task at a time."""

    def __init__(self) -> None:
        self._process = _process()

    def begin(self, run: Callable[[Task], Result], task: Task) -> Future[tuple[Result, int]]:
        """Begin a task; the one before is done."""
        return self._process.submit(_done, run, task)

    def begin_anew(self) -> None:
        """Put a fresh process in the place of this one, which has no task."""
        self._process.shutdown()
        self._process = _process()

    def __exit__(self, *_: object) -> None:
        """Wait for the task that it does, and end the process."""
        self._process.shutdown(cancel_futures=True)


def _done(run: Callable[[Task], Result], task: Task) -> tuple[Result, int]:
    """Do a task in this process; return its result, and how much memory is resident then [B]."""
    return run(task), resident_bytes()


def resident_bytes(pages: Path = PAGES) -> int:
    """Return how much memory of this process is resident [B]; 0 where nobody tells."""
    try:
        return int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


def _process() -> ProcessPoolExecutor:
    # A forked process would share the threads' locks of this one.
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))


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
