"""Generated modules of kernels, and kernels specialised for the arguments they will have."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numba

from motorctl.errors import RunError
from motorctl.kernels.cache import generated_folder, kernels_cached
from motorctl.kernels.digest import GENERATED, digest_of_source


class _FromSource(SourceFileLoader):
    """Imports a module without Python's bytecode cache, of which nobody checks the content."""

    def get_code(self, fullname: str) -> CodeType | None:
        """Return the code of the source as it stands in the file."""
        return self.source_to_code(self.get_data(self.path), self.path)


def source_digest(source: str) -> str:
    """Shorten a generated source, and all that it imports, to a name.

    Comments and docstrings do not count.

    Parameters
    ----------
    source
        Python source.

    Returns
    -------
    str
        16 hexadecimal digits.
    """
    return digest_of_source(source)


def load_generated(name: str, source: str) -> ModuleType:
    """Write a generated module into the cache folder, once, and import it.

    Parameters
    ----------
    name
        Tells it from other generated modules, as `source_digest` does.
    source
        Its Python source.

    Returns
    -------
    module
        The module, the same one for the same name.

    Raises
    ------
    RunError
        Where nothing can be written there.
    """
    full_name = f"{GENERATED}{name}"
    if full_name in sys.modules:
        return sys.modules[full_name]
    path = generated_folder() / f"{full_name}.py"
    if not _holds(path, source):
        _write(path, source)
    with suppress(OSError):  # another user's folder may be read only
        os.utime(path)  # in use: not to be removed as old
    loader = _FromSource(full_name, str(path))
    spec = importlib.util.spec_from_file_location(full_name, path, loader=loader)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[full_name] = module
    try:
        with kernels_cached():
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[full_name]
        raise
    return module


def _holds(path: Path, source: str) -> bool:
    try:
        return path.read_bytes() == source.encode()
    except OSError:
        return False


def _write(path: Path, source: str) -> None:
    draft = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        draft.write_bytes(source.encode())
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        why = f"{error.strerror}; remove it, or let XDG_CACHE_HOME name another folder"
        raise RunError(f"a generated module cannot be kept as {path}: {why}") from error


def specialise(kernel: Any, *arguments: object) -> Callable[..., Any]:
    """Compile a kernel, or load it from the cache, for arguments of just these types.

    What is returned skips the look-up of the arguments' types that a call of `kernel` itself makes,
    which costs several times the tick's mathematics.

    Parameters
    ----------
    kernel
        A function that numba compiles.
    *arguments
        Of the types that every later call passes; their values do not matter.

    Returns
    -------
    callable
        The compiled code for these types alone.
    """
    type_of: Callable[[object], Any] = numba.typeof
    entry: Callable[..., Any] = kernel.compile(tuple(type_of(a) for a in arguments))
    return entry


def is_kept(kernel: Any, *arguments: object) -> bool:
    """Return whether compiled code for arguments of just these types is on the disk.

    Parameters
    ----------
    kernel
        A function that numba compiles and keeps.
    *arguments
        Of the types that it will be called with.

    Returns
    -------
    bool
        As the index of its files says; the code itself is not read.
    """
    type_of: Callable[[object], Any] = numba.typeof
    kept, types = kernel._cache, tuple(type_of(a) for a in arguments)
    return kept._index_key(types, kernel.targetctx.codegen()) in kept._cache_file._load_index()
