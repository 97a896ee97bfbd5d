"""Processes killed at random moments around a change of models; what the next start makes of it."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from motorctl.daemon.client import Client
from motorctl.daemon.model_history import ModelHistory
from motorctl.errors import MotorctlError, RunError
from motorctl.latency.progress import Progress
from motorctl.log.partial import SUFFIX
from motorctl_benchmarks.running_daemon import running_daemon
from motorctl_benchmarks.swaps.gantry import AXIS, OTHERS, OWN, Models, apply, hold

SUPERVISOR, LOOP = "supervisor", "loop"
ENDS_S, RECOVERS_S = 60.0, 120.0
"""So long the processes that are left may take to end, and the next start to make logs of what was
left. By hand: seconds, minutes on a busy computer."""
AROUND = (-0.1, 1.4)
"""From when to when a process is killed, in parts of what a change takes, from its question on."""
WIDEST_GAP_S = 0.5
"""So long a computer may pause; a gap in the ticks that is wider is told as lost rows. By hand."""


@dataclass(frozen=True)
class Kill:
    """One of them."""

    process: str
    applied: str
    """The model that was asked for."""
    at_s: float
    """From the question on."""
    answered: bool
    """The answer had come before."""
    logs: tuple[str, ...]
    """The model of each of the run's logs, once they are recovered."""
    wrong: tuple[str, ...] = ()

    @property
    def new(self) -> bool:
        """Whether the last log has the new model."""
        return self.logs[-1:] == (self.applied,)


def kill_around_changes(
    models: Models, folder: Path, kills: int, seed: int, progress: Progress
) -> list[Kill]:
    """Kill the supervisor or the loop's process, start again, and look; so many times.

    Parameters
    ----------
    models
        What is applied.
    folder
        Of the daemon's logs, state and socket: one for all runs.
    kills
        So many.
    seed
        Of the moments, processes and models.
    progress
        Called with the share done.
    """
    rng = random.Random(seed)
    done: list[Kill] = []
    lasts_s = dict.fromkeys(OTHERS, 0.0)
    known: set[Path] = set()
    pending: Kill | None = None
    for k in range(kills + 1):
        with running_daemon(str(models.config), folder) as (process, client):
            if pending is not None:
                done.append(_looked_at(models, folder, client, pending, known))
                progress(k / kills)
            if k == kills:
                break
            hold(client)
            name = rng.choice(list(OTHERS))
            if not lasts_s[name]:
                began = time.monotonic()
                apply(client, models.machines[name])
                lasts_s[name] = time.monotonic() - began
                client.ask("revert")
            at_s = lasts_s[name] * rng.uniform(*AROUND)
            pending = _killed(models, process, client, name, at_s, rng.choice((SUPERVISOR, LOOP)))
    return done


def _killed(
    models: Models,
    process: subprocess.Popen[bytes],
    client: Client,
    name: str,
    at_s: float,
    which: str,
) -> Kill:
    loop = int(client.ask("status")["loop"]["pid"])
    answers: list[Mapping[str, Any]] = []

    def ask() -> None:
        time.sleep(max(-at_s, 0.0))
        with suppress(MotorctlError), Client(client.path) as own:
            answers.append(apply(own, models.machines[name]))

    asking = threading.Thread(target=ask, daemon=True)
    asking.start()
    time.sleep(max(at_s, 0.0))
    answered = bool(answers)
    os.kill(process.pid if which == SUPERVISOR else loop, signal.SIGKILL)
    process.wait(ENDS_S)
    deadline = time.monotonic() + ENDS_S
    while _lives(loop):
        if time.monotonic() > deadline:
            raise RunError(f"the loop's process lives {ENDS_S:g} s after its supervisor's end")
        time.sleep(0.01)
    asking.join(ENDS_S)
    return Kill(which, name, at_s, answered, ())


def _looked_at(models: Models, folder: Path, client: Client, kill: Kill, known: set[Path]) -> Kill:
    """Return what the start after a kill made of it; its logs are known then."""
    wrong = []
    deadline = time.monotonic() + RECOVERS_S
    current = Path(client.ask("status")["recording"]["file"])
    while left := [p for p in (folder / "logs").glob(f"*{SUFFIX}") if p.stem != current.name]:
        if time.monotonic() > deadline:
            wrong.append(f"not recovered: {', '.join(path.name for path in left)}")
            break
        time.sleep(0.1)
    logs = sorted(set((folder / "logs").glob("*.parquet")) - known)
    known.update(logs)
    told = [models.model(path) for path in logs]
    expected = [OWN, kill.applied]
    # of a model for the first time, it was applied and taken back before
    runs = told[-2:] if kill.applied in told[-1:] else told[-1:]
    if runs not in ([OWN], expected):
        wrong.append(f"models of the last logs: {told}")
    if kill.answered and kill.applied not in runs:
        wrong.append("answered, but no log has the new model")
    wrong += _rows(logs, 1.0 / models.machines[OWN].period_s)
    history = [c.what for c in ModelHistory(
        models.machines[OWN].name, folder / "state" / "motorctl" / "models"
    ).read()]  # fmt: skip
    if kill.answered and history[-1:] != ["applied"]:
        wrong.append(f"answered, but the history ends with {history[-1:]}")
    now = client.ask("models", axis=AXIS)["runs"]
    if now != str(models.config):
        wrong.append(f"after the start the model of {now} runs")
    if "the last run" not in (folder / "stderr.txt").read_text(encoding="utf-8"):
        wrong.append("the start does not tell how the last run ended")
    return Kill(
        kill.process,
        kill.applied,
        kill.at_s,
        kill.answered,
        tuple(name or "none, or one in part" for name in told),
        tuple(wrong),
    )


def _rows(logs: Sequence[Path], rate_hz: float) -> list[str]:
    """Say where rows of one run, log after log, are missing or come twice."""
    ticks = [pq.read_table(path, columns=["tick"])["tick"].to_numpy() for path in logs]
    said = []
    logs = [path for path, own in zip(logs, ticks, strict=True) if len(own)]
    ticks = [own for own in ticks if len(own)]  # one may have been begun, and have no row yet
    for path, own in zip(logs, ticks, strict=True):
        if np.any(np.diff(own) <= 0) or np.any(np.diff(own) > WIDEST_GAP_S * rate_hz):
            said.append(f"{path.name}: its ticks are not in order, or with a gap")
    for (before, after), path in zip(pairwise(ticks), logs[1:], strict=True):
        if not 0 < after[0] - before[-1] <= WIDEST_GAP_S * rate_hz:
            said.append(
                f"{path.name}: begins at tick {after[0]}, the log before ends at {before[-1]}"
            )
    return said


def _lives(pid: int) -> bool:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except OSError:
        return False
    return stat.rsplit(")", 1)[1].split()[0] != "Z"
