"""What a run keeps in its folder, and what of an earlier run goes before a new one begins."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from motorctl.close_loop.rigs import in_virtual_time
from motorctl.errors import DataError, UsageError

CONFIG = "config.yaml"
PAGE = "report.html"
PICTURE = "tracking_error_{axis}_{motion}.png"
START = "round_0"
MATCHED = "matched_velocity"
REFINED = "refined.yaml"

FOLDERS = ("round_[0-9]*", MATCHED)
FILES = (REFINED, PAGE, PICTURE.format(axis="*", motion="*"))


def refuse_recordings_of_a_machine(out: Path) -> None:
    """Raise UsageError where a folder holds recordings of a machine, which a new run would remove.

    What was simulated can be had again: it is replaced.
    """
    for log in _logs(out):
        instead = f"--resume goes on with what {out} holds, --force replaces it"
        try:
            if in_virtual_time(log):
                continue
        except DataError as error:
            raise UsageError(
                f"{error}; it may be an earlier run's recording of a machine: {instead}"
            ) from error
        raise UsageError(f"{log}: an earlier run recorded it on a machine; {instead}")


def prepared(out: Path, config: Path, resume: bool) -> Path:
    """Return the folder of the start; unless it resumes, an earlier run's files are removed.

    Raises UsageError where the configuration to begin with is one of them.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not resume:
            _remove_earlier_run(out, config.resolve())
        folder = out / START
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror}") from error
    return folder


def _remove_earlier_run(out: Path, config: Path) -> None:
    """Remove it where there was one: nobody else's folder is touched for its name."""
    if not any(_logs(out)) and not any((folder / CONFIG).is_file() for folder in _folders(out)):
        return
    files = [file for pattern in FILES for file in out.glob(pattern) if file.is_file()]
    if config in [file.resolve() for file in files] or any(
        config.is_relative_to(folder.resolve()) for folder in _folders(out)
    ):
        raise UsageError(
            f"{config}: an earlier run's, and would be removed with it: choose another --out, "
            "or copy the file to another folder and name the copy"
        )
    for folder in _folders(out):
        shutil.rmtree(folder)
    for file in files:
        file.unlink()


def _folders(out: Path) -> list[Path]:
    return sorted(f for pattern in FOLDERS for f in out.glob(pattern) if f.is_dir())


def _logs(out: Path) -> Iterator[Path]:
    return (log for folder in _folders(out) for log in sorted(folder.rglob("*.parquet")))
