"""The store of findings: one Parquet file a log, written once, whole or not at all."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from motorctl.errors import DataError, RunError, UsageError
from motorctl.fleet.findings import SCHEMA, SCHEMA_VERSION, Refusal, whole_text
from motorctl.fleet.paths import FINDINGS, MARK
from motorctl.log.synced import sync
from motorctl.version import VERSION

_DRAFT = ".draft-"
_UNDATED = "undated"
_FORMAT = ds.ParquetFileFormat(
    default_fragment_scan_options=ds.ParquetFragmentScanOptions(page_checksum_verification=True)
)
LAST_RUN = "last_run.json"
"""The file of a store that tells which logs could not be used the last time, though that does not
lie in them alone."""


def key_of(log_id: str, model_id: str, diagnoses: int) -> str:
    """Return the key of a log's findings: same log, same model, same version, same question."""
    text = "\n".join([log_id, model_id, VERSION, str(SCHEMA_VERSION), str(diagnoses)])
    return hashlib.sha256(text.encode()).hexdigest()[:32]


class Store:
    """A folder of findings; `open_store` opens it.

    A file appears under its name complete or not at all, and its name follows from what was looked
    at: whatever kills a run, the next one finds what is done and nothing twice.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._known = {path.stem for path in (folder / FINDINGS).glob("*/*.parquet")}

    def __contains__(self, key: str) -> bool:
        return key in self._known

    def write(self, key: str, began: datetime | None, table: pa.Table) -> None:
        """Keep the findings of a log. Raises RunError where they cannot be written."""
        month = self.folder / FINDINGS / (f"{began:%Y-%m}" if began else _UNDATED)
        self._write(month / f"{key}.parquet", table)
        self._known.add(key)

    def _write(self, target: Path, table: pa.Table) -> None:
        month = target.parent
        draft = month / f"{_DRAFT}{target.stem}"
        try:
            month.mkdir(parents=True, exist_ok=True)
            pq.write_table(table, draft, compression="zstd", write_page_checksum=True)
            sync(draft)
            draft.replace(target)
            sync(month)
        except OSError as error:
            raise RunError(f"{target}: cannot be written: {error}") from error

    def sources(self) -> dict[str, str]:
        """Return where the logs were, by the keys of their findings."""
        rows = self.read(["key", "source"]).group_by(["key", "source"]).aggregate([])
        told = zip(rows.column("key").to_pylist(), rows.column("source").to_pylist(), strict=True)
        return {str(key): str(source) for key, source in told}

    def moved(self, key: str, source: str) -> None:
        """Keep where a log is now. Raises RunError where that cannot be written."""
        for file in (self.folder / FINDINGS).glob(f"*/{key}.parquet"):
            table = pq.read_table(file, schema=SCHEMA, page_checksum_verification=True)
            place = SCHEMA.get_field_index("source")
            column = pa.array([whole_text(source)] * table.num_rows, pa.string())
            self._write(file, table.set_column(place, SCHEMA.field(place), column))

    def refusals(self, keys: set[str]) -> dict[str, str]:
        """Return why logs cannot be used, by the keys of their findings, as was kept before."""
        table = self.read(["key", "kind", "text"], ds.field("kind") == "refused")
        told = zip(table.column("key").to_pylist(), table.column("text").to_pylist(), strict=True)
        return {str(key): str(text) for key, text in told if key in keys}

    def forget_refusals(self, now: Mapping[str, str]) -> None:
        """Forget why files could not be used that are other ones by now, as copies that were torn.

        Parameters
        ----------
        now
            The identity of each file that is a log, by where it is.

        Raises
        ------
        RunError
            Where that cannot be written.
        """
        table = self.read(["key", "source", "log_id"], ds.field("kind") == "refused")
        for row in table.to_pylist():
            if now.get(row["source"], row["log_id"]) == row["log_id"]:
                continue
            for file in (self.folder / FINDINGS).glob(f"*/{row['key']}.parquet"):
                try:
                    file.unlink()
                except OSError as error:
                    raise RunError(f"{file}: cannot be removed: {error}") from error
            self._known.discard(row["key"])

    def keep_passing(self, refused: Sequence[Refusal]) -> None:
        """Keep why logs could not be used this time, instead of what was kept of the last one.

        Raises RunError where that cannot be written.
        """
        told = [
            {"source": each.source, "reason": each.reason, "machine": each.machine}
            for each in refused
            if not each.lasting
        ]
        target = self.folder / LAST_RUN
        draft = self.folder / f"{LAST_RUN}{_DRAFT}{os.getpid()}"
        try:
            draft.write_text(json.dumps({"at": datetime.now(UTC).isoformat(), "refused": told}))
            draft.replace(target)
        except OSError as error:
            raise RunError(f"{target}: cannot be written: {error}") from error

    def passing(self) -> list[Refusal]:
        """Return why logs could not be used the last time. Raises DataError where it is damaged."""
        file = self.folder / LAST_RUN
        try:
            return [
                Refusal(
                    whole_text(each["source"]),
                    whole_text(each["reason"]),
                    lasting=False,
                    machine=each["machine"] and whole_text(each["machine"]),
                )
                for each in json.loads(file.read_text())["refused"]
            ]
        except FileNotFoundError:
            return []
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise DataError(
                f"{file}: damaged: {error}; remove it, and the next `motorctl fleet diagnose` "
                "writes it anew"
            ) from error

    def read(
        self, columns: list[str] | None = None, where: ds.Expression | None = None
    ) -> pa.Table:
        """Return findings of all logs, in no order. Raises DataError where a file is damaged."""
        files = sorted(map(str, (self.folder / FINDINGS).glob("*/*.parquet")))
        try:
            return ds.dataset(files, schema=SCHEMA, format=_FORMAT).to_table(columns, where)
        except (pa.ArrowException, OSError) as error:
            raise DataError(
                f"{self.folder}: a damaged file of the store: {error}; remove it, and its log is "
                "looked at again"
            ) from error

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs from writing meanwhile. Raises UsageError where one does."""
        with (self.folder / MARK).open("rb") as mark:
            try:
                fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise UsageError(f"{self.folder}: another run writes to this store") from None
            for draft in (self.folder / FINDINGS).glob(f"*/{_DRAFT}*"):
                draft.unlink()  # of a run that was ended
            yield


def open_store(folder: Path, *, create: bool = False) -> Store:
    """Open a store of findings.

    Parameters
    ----------
    folder
        Where it is.
    create
        Make it where nothing is there.

    Raises
    ------
    UsageError
        Where the folder is something else, of another schema, or cannot be made.
    """
    mark = folder / MARK
    try:
        if create and not mark.exists():
            if folder.exists() and any(folder.iterdir()):
                raise UsageError(f"{folder}: is there already, and is no store of findings")
            folder.mkdir(parents=True, exist_ok=True)
            draft = folder / f"{MARK}{_DRAFT}{os.getpid()}"
            draft.write_text(json.dumps({"motorctl": "findings", "schema": SCHEMA_VERSION}) + "\n")
            draft.replace(mark)
        told = json.loads(mark.read_text())
    except FileNotFoundError as error:
        raise UsageError(
            f"{folder}: is no store of findings: `motorctl fleet diagnose --store` makes one"
        ) from error
    except (OSError, ValueError) as error:
        raise UsageError(f"{folder}: cannot be used as a store: {error}") from error
    schema = told.get("schema") if isinstance(told, dict) else None
    if schema != SCHEMA_VERSION:
        raise UsageError(
            f"{folder}: its schema is {schema}, this motorctl has {SCHEMA_VERSION}: "
            "begin a new store"
        )
    return Store(folder)
