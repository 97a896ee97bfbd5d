"""A daemon with the simulated gantry in motion: left alone, and with what may disturb its loop.

That is a crowd on its socket, a scope with viewers, the making of logs, and busy programs. They are
taken in turn, so that whatever else this computer does meets all of them. Last comes one more
crowd, into which emergency stops are called.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import yaml
from numpy.typing import NDArray

from motorctl.config import shipped_config
from motorctl.daemon.client import Client
from motorctl.errors import MotorctlError, RunError, UsageError
from motorctl.latency.advice import kernel_workers_run_on
from motorctl.latency.progress import Progress
from motorctl.log import background
from motorctl.log.folder import stored_logs
from motorctl.log.partial import SUFFIX
from motorctl_benchmarks.control_socket.crowd import Crowd, Told
from motorctl_benchmarks.control_socket.viewers import Watched, watching
from motorctl_benchmarks.running_daemon import END_S, running_daemon

CONFIG = "published_gantry"
SETTLE_S = 1.0
"""Between two spells."""
BETWEEN_STOPS_S = 0.05
BUSY_PROGRAMS = 2
QUIET, CROWD, BUSY = "left alone", "under the crowd", "beside busy programs"
CONVERTING, WATCHED = "while logs are made", "watched by the scope"
KINDS = (QUIET, CROWD, WATCHED, CONVERTING, BUSY)
CROWD_MAIN = "from motorctl_benchmarks.control_socket.crowd import main; main()"
SPIN = "while True: pass"


@dataclass(frozen=True)
class SocketOptions:
    """What is asked for."""

    clients: int = 200
    fuzzed_bytes: int = 10_000_000
    """By all crowds together."""
    spell_s: float = 8.0
    rounds: int = 8
    seed: int = 1
    config: str = CONFIG
    loop_cpu: int | None = None
    """The loop's CPU, off which all else is kept; None: it is pinned to one that others use too."""


@dataclass(frozen=True)
class Spell:
    """The ticks of one spell."""

    kind: str
    lateness_s: NDArray[np.float64]
    """Of each tick, shape (N,)."""

    def share_later_than(self, limit_s: float) -> float:
        """Return the share of ticks that began later than this."""
        return float(np.mean(self.lateness_s > limit_s))


@dataclass(frozen=True)
class Session:
    """What a run showed."""

    spells: tuple[Spell, ...]
    told: Told
    period_s: float
    rows_lost: int
    troubles: tuple[str, ...]
    """What should not have been, a sentence each."""
    stops_s: tuple[float, ...] = ()
    """From connecting to the answer of each emergency stop that was called into a crowd."""
    logs_made: int = 0
    """How often a log was made of what was recorded so far."""
    watched: Watched = field(default_factory=Watched)
    """What the scope's viewers were told, of all spells."""
    beside_kernel_workers: bool = False
    """Whether the kernel's unbound workers may run on a CPU of the loop."""


def run_session(options: SocketOptions, progress: Progress) -> Session:
    """Run a daemon through all spells.

    Raises
    ------
    RunError
        Where the daemon does not start.
    UsageError
        Where there is no such CPU for the loop, or no other one.
    """
    if options.loop_cpu is None:
        return _run(options, progress)
    with _all_else_off(options.loop_cpu):
        return _run(options, progress)


