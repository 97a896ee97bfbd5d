"""Which logs are meant: paths and patterns, local or wherever fsspec reaches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fsspec
import pyarrow as pa
from fsspec.implementations.local import LocalFileSystem

from motorctl.errors import DataError, UsageError
from motorctl.log.folder import EXPORT_SUFFIX
from motorctl.log.open_table import open_table
from motorctl.log.opened_parquet import OpenedParquet, damaged, is_passing

MARK = "store.json"
"""The file that makes a folder a store of findings."""
FINDINGS = "findings"
"""The folder in it that has them, by months."""
_PATTERN = set("*?[")
_REFUSED = (PermissionError, IsADirectoryError)
_QUERY = "?"
_WITH_QUERIES = {"http", "https"}


class _Listed(LocalFileSystem):  # type: ignore[misc]  # fsspec has no types
    """Files on a disk here; keeps which folders could not be read, as patterns pass over them."""

    cachable = False

    def __init__(self) -> None:
        super().__init__()
        self.not_read: dict[str, str] = {}

    def ls(self, path: str, detail: bool = False, **kwargs: Any) -> list[Any]:
        """Return what is in a folder."""
        try:
            return list(super().ls(path, detail, **kwargs))
        except (FileNotFoundError, NotADirectoryError):
            raise  # gone by now, or a file
        except OSError as error:
            folder = str(path).rstrip("/") or "/"
            self.not_read[folder] = f"{folder}: this folder cannot be read: {error.strerror}"
            raise


def logs_of(patterns: Sequence[str], not_read: dict[str, str] | None = None) -> list[str]:
    """Return the files that paths and patterns mean, each once, in order.

    Patterns leave out what `log export` wrote, as its log is there, and files of stores.

    Parameters
    ----------
    patterns
        As ``logs/**/*.parquet``, ``s3://bucket/*.parquet`` or one file.
    not_read
        Is given the folders on a disk here that patterns reach and that cannot be read, with why.

    Raises
    ------
    UsageError
        Where a pattern meets nothing, or the package that reads such addresses is not installed.
    """
    found: dict[str, None] = {}
    for pattern in patterns:
        files, address = _file_system(pattern)
        if not _is_pattern(files, address):
            found[_name(files, address)] = None  # whether it is there is told when it is looked at
            continue
        if isinstance(files, LocalFileSystem):
            files = _Listed()
        met = [
            _name(files, path)
            for path in sorted(files.glob(address))
            if not path.endswith(EXPORT_SUFFIX) and not files.isdir(path) and not _in_store(path)
        ]
        unread = files.not_read if isinstance(files, _Listed) else {}
        if not_read is not None:
            not_read |= unread
        if not met:
            why = "; ".join(unread.values()) or "in a shell, quote it"
            raise UsageError(f"{pattern}: no file is meant by it; {why}")
        found |= dict.fromkeys(met)
    return list(found)


@contextmanager
def opened(source: str) -> Iterator[OpenedParquet]:
    """Open a log to be read row group by row group. Raises DataError where it is none."""
    files, address = _file_system(source)
    try:
        with files.open(address, "rb") as raw, _parquet(source, raw, files, address) as file:
            yield file
    except FileNotFoundError as error:
        raise DataError(f"{source}: no such file") from error
    except (pa.ArrowException, ValueError, OSError) as error:
        if is_passing(error) and not isinstance(error, _REFUSED):
            raise
        if isinstance(files, LocalFileSystem):
            open_table(Path(address))  # says what it is, where it is no file
        raise damaged(source, error) from error


def _parquet(source: str, raw: Any, files: Any, address: str) -> OpenedParquet:
    try:
        return OpenedParquet(source, raw)
    except DataError:
        if isinstance(files, LocalFileSystem):
            open_table(Path(address))  # says what it is, where it is no Parquet file
        raise


def is_there(source: str) -> bool:
    """Tell whether a file can be seen."""
    files, address = _file_system(source)
    return bool(files.exists(address))


def ends_of(source: str, most_bytes: int) -> tuple[int, bytes, bytes]:
    """Return the size of a file and what stands at its beginning and its end. Raises DataError."""
    files, address = _file_system(source)
    try:
        size = int(files.info(address)["size"])
        begin = files.read_block(address, 0, min(size, most_bytes)) if size else b""
        end = files.read_block(address, max(0, size - most_bytes), most_bytes) if size else b""
    except FileNotFoundError as error:
        raise DataError(f"{source}: no such file") from error
    except _REFUSED as error:
        raise DataError(f"{source}: cannot be read: {error}") from error
    return size, begin, end


def _file_system(address: str) -> tuple[fsspec.AbstractFileSystem, str]:
    try:
        files, path = fsspec.core.url_to_fs(address)
    except (ImportError, ValueError) as error:
        raise UsageError(f"{address}: cannot be reached: {error}") from error
    return files, str(path)


def _is_pattern(files: fsspec.AbstractFileSystem, address: str) -> bool:
    signs = _PATTERN & set(address)
    protocols = (files.protocol,) if isinstance(files.protocol, str) else files.protocol
    if _WITH_QUERIES & set(protocols):
        signs -= {_QUERY}
    return bool(signs) and not files.exists(address)


def _in_store(path: str) -> bool:
    """Tell whether a local file is one of a store's."""
    folder = Path(path).parent.parent
    return folder.name == FINDINGS and (folder.parent / MARK).is_file()


def _name(files: fsspec.AbstractFileSystem, path: str) -> str:
    return path if isinstance(files, LocalFileSystem) else str(files.unstrip_protocol(path))
