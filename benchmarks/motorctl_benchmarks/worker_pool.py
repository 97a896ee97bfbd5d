"""Cases in worker processes, each on one thread; results are written down as they come."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, Protocol, TextIO, TypeVar

from motorctl.errors import RunError, UsageError
from motorctl.latency.progress import Progress

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


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
        # A forked process would share the threads' locks of this one.
        pool = ProcessPoolExecutor(
            min(workers, len(tasks)), mp_context=multiprocessing.get_context("spawn")
        )
        stack.enter_context(pool)
        futures = {pool.submit(run, task): k for k, task in enumerate(tasks)}
        try:
            for future in as_completed(futures):
                result = future.result()
                done[futures[future]] = result
                if file is not None:
                    file.write(json.dumps(result.document()) + "\n")
                    file.flush()
                progress(len(done) / len(tasks))
        except BrokenProcessPool as error:
            raise RunError(
                f"a worker process died after {len(done)} of {len(tasks)} cases; where memory is "
                "short, fewer --workers help"
            ) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
    return [done[k] for k in range(len(tasks))]


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
