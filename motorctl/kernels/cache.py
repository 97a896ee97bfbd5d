"""Where compiled kernels are kept, and for how long.

Numba's own cache looks at one file: a touched file is compiled again though nothing changed, and
a change in a file that it imports goes unnoticed. Here each module with kernels has a folder
named after the digest of all that they depend on, so that what is found there is right.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numba
from numba.core.caching import _CacheLocator

from motorctl.cache_folder import cache_root
from motorctl.errors import RunError
from motorctl.kernels.checked_files import files_checked
from motorctl.kernels.digest import digest_of_file
from motorctl.kernels.parsed_sources import parsed_folder

UNUSED_DAYS = 30.0
"""What no start has asked for so long is removed."""
LARGEST_BYTES = 1 << 30
"""Beyond this size of a folder what was unused for longest is removed first. A machine's kernels
take about 2 MB; the whole test suite's 300 MB."""
KEPT_DAYS = 1.0
"""Nothing is removed that was used so recently: another process may be working with it."""
DAY_S = 86400.0


def generated_folder() -> Path:
    """Return the folder of generated modules, made.

    Raises RunError where nothing can be written there.
    """
    return _made(cache_root() / "generated")


def compiled_folder() -> Path:
    """Return the folder that holds a folder for each module with kernels, made.

    Raises RunError where nothing can be written there.
    """
    return _made(cache_root() / "compiled")


@contextmanager
def kernels_cached() -> Iterator[None]:
    """Let functions that are decorated with ``njit(cache=True)`` inside keep their code here.

    Import the module that defines them inside this context.

    Yields
    ------
    None
        The kernels' cache is in force until the context ends.

    Raises
    ------
    RunError
        Where nothing can be written there.
    """
    compiled_folder()
    settings: Any = numba.config
    before = settings.CACHE_LOCATOR_CLASSES
    settings.CACHE_LOCATOR_CLASSES = f"{__name__}.{ByDigest.__name__}"
    try:
        with files_checked():
            yield
    finally:
        settings.CACHE_LOCATOR_CLASSES = before


class ByDigest(_CacheLocator):
    """Tells numba where a function's compiled code is, by all that it depends on."""

    def __init__(self, function: FunctionType, file: str) -> None:
        self._py_file = file
        self._name = said_by(function)[:8]
        self._folder, self._digest = _folder_of(function.__module__, Path(file))

    def get_cache_path(self) -> str:
        """Return the folder of the function's module."""
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        """Do nothing: the folder was made, and a disk that refuses is told when code is kept."""

    def get_source_stamp(self) -> str:
        """Return what the compiled code must agree with; "" where nothing may be kept."""
        return self._digest

    def get_disambiguator(self) -> str:
        """Return what tells functions of the same name in a module apart."""
        return self._name

    @classmethod
    def from_function(cls, function: FunctionType, file: str) -> ByDigest | None:
        """Make the locator of a function that comes from a file."""
        return cls(function, file) if Path(file).exists() else None


def said_by(function: FunctionType) -> str:
    """Return a digest of what a function's code says, without its lines and its docstring."""
    said = repr(_said(function.__code__, function.__doc__))
    return hashlib.sha256(said.encode()).hexdigest()


def _said(code: CodeType, docstring: str | None = None) -> tuple[Any, ...]:
    constants = [
        _said(constant) if isinstance(constant, CodeType) else constant
        for constant in code.co_consts
        if docstring is None or constant != docstring
    ]
    return (code.co_code, code.co_names, code.co_varnames, constants)


digest_of = cache(digest_of_file)


@cache
def _folder_of(module: str, file: Path) -> tuple[Path, str]:
    digest, sure = digest_of(module, file)
    folder = compiled_folder() / f"{module}-{digest}"
    if not sure:
        return folder, ""
    with suppress(OSError):
        if not folder.exists():
            folder.mkdir(exist_ok=True)
            _tidy_up()
        os.utime(folder)
    return folder, digest


_tidied: list[bool] = []
"""Not empty once the caches were looked through: once a process."""


def _tidy_up() -> None:
    """Keep the caches from growing without end."""
    if not _tidied:
        _tidied.append(True)
        _remove_unused(compiled_folder())
        _remove_unused(generated_folder())
        if parsed_folder().exists():
            _remove_unused(parsed_folder())


def _remove_unused(parent: Path) -> None:
    now, total = time.time(), 0
    for last_used, entry in sorted(_with_times(parent.iterdir()), reverse=True):
        with suppress(OSError):  # another user's, or one that another process works with
            files = list(_with_times(entry.rglob("*") if entry.is_dir() else [entry]))
            for written, file in files:  # of a process that was killed while it wrote
                if ".tmp." in file.name and (now - written) / DAY_S > KEPT_DAYS:
                    file.unlink()
            total += sum(file.stat().st_size for _, file in files if ".tmp." not in file.name)
            age_days = (now - last_used) / DAY_S
            if age_days > UNUSED_DAYS or (total > LARGEST_BYTES and age_days > KEPT_DAYS):
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()


def _with_times(entries: Iterable[Path]) -> Iterator[tuple[float, Path]]:
    """Yield when each was written last, but for what another process removes meanwhile."""
    for entry in entries:
        with suppress(FileNotFoundError):
            yield entry.stat().st_mtime, entry


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = f"{error.strerror}; let XDG_CACHE_HOME name a folder that can be written"
        raise RunError(f"compiled kernels cannot be kept in {folder}: {why}") from error
    if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
        why = (
            "no permission to read and write; let XDG_CACHE_HOME name a folder that can be written"
        )
        raise RunError(f"compiled kernels cannot be kept in {folder}: {why}")
    return folder
