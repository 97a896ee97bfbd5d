"""Run a machine in virtual time, and open the log of it."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from motorctl.api.log import Log, open_log


def simulate(
    config: str | os.PathLike[str],
    log: str | os.PathLike[str] | None = None,
    *,
    controller: Literal["C1", "C2"] | None = None,
    duration_s: float | None = None,
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Log:
    """Start every axis in virtual time, follow its program, log every tick.

    Two runs with the same configuration and seed give the same rows, bit for bit. The first run of
    a configuration compiles its kernels, which takes some tens of seconds.

    Parameters
    ----------
    config
        A YAML file, or a shipped configuration's name.
    log
        The log to write, a .parquet file; None: one that is gone with the `Log` that is returned.
    controller
        C1 or C2, in place of what the axes say.
    duration_s
        How long [s]; None: until the programs end.
    seed
        In place of the drivers' own seeds.
    progress
        Told the share that is done, 0 to 1.

    Returns
    -------
    Log
        What was recorded; `metadata["virtual_time"]` tells how long it took.

    Raises
    ------
    ConfigError
        Where the configuration is not valid.
    UsageError
        Where the log's name, the duration, the seed or a driver does not allow it.
    RunError
        Where an axis trips; the log then ends there and is complete.
    """
    from motorctl.config import load
    from motorctl.loop.simulation import simulate as simulated
    from motorctl.loop.simulation import with_seed

    machine = load(os.fspath(config), controller)
    if seed is not None:
        machine = with_seed(machine, seed)
    if log is not None:
        simulated(machine, Path(log), duration_s=duration_s, progress=progress)
        return open_log(log)
    folder = Path(tempfile.mkdtemp(prefix="motorctl-"))
    try:
        target = folder / f"{machine.name}.parquet"
        simulated(machine, target, duration_s=duration_s, progress=progress)
        recorded = open_log(target)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    weakref.finalize(recorded, shutil.rmtree, folder, ignore_errors=True)
    return recorded