def _run(options: SocketOptions, progress: Progress) -> Session:
    marks: list[tuple[str, int, int]] = []
    told, watched, troubles, logs_made = Told(), Watched(), [], 0
    with tempfile.TemporaryDirectory(prefix="motorctl-") as name:
        folder = Path(name)
        folder.chmod(0o711)  # made-up users have to reach the socket
        with running_daemon(_config(options, folder), folder) as (process, client):
            before = client.ask("status")
            workers = any(map(kernel_workers_run_on, os.sched_getaffinity(before["loop"]["pid"])))
            for axis in before["axes"]:
                client.ask_when_ready("start", lambda _: None, axis=axis)
            for number in range(len(KINDS) * options.rounds):
                kind = KINDS[number % len(KINDS)]
                _keep_moving(client)
                recorded = _copy_of_recording(folder) if kind == CONVERTING else None
                with _viewers(kind, folder, watched):
                    time.sleep(SETTLE_S)
                    first = _ticks(client)
                    if kind == CROWD:
                        told.add(_crowd(options, folder, number), at_once=False)
                    elif recorded is not None:
                        logs_made += _make_logs(options.spell_s, recorded, before["loop"]["pid"])
                    else:
                        _wait(options.spell_s, busy=kind == BUSY)
                    marks.append((kind, first, _ticks(client)))
                troubles += _troubles(client, before, kind)
                progress((number + 1) / (len(KINDS) * options.rounds + 1))
            _keep_moving(client)
            stops_s, unanswered = _stops(options, folder)
            troubles += unanswered
            progress(1.0)
            status = client.ask("status")
            client.close()
            process.terminate()
            if process.wait(END_S) != 0:
                troubles.append(f"the daemon ended with status {process.returncode}")
        said = (folder / "stderr.txt").read_text()
        if "Traceback" in said:
            troubles.append("the daemon told of a mistake of its own: " + said.splitlines()[-1])
        spells = tuple(_spells(folder / "logs", before["machine"], marks))
    if told.fuzzed_bytes < options.fuzzed_bytes:
        asked = f"{told.fuzzed_bytes} of {options.fuzzed_bytes}"
        troubles.append(f"{asked} fuzzed bytes were taken in time")
    if told.mistakes:
        troubles.append(f"{told.mistakes} answers told of a mistake of the daemon's own")
    troubles += [f"the scope: {said}" for said in watched.failed[:1]]
    lost = status["recording"]["rows_lost"]
    period_s = 1.0 / before["loop"]["rate_hz"]
    wrong = tuple(dict.fromkeys(troubles))
    return Session(spells, told, period_s, lost, wrong, stops_s, logs_made, watched, workers)


@contextmanager
def _all_else_off(cpu: int) -> Iterator[None]:
    """Keep this process and all that it starts off a CPU, as the kernel's isolcpus does."""
    usual = os.sched_getaffinity(0)
    if cpu not in usual or usual == {cpu}:
        cpus = ", ".join(map(str, sorted(usual)))
        raise UsageError(f"--loop-cpu {cpu}: it must be one of two or more; here are {cpus}")
    _run_on(usual - {cpu})
    try:
        yield
    finally:
        _run_on(usual)


def _run_on(cpus: set[int]) -> None:
    """Have every thread of this process run on these CPUs."""
    for thread in Path("/proc/self/task").iterdir():
        with suppress(ProcessLookupError):  # it may have ended meanwhile
            os.sched_setaffinity(int(thread.name), cpus)


def _config(options: SocketOptions, folder: Path) -> str:
    """Return the configuration to run: with a CPU for the loop, a copy that names it."""
    if options.loop_cpu is None:
        return options.config
    document = yaml.safe_load(shipped_config(options.config).read_text(encoding="utf-8"))
    document["loop"]["cpu"] = options.loop_cpu
    own = folder / f"{options.config}.yaml"
    own.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    return str(own)


def _keep_moving(client: Client) -> None:
    """Begin the axes' programs anew where they have come to their ends."""
    for name, axis in client.ask("status")["axes"].items():
        if axis["state"] == "idle":
            client.ask("stop", axis=name)
            client.ask_when_ready("start", lambda _: None, axis=name)


def _viewers(kind: str, folder: Path, watched: Watched) -> AbstractContextManager[None]:
    """Return a scope with its viewers where the spell is theirs."""
    socket = folder / "motorctl.sock"
    return watching(socket, folder / "captures", watched) if kind == WATCHED else nullcontext()


def _ticks(client: Client) -> int:
    ticks: int = client.ask("status")["loop"]["ticks"]
    return ticks


