"""Clusters of this computer whose processes can be found and killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from random import Random

from distributed import Client
from distributed.core import Status

START_S = 60.0
LOOPBACK = "127.0.0.1"


def address_of(client: Client) -> str:
    """Return where the scheduler of a client is."""
    assert client.scheduler is not None
    return str(client.scheduler.address)


def kill_a_worker(client: Client, rng: Random) -> bool:
    """Kill one of the workers of a local cluster that run; return whether one did."""
    assert client.cluster is not None
    nannies = list(client.cluster.workers.values())
    pids = [each.pid for each in nannies if each.pid and each.status is Status.running]
    if not pids:
        return False
    try:
        os.kill(rng.choice(pids), signal.SIGKILL)
    except ProcessLookupError:
        return False
    return True


@contextmanager
def cluster_at(port: int, workers: int) -> Iterator[subprocess.Popen[bytes]]:
    """Run scheduler and workers as somebody else's cluster; gives the scheduler's process."""
    address = f"tcp://{LOOPBACK}:{port}"
    at_home = ("--host", LOOPBACK, "--no-dashboard")
    alone = ("--nthreads", "1", "--no-nanny")
    scheduler = _started("distributed.cli.dask_scheduler", *at_home, "--port", str(port))
    own = [
        _started("distributed.cli.dask_worker", address, *at_home, *alone) for _ in range(workers)
    ]
    try:
        with Client(address, timeout=START_S) as client:
            client.wait_for_workers(workers, timeout=START_S)
        yield scheduler
    finally:
        for process in (*own, scheduler):
            process.kill()
        for process in (*own, scheduler):
            process.wait()


def free_port() -> int:
    """Return a port of this computer that nobody uses just now."""
    with socket.socket() as door:
        door.bind((LOOPBACK, 0))
        return int(door.getsockname()[1])


def _started(module: str, *words: str) -> subprocess.Popen[bytes]:
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    command: Sequence[str] = [sys.executable, "-m", module, *words]
    return subprocess.Popen(
        command,
        env=os.environ | one_thread,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
