"""Which log has which identity, as a store of findings tells: links name logs by it."""

from __future__ import annotations

from pathlib import Path

from motorctl.errors import UsageError
from motorctl.fleet.paths import FINDINGS
from motorctl.fleet.store import open_store


class LogIndex:
    """Logs of a store by their identities. Raises UsageError where the folder is none."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, str] = {}
        self._files = 0
        self._read()

    def find(self, log_id: str) -> Path:
        """Return where a log is. Raises UsageError where the store does not know it, or no file is.

        Findings that came after the last look are read then.
        """
        if log_id not in self._known and self._count() != self._files:
            self._read()
        source = self._known.get(log_id)
        if source is None:
            raise UsageError(f"{self._folder}: knows no such log: is the page of another store?")
        if "://" in source:
            raise UsageError(f"{source}: is on no disk here: fetch it, and open that")
        return Path(source)

    def _count(self) -> int:
        return sum(1 for _ in (self._folder / FINDINGS).glob("*/*.parquet"))

    def _read(self) -> None:
        self._files = self._count()
        table = open_store(self._folder).read(["log_id", "source", "written_utc"])
        rows = table.group_by(["log_id", "source"]).aggregate([("written_utc", "max")])
        newest = rows.sort_by("written_utc_max")
        told = (newest.column(name).to_pylist() for name in ("log_id", "source"))
        self._known = dict(zip(*told, strict=True))
