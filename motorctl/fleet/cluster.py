"""The engine: Dask, a cluster of processes on this computer or one that is there already."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

import dask
from distributed import Client, LocalCluster

from motorctl.errors import UsageError
from motorctl.version import VERSION

LOOPBACK = "127.0.0.1"
WORKER_MEMORY_BYTES = 2_000_000_000
"""Beyond this a local worker is ended and its window begun anew. Larger lets a computer swap,
smaller ends the diagnosis of a window of `MOST_ROWS` rows of several axes. Measured: it takes
less than half."""
CONNECT_S = 10.0
"""How long a scheduler is waited for, and then one of its workers [s]. Longer keeps waiting for a
wrong address, shorter gives up busy ones. Chosen by hand."""
AGAIN_S = 0.2
"""After so long workers are asked again where none answers [s]. Longer begins later, shorter asks
more often. Chosen by hand."""
_LOCAL: dict[str, list[str] | str | bool] = {
    # a worker that was ended is begun anew by its nanny, however long a busy computer takes:
    # by default it is given up after 15 s, and a run whose workers are all given up waits for ever
    "distributed.deploy.lost-worker-timeout": "1 day",
    # what a page of its own would show; no browser is meant to look in
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.nanny.http.routes": [],
}


@contextmanager
def engine(
    scheduler: str | None, workers: int | None, *, memory_bytes: int = WORKER_MEMORY_BYTES
) -> Iterator[Client]:
    """Connect to a scheduler, or run a cluster of processes that only this computer reaches.

    Parameters
    ----------
    scheduler
        As ``tcp://host:8786``; None: a local cluster.
    workers
        Processes of the local cluster, each with one thread; None: one a CPU.
    memory_bytes
        Beyond which one of these is begun anew; 0: never.

    Raises
    ------
    UsageError
        Where the scheduler does not answer, has no workers, or its workers have another motorctl.
    """
    if scheduler is not None:
        if workers is not None:
            raise UsageError("--workers is of a local cluster: leave it out with --scheduler")
        with _connected(scheduler) as client:
            yield client
        return
    with (
        dask.config.set(_LOCAL),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",
            memory_limit=memory_bytes,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


@contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    try:
        client = Client(scheduler, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(f"--scheduler {scheduler}: does not answer: {error}") from error
    with client:
        try:
            versions = _versions(client)
        except OSError as error:
            raise UsageError(f"--scheduler {scheduler}: does not answer: {error}") from error
        if not versions:
            raise UsageError(f"--scheduler {scheduler}: it has no workers: start some first")
        for worker, version in versions.items():
            if isinstance(version, Exception):
                raise UsageError(
                    f"--scheduler {scheduler}: its workers have no motorctl ({version}): install "
                    f"{VERSION} there"
                ) from version
            if version != VERSION:
                raise UsageError(
                    f"--scheduler {scheduler}: worker {worker} has motorctl {version}, this is "
                    f"{VERSION}: install the same"
                )
        yield client


def _versions(client: Client) -> dict[str, str | Exception]:
    """Ask workers which motorctl they have; those that are just being begun anew get some time."""
    deadline = time.monotonic() + CONNECT_S
    while True:
        told = client.run(_version, on_error="return")
        # a worker that cannot be reached is one that was ended: its scheduler will notice
        answers = {worker: each for worker, each in told.items() if not isinstance(each, OSError)}
        if answers or time.monotonic() > deadline:
            return answers
        time.sleep(AGAIN_S)


def _version() -> str:
    return VERSION
