"""Find out what kind of file something is by its content, and open it."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from motorctl.errors import DataError
from motorctl.log.partial import STREAM_MAGIC, SUFFIX
from motorctl.log.table import Table
from motorctl.log.table_csv import CsvTable
from motorctl.log.table_hdf5 import Hdf5Table
from motorctl.log.table_mat import MatTable
from motorctl.log.table_npz import NumpyTable
from motorctl.log.table_parquet import ParquetTable
from motorctl.log.text_lines import UTF_16

_HEAD_BYTES = 512
_HDF5 = b"\x89HDF\r\n\x1a\n"
_ZIP = b"PK\x03\x04"
_NPY = b"\x93NUMPY"
_FOREIGN = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    _ZIP: "an Excel workbook or another ZIP archive",
    b"\x1f\x8b": "a gzip archive",
    b"%PDF": "a PDF document",
    b"ARROW1": "an Arrow file",
    b"\x7fELF": "a program",
}


def open_table(path: Path, header_line: int | None = None, wanted: Collection[str] = ()) -> Table:
    """Open a table by its content.

    Parameters
    ----------
    path
        The file.
    header_line
        The line of a text file that has the names of its columns, from 1, where it is told.
    wanted
        Columns that will be read, where they are known: they tell the header among other lines.

    Raises
    ------
    DataError
        Where it is of no known kind, or damaged.
    """
    head = _head(path)
    if _begins_unfinished(path, head):
        raise DataError(
            f"{path}: a recording that was not finished; run `motorctl log recover {path}` first"
        )
    if head.startswith(b"PAR1"):
        return ParquetTable(path)
    if head.startswith(_HDF5) or b"MATLAB 7.3" in head:
        return Hdf5Table(path)
    if head.startswith(_NPY) or (head.startswith(_ZIP) and path.suffix.lower() == ".npz"):
        return NumpyTable(path)
    for magic, what in _FOREIGN.items():
        if head.startswith(magic):
            raise DataError(f"{path}: is {what}, not a recording")
    if path.suffix.lower() == ".parquet":
        raise DataError(f"{path}: not a Parquet file: it begins with {head[:4]!r}, not b'PAR1'")
    if head.startswith(b"MATLAB") or path.suffix.lower() == ".mat":
        return MatTable(path)
    if b"\0" in head and not head.startswith(UTF_16):
        raise DataError(f"{path}: neither Parquet, MAT nor CSV: it begins with {head[:8]!r}")
    return CsvTable(path, header_line, wanted)


def is_unfinished(path: Path) -> bool:
    """Return whether a file is the partial file of a recording. Raises DataError without one."""
    return _begins_unfinished(path, _head(path))


def _begins_unfinished(path: Path, head: bytes) -> bool:
    return head.startswith(STREAM_MAGIC) or path.name.endswith(SUFFIX)


def _head(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise DataError(f"{path}: is a folder, not a recording")
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except FileNotFoundError as error:
        hint = ""
        if (beside := path.with_name(path.name + SUFFIX)).exists():
            hint = f"; there is an unfinished recording: `motorctl log recover {beside}`"
        raise DataError(f"{path}: no such file{hint}") from error
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read: {error}") from error
    if not head:
        raise DataError(f"{path}: the file is empty")
    return head
