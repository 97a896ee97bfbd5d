"""Which files are meant by the logs of a run, its folder, its name, or one of its logs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.errors import DataError
from motorctl.log.convert import load_metadata
from motorctl.log.folder import EXPORT_SUFFIX, LOG_SUFFIX
from motorctl.log.open_table import open_table
from motorctl.log.partial import SUFFIX, PartialFile
from motorctl.log.run_table import RunTable
from motorctl.log.table import Table

_MOST_RUNS_TOLD = 6


def open_recorded(paths: Sequence[str | os.PathLike[str]], whole_run: bool = False) -> Table:
    """Open one file, or the logs of one run as one table.

    Parameters
    ----------
    paths
        One file of any known kind; several logs of a run; a folder that holds the logs of one run;
        or the name of a run, which is that of its first log without the suffix.
    whole_run
        The one log that is named stands for all of its run that are in its folder.

    Returns
    -------
    Table
        A `RunTable` unless it is one file and meant alone.

    Raises
    ------
    DataError
        Where something is no log, where a folder has logs of several runs, or where the logs cannot
        be one recording.
    """
    files = [Path(path) for path in paths]
    if len(files) > 1:
        return RunTable(files)
    (file,) = files
    if file.is_dir():
        return _of_folder(file)
    if not file.exists() and file.parent.is_dir():
        runs = _runs_in(file.parent)
        if file.suffix == "" or file.name in runs:
            return _of_run(file.parent, file.name, runs)
    table = open_table(file)
    if not whole_run:
        return table
    run = table.metadata.get("run")
    if not isinstance(run, str):
        raise DataError(f"{file}: --whole-run: it does not say of which run of a daemon it is")
    return _of_run(file.parent, run, _runs_in(file.parent))


def is_run(paths: Sequence[str | os.PathLike[str]], whole_run: bool) -> bool:
    """Tell whether logs of a run are meant, and not one file."""
    return whole_run or len(paths) > 1 or not Path(paths[0]).is_file()


def _of_folder(folder: Path) -> RunTable:
    runs = _runs_in(folder)
    if not runs:
        raise DataError(f"{folder}: is a folder in which there are no logs of a daemon")
    if len(runs) > 1:
        told = [f"{folder / run} ({len(found)} logs)" for run, found in sorted(runs.items())]
        more = len(told) - _MOST_RUNS_TOLD
        listed = ", ".join(told[-_MOST_RUNS_TOLD:]) + (f" and {more} before" if more > 0 else "")
        raise DataError(f"{folder}: it has logs of {len(runs)} runs; name one: {listed}")
    return _of_run(folder, next(iter(runs)), runs)


def _of_run(folder: Path, run: str, runs: Mapping[str, list[Path]]) -> RunTable:
    found = runs.get(run, [])
    if not found:
        raise DataError(f"{folder / run}: no such file, and no log in {folder} is of a run '{run}'")
    return RunTable(found, _unfinished(folder, run))


def _runs_in(folder: Path) -> dict[str, list[Path]]:
    """Return the finished logs in a folder by the runs that they name."""
    runs: dict[str, list[Path]] = {}
    for path in sorted(folder.glob(f"*{LOG_SUFFIX}")):
        if path.name.endswith(EXPORT_SUFFIX):
            continue
        try:
            told = load_metadata(pq.read_schema(path))
        except (pa.ArrowException, OSError, ValueError):
            continue  # some other file; whoever names it is told what is wrong with it
        if isinstance(run := told.get("run"), str) and isinstance(told.get("part"), int):
            runs.setdefault(run, []).append(path)
    return runs


def _unfinished(folder: Path, run: str) -> list[str]:
    """Say which logs of a run are left out because they are not finished."""
    told = []
    for path in sorted(folder.glob(f"*{LOG_SUFFIX}{SUFFIX}")):
        if path.with_name(path.name.removesuffix(SUFFIX)).exists():
            continue
        try:
            partial = PartialFile(path)
        except (DataError, OSError):
            continue
        try:
            metadata = load_metadata(partial.schema)
        finally:
            partial.close()
        if metadata.get("run") == run:
            told.append(
                f"part {metadata.get('part')} is left out, as {path.name} is still recorded or was "
                "not finished: `motorctl log recover` finishes it"
            )
    return told