def _crowd(options: SocketOptions, folder: Path, number: int) -> Told:
    crowd = Crowd(
        str(folder / "motorctl.sock"),
        options.clients,
        -(-options.fuzzed_bytes // options.rounds),
        options.spell_s,
        options.seed + number,
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", CROWD_MAIN],
        input=json.dumps(asdict(crowd)),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RunError(f"the crowd failed: {done.stderr.strip().splitlines()[-1:]}")
    return Told(**json.loads(done.stdout))


def _stops(options: SocketOptions, folder: Path) -> tuple[tuple[float, ...], list[str]]:
    """Call emergency stops into a crowd, each over a connection of its own.

    Returns
    -------
    tuple of float
        What each took from connecting to its answer [s].
    list of str
        What went wrong.
    """
    socket, stops_s, wrong = folder / "motorctl.sock", [], []
    with ThreadPoolExecutor(1) as beside:
        end = time.monotonic() + options.spell_s
        crowd = beside.submit(_crowd, options, folder, -1)
        time.sleep(SETTLE_S)
        # Not in the tail, when some still have bytes to send and the others are gone.
        while not crowd.done() and time.monotonic() < end:
            began = time.monotonic()
            try:
                with Client(socket) as client:
                    client.ask("estop")
            except MotorctlError as error:
                wrong.append(f"an emergency stop under the crowd: {error}")
            stops_s.append(time.monotonic() - began)
            time.sleep(BETWEEN_STOPS_S)
        crowd.result()
    return tuple(stops_s), wrong


def _wait(seconds: float, *, busy: bool) -> None:
    count = BUSY_PROGRAMS if busy else 0
    programs = [subprocess.Popen([sys.executable, "-c", SPIN]) for _ in range(count)]
    try:
        time.sleep(seconds)
    finally:
        for program in programs:
            program.kill()
            program.wait()


def _copy_of_recording(folder: Path) -> Path:
    """Return a copy of what is recorded so far: to copy it is no part of making a log."""
    files = (folder / "logs").glob(f"*{SUFFIX}")
    recorded = max(files, key=lambda path: path.stat().st_mtime)
    copy = folder / "recorded" / recorded.name
    copy.parent.mkdir(exist_ok=True)
    shutil.copy(recorded, copy)
    return copy


def _make_logs(seconds: float, recorded: Path, loop: int) -> int:
    """Make logs of a recording, one after the other as the daemon does, and return how many.

    Parameters
    ----------
    seconds
        How long [s].
    recorded
        The partial file.
    loop
        The loop's process: its CPUs are kept off.

    Raises
    ------
    RunError
        Where a log cannot be made.
    """
    loop_cpus = os.sched_getaffinity(loop)
    end, made = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory(dir=recorded.parent) as scratch:
            once = Path(scratch) / recorded.name
            once.hardlink_to(recorded)  # whoever makes the log takes the name away
            run = background.command(once, loop_cpus)
            done = subprocess.run(run, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RunError(f"no log can be made: {done.stderr.strip().splitlines()[-1:]}")
        made += 1
    return made


def _troubles(client: Client, before: dict[str, Any], kind: str) -> list[str]:
    status = client.ask("status")
    found = [
        f"{kind}: axis {name} is {axis['state']}: {axis['fault']}"
        for name, axis in status["axes"].items()
        if axis["state"] not in ("running", "idle")
    ]
    if status["loop"]["pid"] != before["loop"]["pid"]:
        found.append(f"{kind}: the loop is another process")
    return found


def _spells(logs: Path, machine: str, marks: list[tuple[str, int, int]]) -> Iterator[Spell]:
    tables = [
        pq.read_table(stored.path, columns=["tick", "lateness_s"])
        for stored in stored_logs(logs, machine)
    ]
    ticks = np.concatenate([table["tick"].to_numpy() for table in tables])
    lateness_s = np.concatenate([table["lateness_s"].to_numpy() for table in tables])
    for kind, first, last in marks:
        rows = slice(*np.searchsorted(ticks, (first, last)))
        yield Spell(kind, lateness_s[rows])
