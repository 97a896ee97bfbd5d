"""What flight records are called, what they say of themselves, and how many are kept."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from motorctl.errors import DataError, UsageError
from motorctl.log.axis_names import insist_on_names
from motorctl.log.convert import load_metadata
from motorctl.log.folder import is_time
from motorctl.log.partial import SUFFIX

FOLDER = "faults"
"""Where flight records are kept, in the folder of the logs."""
METADATA = "flight_record"
"""The key of a log's metadata that makes it a flight record."""
MEGABYTE = 1e6
_STAMP = "%Y%m%dT%H%M%SZ"
_NAME = re.compile(r"\d{8}T\d{6}Z-.+\.parquet")


@dataclass(frozen=True)
class FlightRecord:
    """A flight record, as its own metadata tells of it."""

    path: Path
    rows: int
    size_bytes: int
    metadata: Mapping[str, Any]
    """All that stands in the log: configuration, versions, timing, and the record's own part."""

    @property
    def id(self) -> str:
        """Its name: when, which axis, what."""
        return self.path.stem

    @property
    def machine(self) -> str:
        """Name of the machine."""
        return str(self.metadata.get("machine", ""))

    @property
    def own(self) -> Mapping[str, Any]:
        """What the recorder says of the fault."""
        own: Mapping[str, Any] = self.metadata[METADATA]
        return own

    @property
    def faults(self) -> Mapping[str, Mapping[str, Any]]:
        """Cause, message and time of every axis that tripped, the one that tripped first before."""
        faults: Mapping[str, Mapping[str, Any]] = self.own["faults"]
        return faults

    @property
    def first_axis(self) -> str | None:
        """The axis that tripped first; None where the loop itself ended."""
        return next(iter(self.faults), None)

    @property
    def cause(self) -> str:
        """Why the first axis tripped, or how the loop ended."""
        return str(self.own["cause"])

    @property
    def message(self) -> str:
        """The cause in words, with value and limit."""
        return str(self.own["message"])

    @property
    def time_s(self) -> float:
        """When, on the log's own clock [s since the first tick]."""
        return float(self.own["time_s"])

    @property
    def written_utc(self) -> str:
        """When, on the computer's clock."""
        return str(self.own["written_utc"])

    def document(self) -> dict[str, Any]:
        """Return what a program wants to know of the record."""
        return {
            "id": self.id,
            "file": str(self.path),
            "machine": self.machine,
            "written_utc": self.written_utc,
            "axis": self.first_axis,
            "cause": self.cause,
            "message": self.message,
            "time_s": self.time_s,
            "faults": {axis: dict(fault) for axis, fault in self.faults.items()},
            "rows": self.rows,
            "rows_lost": self.metadata.get("rows_lost"),
            "size_bytes": self.size_bytes,
        }


@dataclass(frozen=True)
class Listing:
    """The records of a folder, newest first, and what looks like one and cannot be read."""

    folder: Path
    records: tuple[FlightRecord, ...]
    broken: tuple[str, ...]
    """One message for each."""


def free_record_path(folder: Path, when: datetime, axis: str | None, cause: str) -> Path:
    """Return a path for a new record that no file has.

    Parameters
    ----------
    folder
        Of the records.
    when
        The computer's clock, in UTC.
    axis
        That tripped first; None: no axis did.
    cause
        In one word, as `FaultCause` names it.

    Returns
    -------
    Path
        Time, axis and cause in its name, and a number where these are taken.
    """
    stem = "-".join([f"{when:{_STAMP}}", *([axis] if axis else []), cause])
    path, count = folder / f"{stem}.parquet", 1
    while path.exists() or path.with_name(path.name + SUFFIX).exists():
        count += 1
        path = folder / f"{stem}-{count}.parquet"
    return path


def later_than_all(folder: Path, when: datetime) -> datetime:
    """Return a time for the name of a new record that puts it after all there are.

    Parameters
    ----------
    folder
        Of the records.
    when
        The computer's clock, in UTC.

    Returns
    -------
    datetime
        `when`; a second after the newest record where the clock was set back: the new record would
        else be removed as the oldest.
    """
    newest = next(iter(_newest_first(folder)), None)
    if newest is None:
        return when
    last = datetime.strptime(newest.name[:16], _STAMP).replace(tzinfo=UTC)
    return when if when >= last else last + timedelta(seconds=1)


