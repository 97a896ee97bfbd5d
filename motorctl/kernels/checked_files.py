"""Compiled code as it stands on the disk: taken only where every byte is as it was written.

Numba unpickles whatever it finds. A file that a power cut left short would end the start with a
traceback, one with a flipped bit would be run as a control law. So each file carries a checksum,
and one that does not agree with it counts as not there: the kernel is compiled anew, and the file
replaced. A disk that refuses costs the time to compile at each start, and no start.
"""

from __future__ import annotations

import hashlib
import logging
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba.core import caching

HEAD = b"motorctl kernel 2\n"
_BYTES = hashlib.sha256().digest_size

_log = logging.getLogger("motorctl")
_told: set[str] = set()
"""What was said already: one message a process, not one a kernel."""


_NumbasFiles: Any = caching.IndexDataCacheFile


class _CheckedFiles(_NumbasFiles):  # type: ignore[misc]
    """The index of a function's compiled code and the code itself, each with its checksum."""

    def load(self, key: Any) -> Any:
        """Return what is kept for a signature; None where there is nothing that can be used."""
        if not self._source_stamp:
            return None
        name = self._load_index().get(key)
        kept = None if name is None else self._content(self._data_path(name))
        # Of two processes that kept code at once, one may have written the index, one the file.
        return kept[1] if kept and kept[0] == key else None

    def save(self, key: Any, data: Any) -> None:
        """Keep something for a signature, unless its sources may not be what was imported."""
        if not self._source_stamp:
            return
        try:
            super().save(key, (key, data))
        except OSError as error:
            why = f"{error.strerror}: it is compiled again at each start"
            _tell_once(f"compiled code cannot be kept in {self._cache_path}", why)

    def _load_index(self) -> Any:
        stamp, overloads = self._content(self._index_path) or (None, {})
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads: Any) -> None:
        with self._open_for_write(self._index_path) as file:
            file.write(_sealed(self._dump((self._source_stamp, overloads))))

    def _save_data(self, name: str, data: Any) -> None:
        with self._open_for_write(self._data_path(name)) as file:
            file.write(_sealed(self._dump(data)))

    def _content(self, path: str) -> Any:
        try:
            whole = Path(path).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            _tell_once(f"compiled code in {self._cache_path} cannot be read", str(error.strerror))
            return None
        payload = whole[len(HEAD) + _BYTES :]
        if whole != _sealed(payload):
            name, size = Path(path).name, len(whole)
            why = f"{name}, {size} bytes, is not as it was written; it is compiled anew"
            _tell_once(f"compiled code in {self._cache_path} is damaged", why)
            return None
        try:
            return pickle.loads(payload)
        except Exception:  # it names what is installed no longer
            return None


@contextmanager
def files_checked() -> Iterator[None]:
    """Let functions that numba decorates inside keep their code in files with a checksum.

    Yields
    ------
    None
        It is so until the context ends.
    """
    module: Any = caching
    before = module.IndexDataCacheFile
    module.IndexDataCacheFile = _CheckedFiles
    try:
        yield
    finally:
        module.IndexDataCacheFile = before


def _sealed(payload: bytes) -> bytes:
    return HEAD + hashlib.sha256(payload).digest() + payload


def _tell_once(what: str, why: str) -> None:
    kind = what.rsplit(" ", 1)[-1]
    if kind not in _told:
        _told.add(kind)
        _log.warning("%s: %s", what, why)
