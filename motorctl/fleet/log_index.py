"""Which log has which identity, as a store of findings tells: links name logs by it."""

from __future__ import annotations

from collections import defaultdict
from contextlib import suppress
from pathlib import Path

from motorctl.errors import DataError, UsageError
from motorctl.fleet.head import identity_of
from motorctl.fleet.paths import FINDINGS
from motorctl.fleet.store import open_store


class LogIndex:
    """Logs of a store by their identities. Raises UsageError where the folder is none."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, list[str]] = {}
        self._read()

    def find(self, log_id: str) -> Path:
        """Return where a log is.

        Findings are read again where it is not known, or no more where it was. Raises UsageError
        where the store does not know it, or no file, or another one, is there now.
        """
        found = self._where(log_id)
        if found is None and self._state() != self._read_state:
            self._read()
            found = self._where(log_id)
        if found is not None:
            return found
        if log_id not in self._known:
            raise UsageError(f"{self._folder}: knows no such log: is the page of another store?")
        source = self._known[log_id][0]
        if "://" in source:
            raise UsageError(f"{source}: is on no disk here: fetch it, and open that")
        what = "another file is there now" if Path(source).is_file() else "no such file"
        raise UsageError(
            f"{source}: {what}: where the log was moved, the next `motorctl fleet diagnose` of its "
            "new place tells the store"
        )

    def _where(self, log_id: str) -> Path | None:
        """Return the newest place on a disk here at which that very log is."""
        for source in self._known.get(log_id, ()):
            if "://" not in source and Path(source).is_file():
                with suppress(DataError, OSError):
                    if identity_of(source) == log_id:
                        return Path(source)
        return None

    def _state(self) -> list[tuple[str, int]]:
        """Return what changes whenever findings do."""
        months = (self._folder / FINDINGS).glob("*/")
        return sorted((month.name, month.stat().st_mtime_ns) for month in months)

    def _read(self) -> None:
        self._read_state = self._state()
        table = open_store(self._folder).read(["log_id", "source", "written_utc"])
        rows = table.group_by(["log_id", "source"]).aggregate([("written_utc", "max")])
        newest = rows.sort_by([("written_utc_max", "descending")])
        self._known = defaultdict(list)
        columns = (newest.column(name).to_pylist() for name in ("log_id", "source"))
        for log_id, source in zip(*columns, strict=True):
            self._known[log_id].append(source)