def list_records(folder: Path) -> Listing:
    """Read what the records of a folder say of themselves; their rows are not touched.

    Parameters
    ----------
    folder
        Of the records, or of the logs beside which it stands.

    Returns
    -------
    Listing
        The records, the newest first, and a sentence on each file that is none.

    Raises
    ------
    UsageError
        Where there is no such folder.
    """
    place = folder / FOLDER if (folder / FOLDER).is_dir() else folder
    if not place.is_dir():
        raise UsageError(f"{folder}: no such folder; name the one that `motorctl run` logs to")
    records, broken = [], []
    for path in _newest_first(place):
        try:
            records.append(load_record(path))
        except DataError as error:
            broken.append(str(error))
    broken += [
        f"{path}: was not finished; motorctl log recover {path}"
        for path in sorted(place.glob(f"*{SUFFIX}"))
    ]
    return Listing(place, tuple(records), tuple(broken))


def load_record(path: Path) -> FlightRecord:
    """Read what a record says of itself.

    Parameters
    ----------
    path
        The record's file.

    Returns
    -------
    FlightRecord
        Its number of rows, size and metadata; the rows themselves are not read.

    Raises
    ------
    DataError
        Where the file is no flight record, or its axes have names that cannot be shown.
    """
    try:
        with pq.ParquetFile(path) as log:
            metadata, rows = load_metadata(log.schema_arrow), log.metadata.num_rows
        size = path.stat().st_size
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read as a log: {error}") from error
    own = metadata.get(METADATA)
    needed = ("faults", "cause", "message", "time_s", "written_utc")
    if not isinstance(own, dict) or any(key not in own for key in needed):
        raise DataError(f"{path}: is a log, but no flight record; motorctl log info {path}")
    if unsound := _unsound(metadata):
        raise DataError(f"{path}: is damaged: {unsound} is not what a recorder writes")
    insist_on_names(str(path), metadata.get("axes", {}))
    return FlightRecord(path, rows, size, metadata)


def _unsound(metadata: Mapping[str, Any]) -> str | None:
    """Return what of a record's metadata is nothing that a recorder writes, or None."""
    own = metadata[METADATA]
    for key in ("cause", "message", "written_utc"):
        if not isinstance(own[key], str):
            return key
    time_s = own["time_s"]
    if not isinstance(time_s, int | float) or not math.isfinite(time_s):
        return "time_s"
    faults = own["faults"]
    told = faults.values() if isinstance(faults, dict) else [faults]
    if not all(isinstance(fault, dict) and {"cause", "message"} <= fault.keys() for fault in told):
        return "faults"
    maps = ("states", "flags")
    return next((key for key in maps if not isinstance(metadata.get(key), dict)), None)


def find_record(listing: Listing, wanted: str | None) -> FlightRecord:
    """Return the record that somebody means.

    Parameters
    ----------
    listing
        What there is.
    wanted
        An id, or a part of it that only one has; None: the newest.

    Returns
    -------
    FlightRecord
        What the record says of itself.

    Raises
    ------
    UsageError
        Where none fits, or more than one.
    """
    records = listing.records
    if not records:
        why = "no axis has tripped"
        if listing.broken:
            why = "none that can be read:\n" + "\n".join(listing.broken)
        raise UsageError(f"{listing.folder}: no flight records: {why}")
    if wanted is None:
        return records[0]
    fitting = [record for record in records if record.id == wanted]
    fitting = fitting or [record for record in records if wanted in record.id]
    if len(fitting) == 1:
        return fitting[0]
    what = "no flight record has" if not fitting else f"{len(fitting)} flight records have"
    raise UsageError(f"{wanted}: {what} this in the id; `motorctl fault list` shows them all")


def remove_oldest(folder: Path, keep: int, max_bytes: float) -> list[Path]:
    """Remove the oldest records until no more than allowed are left; the newest always stays.

    Only files that are called like a record are counted and removed.

    Parameters
    ----------
    folder
        Of the records.
    keep
        How many may stay.
    max_bytes
        How large those may be together.

    Returns
    -------
    list of Path
        What was removed.
    """
    removed: list[Path] = []
    total = 0
    for place, path in enumerate(_newest_first(folder)):
        total += _size(path)
        if place and (place >= keep or total > max_bytes):
            with suppress(OSError):
                path.unlink()
                removed.append(path)
    return removed


def _newest_first(folder: Path) -> Iterable[Path]:
    """Return the files called like a record: by the time in the name, then by when it changed."""
    found = [
        path
        for path in folder.glob("*.parquet")
        if _NAME.fullmatch(path.name) and is_time(path.name[:16])
    ]
    return sorted(found, key=lambda path: (path.name[:16], _changed(path)), reverse=True)


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
