"""Look at every log of a fleet that was not looked at before, and keep what is found."""

from __future__ import annotations

import time
from asyncio import CancelledError
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from distributed import Client, Future, as_completed
from distributed.client import FutureCancelledError

from motorctl.config import load
from motorctl.errors import RunError, UsageError
from motorctl.fleet.cluster import engine
from motorctl.fleet.conflicts import conflicts_of
from motorctl.fleet.findings import Refusal, Row, table_of_log, table_of_refusal, whole_text
from motorctl.fleet.head import Declared, LogHead
from motorctl.fleet.job import Steps, steps_of
from motorctl.fleet.look import look_at_head
from motorctl.fleet.paths import logs_of
from motorctl.fleet.store import Store, key_of, open_store
from motorctl.identify.fit.declared_models import is_file

Progress = Callable[[str, float], None]

IN_FLIGHT = 4
"""Logs that are begun for each thread of the workers. Larger gives the scheduler more to hold,
smaller lets workers wait for the client. Chosen by hand."""
RETRIES = 2
"""How often a task that failed unexpectedly, as reading over a network may, is tried again. Larger
takes longer to tell what is broken, smaller gives up on passing troubles. Chosen by hand."""
HEADS = 0.05
"""Share of the whole that reading footers is. For progress alone."""


@dataclass
class FleetRun:
    """What a run did."""

    store: Path
    logs: int = 0
    """That the paths mean."""
    known: int = 0
    """Whose findings were there already."""
    twins: int = 0
    """The same as another one under another name."""
    copies: int = 0
    """Of rows of other logs: flight records, and what a scope caught; they are not looked at."""
    looked_at: int = 0
    hours: float = 0.0
    """Of recording that were looked at."""
    findings: int = 0
    """Rows that were kept."""
    refused: list[Refusal] = field(default_factory=list)
    """Logs that cannot be used, and folders that cannot be read."""
    seconds: float = 0.0

    @property
    def none_usable(self) -> bool:
        """Whether no log could be used."""
        return not self.looked_at + self.known + self.twins + self.copies

    def to_dict(self) -> dict[str, Any]:
        """Return the document of ``fleet diagnose --json``."""
        told = [{"source": each.source, "reason": each.reason} for each in self.refused]
        return {**vars(self), "store": str(self.store), "refused": told}


