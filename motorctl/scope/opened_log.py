"""A log of the scope, which may still grow."""

from __future__ import annotations

from pathlib import Path

from motorctl.api.log import Log, open_log
from motorctl.errors import DataError, MotorctlError
from motorctl.log.partial import SUFFIX
from motorctl.scope.shown import Shown


class OpenedLog(Shown):
    """A log that the page looks at. Raises MotorctlError where it cannot be opened."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.name = path.name
        self._open()

    def _open(self) -> None:
        mark = _mark(self.path)
        log: Log = open_log(self.path)
        if not log.axes or "time_s" not in log:
            raise DataError(f"{self.path}: has no column '<axis>.position_m'")
        if not log.rows:
            raise DataError(f"{self.path}: there is no row in it")
        self._take(log)
        self._mark = mark

    @property
    def unfinished(self) -> bool:
        """Whether it is still recorded, or was not finished."""
        return any(note.startswith("not finished") for note in self.log.notes)

    def refresh(self) -> None:
        """Open a log anew that has grown, or was finished, since it was opened."""
        if not self.unfinished or _mark(self.path) == self._mark:
            return
        before = self.log
        try:
            self._open()
        except MotorctlError:  # while it is being made a log: as it was until then
            self._take(before)


def _mark(path: Path) -> tuple[float, int] | None:
    """Return what changes as the file behind a log grows or is finished."""
    for place in (path, path.with_name(path.name + SUFFIX)):
        try:
            found = place.stat()
        except OSError:
            continue
        return found.st_mtime, found.st_size
    return None
