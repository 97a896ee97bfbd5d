"""Fetch public recordings of real machines, for tests that compare the diagnosis with them.

    python tools/fetch_recordings.py FOLDER
    MOTORCTL_RECORDINGS=FOLDER pytest -m slow tests/identify/diagnose -k real_machine

The recordings belong to their authors and stay out of this repository.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from motorctl_benchmarks.real_machines.repositories import (
    COMMITS,
    REPOSITORIES,
    folder_of,
)


def main() -> int:
    """Clone what is not there yet."""
    if len(sys.argv) != 2:
        print(f"usage: python {sys.argv[0]} FOLDER", file=sys.stderr)
        return 2
    failed = 0
    for repository in REPOSITORIES:
        place = folder_of(Path(sys.argv[1]), repository)
        if place.exists():
            print(f"{repository}: there already")
            continue
        address = f"https://github.com/{repository}.git"
        failed += not _fetched(address, place, COMMITS.get(repository, "HEAD"))
    return int(failed > 0)


def _fetched(address: str, place: Path, commit: str) -> bool:
    """Fetch one commit without the history before it; return whether that was possible."""
    place.mkdir(parents=True)
    for command in (
        ["init", "--quiet"],
        ["fetch", "--depth", "1", address, commit],
        ["checkout", "--quiet", "FETCH_HEAD"],
    ):
        if subprocess.run(["git", *command], cwd=place, check=False).returncode != 0:
            shutil.rmtree(place)  # so that the next run tries again
            return False
    return True


if __name__ == "__main__":
    sys.exit(main())