def diagnose_fleet(
    patterns: Sequence[str],
    store: Path,
    *,
    model: str | None = None,
    allow_code: Sequence[str] = (),
    diagnoses: int = 1,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> FleetRun:
    """Fit and diagnose every log that was not looked at before, and keep what is found.

    Parameters
    ----------
    patterns
        Paths of logs, or patterns of them, local or as fsspec names them.
    store
        The folder of findings; made where it is not there.
    model
        C1, C2 or a configuration; None: what each log declares.
    allow_code
        Modules that may be imported where a log's configuration names effects in them.
    diagnoses
        So many windows of each axis and log are searched for what the model lacks, those whose
        motion tells most; every one is fitted.
    scheduler
        Of a Dask cluster; None: a local one.
    workers
        Processes of the local one; None: one a CPU.
    progress
        Told what is being done, and the share that is done, 0 to 1; it never goes back.

    Returns
    -------
    FleetRun
        Counts, and in `refused` each log that cannot be used, with the reason.

    Raises
    ------
    UsageError
        Where no log is meant, the store is none or in use, or the scheduler cannot be used.
    ConfigError
        Where the configuration is not valid.
    RunError
        Where findings cannot be written, or the scheduler is gone.
    """
    if diagnoses < 0:
        raise UsageError(f"--diagnoses {diagnoses}: should be 0 or more")
    began = time.monotonic()
    resolved = load(model).resolved if is_file(model) else None
    declared = Declared(model, resolved, tuple(allow_code))
    not_read: dict[str, str] = {}
    sources = logs_of(patterns, not_read)
    kept = open_store(store, create=True)
    run = FleetRun(store, logs=len(sources))
    run.refused += [Refusal(folder, why, lasting=False) for folder, why in not_read.items()]
    tell = _forward_only(progress)
    with kept.locked(), engine(scheduler, workers) as client:
        fleet = _Fleet(client, kept, declared, diagnoses, run, tell)
        try:
            fleet.look_at(fleet.chosen(sources))
        except (CancelledError, FutureCancelledError, OSError) as error:
            raise RunError(
                f"{scheduler or 'the local cluster'}: the scheduler is gone ({error}); what was "
                f"done is kept in {store}, and the same command does the rest"
            ) from error
        run.refused.sort(key=lambda refusal: refusal.source)
        kept.keep_passing(run.refused)
    run.seconds = time.monotonic() - began
    return run


@dataclass
class _Fleet:
    client: Client
    store: Store
    declared: Declared
    diagnoses: int
    run: FleetRun
    tell: Progress

    def chosen(self, sources: Sequence[str]) -> list[LogHead]:
        """Read all footers, and return the logs that are to be looked at."""
        heads: list[LogHead] = []
        damaged: list[tuple[Refusal, str | None]] = []
        futures = self.client.map(
            look_at_head, sources, declared=self.declared, pure=False, retries=RETRIES
        )
        order = {future.key: source for future, source in zip(futures, sources, strict=True)}
        for done, future in enumerate(as_completed(futures), 1):
            result = _result(future, order[future.key])
            if isinstance(result, LogHead):
                heads.append(result)
            else:
                damaged.append((result, None) if isinstance(result, Refusal) else result)
            self.tell("reading footers", HEADS * done / len(sources))
        for refusal, identity in damaged:
            self._refuse(refusal, identity, None)
        self.store.forget_refusals({whole_text(head.source): head.log_id for head in heads})
        heads.sort(key=lambda head: (head.begin_utc, head.source))
        logs: dict[str, LogHead] = {}
        places: dict[str, set[str]] = defaultdict(set)
        for head in heads:
            if head.copied:
                self.run.copies += 1
                continue
            places[self._key(head)].add(whole_text(head.source))
            if logs.setdefault(self._key(head), head) is not head:
                self.run.twins += 1
        conflicts = {each.source: each for each in conflicts_of(list(logs.values()))}
        told = self.store.refusals({self._refused_key(head) for head in logs.values()})
        kept_at = self.store.sources()
        wanted: list[LogHead] = []
        for key, head in logs.items():
            refused_key = self._refused_key(head)
            if head.source in conflicts:
                self.run.refused.append(conflicts[head.source])
            elif refused_key in told:
                self.run.refused.append(Refusal(head.source, told[refused_key]))
            elif key in self.store:
                self.run.known += 1
                if kept_at.get(key) not in places[key]:
                    self.store.moved(key, head.source)
            else:
                wanted.append(head)
        return wanted

    def look_at(self, heads: Sequence[LogHead]) -> None:
        """Look at logs, and keep what is found of each once it is whole."""
        total = sum(head.rows for head in heads)
        threads = max(1, sum(self.client.nthreads().values()))
        waiting = iter(heads)
        jobs: dict[Any, _Job] = {}
        done = 0.0
        running = as_completed()

        def begin(count: int) -> None:
            for head in _some(waiting, count):
                job = _Job(head, steps_of(head, self.declared, self.diagnoses))
                advance(job)

        def advance(job: _Job) -> None:
            """Give the workers the next step of a log, or keep what the last one gave."""
            try:
                tasks = job.steps.send(job.results())
            except StopIteration as end:
                self._keep(job.head, end.value)
                begin(1)
                return
            futures = [
                self.client.submit(task.call, *task.arguments, pure=False, retries=RETRIES)
                for task in tasks
            ]
            job.begin(futures, [task.share for task in tasks])
            for future in futures:
                jobs[future.key] = job
            running.update(futures)

        begin(IN_FLIGHT * threads)
        for future in running:
            job = jobs.pop(future.key)
            done += job.take(future) * job.head.rows / total
            self.tell(f"looking at {len(heads)} logs", HEADS + (1.0 - HEADS) * done)
            if job.whole:
                advance(job)
        self.tell("done", 1.0)

    def _key(self, head: LogHead) -> str:
        return key_of(head.log_id, head.model_id, self.diagnoses)

    def _refused_key(self, head: LogHead) -> str:
        """Return the key of why a log cannot be used, which limits may say that are not fitted."""
        return key_of(head.log_id, f"{head.model_id} {head.limits_id}", self.diagnoses)

    def _keep(self, head: LogHead, found: list[Row] | Refusal) -> None:
        if isinstance(found, Refusal):
            self._refuse(found, head.log_id, head)
            return
        key = self._key(head)
        table = table_of_log(head, key, found)
        self.store.write(key, head.begin_utc, table)
        self.run.looked_at += 1
        self.run.hours += head.rows / head.rate_hz / 3600.0 if head.rate_hz else 0.0
        self.run.findings += table.num_rows

    def _refuse(self, refusal: Refusal, identity: str | None, head: LogHead | None) -> None:
        self.run.refused.append(refusal)
        if identity is None or not refusal.lasting:
            return
        key = self._refused_key(head) if head else key_of(identity, "", self.diagnoses)
        if key not in self.store:
            table = table_of_refusal(refusal, key, identity, head)
            self.store.write(key, head.begin_utc if head else None, table)


@dataclass
class _Job:
    head: LogHead
    steps: Steps
    _keys: list[Any] = field(default_factory=list)
    _shares: dict[Any, float] = field(default_factory=dict)
    _taken: dict[Any, Any] = field(default_factory=dict)

    def begin(self, futures: Sequence[Future[Any]], shares: Sequence[float]) -> None:
        self._keys = [future.key for future in futures]
        self._shares = dict(zip(self._keys, shares, strict=True))
        self._taken = {}

    def take(self, future: Future[Any]) -> float:
        """Keep what a worker gave, let the worker forget it, and return its share of the log."""
        self._taken[future.key] = _result(future, self.head.source)
        future.release()
        return self._shares[future.key]

    @property
    def whole(self) -> bool:
        """Whether all results of a step are there."""
        return len(self._taken) == len(self._keys)

    def results(self) -> Any:
        """Return them in the tasks' order; None before the first step."""
        return [self._taken[key] for key in self._keys] if self._keys else None


def _result(future: Future[Any], source: str) -> Any:
    """Return what a worker gave; a Refusal, for this time, where it failed or was ended."""
    error = future.exception()
    if error is None:
        return future.result()
    what = str(error).splitlines()[0] if str(error) else ""
    return Refusal(source, f"{source}: a worker failed: {type(error).__name__}: {what}", False)


def _some(waiting: Iterator[LogHead], count: int) -> Iterable[LogHead]:
    for _ in range(count):
        with suppress(StopIteration):
            yield next(waiting)


def _forward_only(progress: Progress | None) -> Progress:
    furthest = 0.0

    def tell(what: str, share: float) -> None:
        nonlocal furthest
        furthest = max(furthest, min(share, 1.0))
        if progress is not None:
            progress(what, furthest)

    return tell
