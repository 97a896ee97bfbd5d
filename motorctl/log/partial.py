"""The file that a log is while it is being recorded.

It is an Arrow IPC stream, so any Arrow reader opens it. Each batch carries the CRC-32 of its
columns: after a power cut a file system may have kept a file's length but not its data. A
recording that was closed ends with a batch of no rows, which carries what is known at the end only:
whoever makes a log of it later, in whatever process, makes the same one.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.columns import METADATA_KEY

SUFFIX = ".partial"
STREAM_MAGIC = b"\xff\xff\xff\xff"
_CRC_KEY = b"crc32"
_END_KEY = b"end"
_DAMAGE = (pa.ArrowException, OSError, ValueError, MemoryError)


def checksum(columns: Iterable[NDArray[np.generic]]) -> int:
    """Return the CRC-32 over the bytes of contiguous columns, one after the other."""
    crc = 0
    for column in columns:
        crc = zlib.crc32(column.view(np.uint8).data, crc)
    return crc


def encode_head(schema: pa.Schema) -> bytes:
    """Return the bytes with which the stream begins."""
    return schema.serialize().to_pybytes()


def encode_batch(schema: pa.Schema, columns: list[NDArray[np.generic]]) -> memoryview:
    """Return the bytes of one batch: equally long contiguous columns in the schema's order."""
    return _encode(schema, columns, {_CRC_KEY: str(checksum(columns)).encode()})


def values_of(column: pa.Array[Any]) -> NDArray[Any]:
    """Return the numbers of a column, in its own memory.

    `to_numpy` imports pandas, whose hundreds of files keep every thread of a running daemon
    waiting, and so the signs of life without which its loop stops every axis.
    """
    values: NDArray[Any] = np.from_dlpack(column)
    return values


@dataclass(frozen=True)
class Ending:
    """What a recording says when it is closed."""

    rows: int
    """How many should stand before it."""
    metadata: Mapping[str, Any]
    """Joins that of the beginning."""


def encode_ending(schema: pa.Schema, ending: Ending) -> memoryview:
    """Return the bytes with which a stream ends that was closed."""
    told = json.dumps({"rows": ending.rows, "metadata": dict(ending.metadata)}).encode()
    extra = {_END_KEY: told, _CRC_KEY: str(zlib.crc32(told)).encode()}
    return _encode(schema, [np.empty(0, np.uint8) for _ in schema], extra)


def _encode(
    schema: pa.Schema, columns: list[NDArray[np.generic]], extra: dict[bytes, bytes]
) -> memoryview:
    # From their memory: `pa.array` imports pandas, see `values_of`.
    arrays = [
        pa.Array.from_buffers(field.type, len(column), [None, pa.py_buffer(column.data)])
        for field, column in zip(schema, columns, strict=True)
    ]
    batch = pa.RecordBatch.from_arrays(arrays, schema=schema)
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, schema) as writer:
        writer.write_batch(batch, custom_metadata=extra)
        end = sink.tell()
    return memoryview(sink.getvalue())[len(encode_head(schema)) : end]


class PartialFile:
    """A partial file, opened for reading whatever is whole in it.

    After `batches` is exhausted, `given_up_bytes` tells how much of the file is none, and `ending`
    what the recording said when it was closed, if it was. Raises DataError where not even the
    beginning can be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.given_up_bytes = 0
        self.ending: Ending | None = None
        try:
            self._size = path.stat().st_size
            if self._size == 0:
                raise DataError(f"{path}: the file is empty: nothing was recorded")
            self._source = pa.memory_map(str(path))
            self._reader = pa.ipc.open_stream(self._source)
            self.schema: pa.Schema = self._reader.schema
        except _DAMAGE as error:
            cause = str(error).splitlines()[0]
            raise DataError(
                f"{path}: not a recording of motorctl, or cut within its first bytes ({cause})"
            ) from error
        if METADATA_KEY not in (self.schema.metadata or {}) or "tick" not in self.schema.names:
            raise DataError(f"{path}: an Arrow stream, but not a recording of motorctl")

    @property
    def torn(self) -> bool:
        """Return whether something was given up that was, or was to be, data."""
        return self.given_up_bytes > 0

    def batches(self) -> Iterator[pa.RecordBatch]:
        """Yield the whole batches, oldest first, as far as the stream can be followed."""
        end = self._source.tell()
        while True:
            try:
                batch, extra = self._reader.read_next_batch_with_custom_metadata()
            except (StopIteration, *_DAMAGE):
                self.given_up_bytes += self._size - end
                return
            begin, end = end, self._source.tell()
            if (ending := _ending(extra)) is not None:
                self.ending = ending
            elif _is_whole(batch, extra):
                yield batch
            else:
                self.given_up_bytes += end - begin

    def close(self) -> None:
        """Release the file."""
        self._source.close()


def _ending(extra: pa.KeyValueMetadata | None) -> Ending | None:
    """Return what the batch says of the recording's end; None where it is one of rows."""
    try:
        if extra is None or int(extra[_CRC_KEY]) != zlib.crc32(told := extra[_END_KEY]):
            return None
        return Ending(**json.loads(told))
    except (KeyError, TypeError, ValueError):
        return None


def _is_whole(batch: pa.RecordBatch, extra: pa.KeyValueMetadata | None) -> bool:
    try:
        batch.validate(full=True)
        if any(column.null_count for column in batch.columns):
            return False
        columns = [values_of(column) for column in batch.columns]
        return extra is not None and int(extra[_CRC_KEY]) == checksum(columns)
    except (*_DAMAGE, KeyError):
        return False
