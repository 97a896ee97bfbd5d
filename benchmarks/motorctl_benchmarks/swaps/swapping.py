"""Other models and back, many times while the axes hold; the logs then tell what it did."""

from __future__ import annotations

import random
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from motorctl.latency.progress import Progress
from motorctl.log.sample import SampleFlag
from motorctl_benchmarks.running_daemon import running_daemon
from motorctl_benchmarks.swaps.gantry import AXIS, BESIDE, OTHERS, OWN, Models, apply, hold

COLUMNS = ("command_v", "position_m", "velocity_m_s", "fault", "flags")
PLACES_M, SPEED_M_S = (0.05, 0.35), 0.3
"""Before each change the axis moves somewhere within these: what cogging and friction ask for while
it holds is another there."""
SETTLES_S = 1.5
"""From the order to move on, the motion with it [s]."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Swap:
    """One change of models: from the last row of a log to the first of the next."""

    before: str
    after: str
    step_v: float
    """Of the axis' command."""
    counts_v: float
    """What the feedback makes of counts that come in one of the two rows."""
    holds_v: float
    """The command before."""
    beside_v: float
    """Step of the other axis', whose model stays."""

    @property
    def bump_v(self) -> float:
        """The step that the change itself makes."""
        return abs(self.step_v - self.counts_v)


@dataclass(frozen=True)
class Swapping:
    """What all changes did."""

    swaps: tuple[Swap, ...]
    max_voltage_v: float
    faults: int
    rows: int
    lost: int
    """Ticks without a row, but for periods that the computer slept over and the next row tells as
    skipped."""
    twice: int
    """Rows whose tick another one has, or that stand before an earlier one."""
    unlike: tuple[str, ...]
    """Where a log's model is not the one that was asked for."""
    waited_s: Array
    """By change: from the question to the answer."""


def swap_models(
    models: Models, folder: Path, swaps: int, seed: int, progress: Progress
) -> Swapping:
    """Apply other models and revert in turn, while every axis holds.

    Parameters
    ----------
    models
        What is applied, one after the other; the daemon's own in between.
    folder
        Of the daemon's logs, state and socket.
    swaps
        So many changes.
    seed
        Of the places at which the axis holds.
    progress
        Called with the share done.
    """
    asked, waited = [OWN], []
    rng = random.Random(seed)
    with running_daemon(str(models.config), folder) as (_, client):
        hold(client)
        for k in range(swaps):
            client.ask(
                "move",
                axis=AXIS,
                position_m=rng.uniform(*PLACES_M),
                velocity_m_s=SPEED_M_S,
            )
            time.sleep(SETTLES_S)
            hold(client)
            name = OWN if k % 2 else list(OTHERS)[k // 2 % len(OTHERS)]
            began = time.monotonic()
            if name == OWN:
                client.ask("revert")
            else:
                apply(client, models.machines[name])
            waited.append(time.monotonic() - began)
            asked.append(name)
            progress((k + 1) / swaps)
    return _told(models, sorted(folder.glob("logs/*.parquet")), asked, np.array(waited))


def _told(models: Models, logs: Sequence[Path], asked: Sequence[str], waited: Array) -> Swapping:
    wanted = ["tick", *(f"{axis}.{name}" for axis in (AXIS, BESIDE) for name in COLUMNS)]
    tables = [pq.read_table(path, columns=wanted) for path in logs]
    said = [models.model(path) or "none, or one in part" for path in logs]
    unlike = [
        f"{path.name}: {own}, asked for: {wish}"
        for path, own, wish in zip(logs, said, asked, strict=False)
        if own != wish
    ]
    if len(logs) != len(asked):
        unlike.append(f"{len(logs)} logs, asked for {len(asked)} models")
    whole = pa.concat_tables(tables)
    ticks = whole["tick"].to_numpy()
    faults = sum(
        int(np.sum(np.diff(whole[f"{axis}.fault"].to_numpy(), prepend=0) > 0))
        for axis in (AXIS, BESIDE)
    )
    return Swapping(
        tuple(
            _swap(models, before, after, own, new)
            for (before, after), (own, new) in zip(pairwise(said), pairwise(tables), strict=True)
        ),
        models.machines[OWN].axes[AXIS].limits.max_voltage_v,
        faults,
        len(ticks),
        _missing(ticks, whole[f"{AXIS}.flags"].to_numpy()),
        int(np.sum(np.diff(ticks) <= 0)),
        tuple(unlike),
        waited,
    )


def _missing(ticks: NDArray[np.int64], flags: NDArray[np.uint32]) -> int:
    """Return how many ticks have no row, without those that the row after them tells as skipped."""
    gaps = np.diff(ticks) - 1
    told = flags[1:] & int(SampleFlag.SKIPPED) != 0
    return int(np.sum(gaps[(gaps > 0) & ~told]))


def _swap(models: Models, before: str, after: str, own: pa.Table, new: pa.Table) -> Swap:
    """Return what the last row of a log and the first of the next tell.

    A count is a speed for one tick: the last row may have it in its command, the first may get it.
    """

    def last_and_first(name: str) -> tuple[float, float]:
        return own[name][-1].as_py(), new[name][0].as_py()

    old_v, new_v = last_and_first(f"{AXIS}.command_v")
    old_m_s, new_m_s = last_and_first(f"{AXIS}.velocity_m_s")
    old_m, new_m = last_and_first(f"{AXIS}.position_m")
    beside_v = float(np.diff(last_and_first(f"{BESIDE}.command_v"))[0])
    gains, theirs = (models.gains(name) for name in (before, after))
    counts_v = gains.ks_v_s_m * old_m_s
    counts_v -= theirs.ks_v_s_m * (new_m_s + theirs.k1_1_s * (new_m - old_m))
    return Swap(before, after, new_v - old_v, counts_v, old_v, abs(beside_v))
