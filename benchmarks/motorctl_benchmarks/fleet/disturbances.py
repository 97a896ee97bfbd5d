"""A fleet that is looked at while workers are killed, the scheduler dies, or a store refuses."""

from __future__ import annotations

import random
import subprocess
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motorctl.errors import RunError
from motorctl.fleet.cluster import engine
from motorctl.fleet.run import FleetRun, diagnose_fleet
from motorctl_benchmarks.fleet.own_cluster import (
    address_of,
    cluster_at,
    free_port,
    kill_a_worker,
)
from motorctl_benchmarks.fleet.refusing_store import refusing_store
from motorctl_benchmarks.fleet.same_findings import digests

MOST_RUNS = 20
"""After so many runs of one store something else is wrong."""


@dataclass(frozen=True)
class Disturbed:
    """What a disturbance did."""

    what: str
    how_often: int
    """Kills, or refused requests."""
    runs: int
    """Of the command, until all was done."""
    logs: int
    """Whose findings were compared."""
    other: int
    """That are not byte for byte those of the undisturbed run, or are missing."""

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return vars(self)


def undisturbed(logs: Path, store: Path, workers: int) -> FleetRun:
    """Look at all logs with nothing in the way."""
    return diagnose_fleet([f"{logs}/**/*.parquet"], store, diagnoses=0, workers=workers)


def with_killed_workers(
    logs: Path, whole: Path, folder: Path, *, kills: int, workers: int, seed: int
) -> Disturbed:
    """Kill workers at random until there were so many kills; look at the logs meanwhile.

    After each kill none to two logs have to be done before the next one: by the clock alone a
    computer that is busy would never get any done.

    Parameters
    ----------
    logs
        A folder of logs.
    whole
        The store of the undisturbed run.
    folder
        Where the disturbed stores go: a new one whenever all was done before the last kill.
    kills, workers, seed
        How many, of how many at a time, and drawn from what.
    """
    rng = random.Random(seed)
    done, other, runs, compared = 0, 0, 0, 0
    expected = digests(whole)
    finished = threading.Event()
    with engine(None, workers) as client:

        def kill() -> None:
            nonlocal done
            aim = 0
            while done < kills and not finished.wait(rng.uniform(0.0, 0.3)):
                kept = len(list(folder.glob("killed-*/findings/*/*.parquet")))
                if kept >= aim and kill_a_worker(client, rng):
                    done += 1
                    aim = kept + rng.randrange(3)

        killer = threading.Thread(target=kill, daemon=True)
        killer.start()
        try:
            for round_ in range(10 * kills):
                store = folder / f"killed-{round_}"
                for _ in range(MOST_RUNS):
                    runs += 1
                    run = _look(logs, store, address_of(client))
                    if run is not None and not run.refused:
                        break
                compared += len(expected)
                other += differing(expected, digests(store))
                if done >= kills:
                    break
        finally:
            finished.set()
            killer.join()
    return Disturbed("workers killed at random", done, runs, compared, other)


def _look(logs: Path, store: Path, scheduler: str) -> FleetRun | None:
    try:
        return diagnose_fleet([f"{logs}/**/*.parquet"], store, diagnoses=0, scheduler=scheduler)
    except RunError:
        return None


def with_killed_scheduler(
    logs: Path, whole: Path, store: Path, *, kills: int, workers: int
) -> Disturbed:
    """Kill the scheduler of a cluster while it looks at logs, begin it anew, and go on."""
    expected = digests(whole)
    runs = done = 0
    for _ in range(MOST_RUNS):
        runs += 1
        port = free_port()
        with cluster_at(port, workers) as scheduler:
            aim = len(digests(store)) + max(1, len(expected) // (kills + 1))
            finished = threading.Event()
            killer = threading.Thread(
                target=_kill_at, args=(scheduler, store, aim, finished), daemon=True
            )
            if done < kills:
                killer.start()
            run = _look(logs, store, f"tcp://127.0.0.1:{port}")
            finished.set()
            if done < kills:
                killer.join()
                done += scheduler.poll() is not None
        if run is not None and not run.refused:
            break
    return Disturbed(
        "scheduler killed", done, runs, len(expected), differing(expected, digests(store))
    )


def _kill_at(
    scheduler: subprocess.Popen[bytes], store: Path, aim: int, finished: threading.Event
) -> None:
    """Kill the scheduler once so many logs are done."""
    while not finished.wait(0.02):
        if len(list(store.glob("findings/*/*.parquet"))) >= aim:
            scheduler.kill()
            scheduler.wait()
            return


def with_refusing_store(
    logs: Path, whole: Path, store: Path, *, one_in: int, workers: int
) -> Disturbed:
    """Read the logs from an object store that refuses one request in so many."""
    expected = digests(whole, but_where=True)
    with refusing_store(logs, one_in) as (pattern, door):
        runs = 0
        while runs < MOST_RUNS:
            runs += 1
            run = diagnose_fleet([pattern], store, diagnoses=0, workers=workers)
            if not run.refused:
                break
        refused = door.refused
    return Disturbed(
        f"an S3 store that refuses one request in {one_in}",
        refused,
        runs,
        len(expected),
        differing(expected, digests(store, but_where=True)),
    )


def differing(expected: dict[str, str], found: dict[str, str]) -> int:
    """Return how many files are not the same, or only in one of two stores."""
    return sum(expected.get(name) != found.get(name) for name in expected.keys() | found.keys())
