"""Generated modules of compiled kernels, and where they are kept.

Numba notices a change in the file of a cached function, but not in the files of the functions
that it calls. So kernels are cached in a folder named after the content of every source file
that can be part of one: after any change the next start compiles afresh.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import llvmlite  # type: ignore[import-untyped]
import numba

from motorctl.errors import RunError

# What of this package can be part of a kernel: rooms, and modules with constants of records.
KERNEL_ROOMS = ("model", "control", "motion", "loop")
KERNEL_CONSTANTS = ("hal/contract.py", "log/sample.py")


def cache_root() -> Path:
    """Give the folder for compiled kernels: systemd's CacheDirectory=, else the user's cache."""
    if directory := os.environ.get("CACHE_DIRECTORY"):
        return Path(directory.split(":")[0])
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "motorctl"


@cache
def kernel_folder(*others: Path) -> Path:
    """Give the folder of kernels made from just these sources by just this compiler.

    `others` are further folders of sources, for a package outside motorctl.
    """
    digest = hashlib.sha256()
    package = Path(__file__).parent
    for folder in (*(package / room for room in KERNEL_ROOMS), *others):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.read_bytes())
    for constants in KERNEL_CONSTANTS:
        digest.update((package / constants).read_bytes())
    versions = (numba.__version__, llvmlite.__version__, platform.python_version())
    digest.update(repr(versions).encode())
    return cache_root() / f"kernels-{digest.hexdigest()[:16]}"


def source_digest(source: str) -> str:
    """Shorten a generated source, and the sources of the modules that it imports, to a name."""
    digest = hashlib.sha256(source.encode())
    for line in source.splitlines():
        if line.startswith("from ") and " import " in line:
            module = sys.modules.get(line.split()[1])
            path = getattr(module, "__file__", None)
            if path and Path(path).exists():
                digest.update(Path(path).read_bytes())
    return digest.hexdigest()[:16]


def load_generated(name: str, source: str) -> ModuleType:
    """Write a generated module into the cache folder, once, and import it.

    Raises RunError where nothing can be written there.
    """
    full_name = f"motorctl_generated_{name}"
    if full_name in sys.modules:
        return sys.modules[full_name]
    path = _made(kernel_folder()) / f"{full_name}.py"
    if not path.exists():
        draft = path.with_suffix(f".{os.getpid()}.tmp")
        draft.write_text(source)
        draft.replace(path)
    spec = importlib.util.spec_from_file_location(full_name, path)
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


@contextmanager
def kernels_cached(*others: Path) -> Iterator[None]:
    """Let functions that are decorated with ``njit(cache=True)`` inside keep their code here.

    Import the module that defines them inside this context. `others` as in `kernel_folder`.
    Raises RunError where nothing can be written there.
    """
    settings: Any = numba.config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = str(_made(kernel_folder(*others) / "compiled"))
    try:
        yield
    finally:
        settings.CACHE_DIR = before


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = f"{error.strerror}; let XDG_CACHE_HOME name a folder that can be written"
        raise RunError(f"compiled kernels cannot be kept in {folder}: {why}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        why = "no permission to write; let XDG_CACHE_HOME name a folder that can be written"
        raise RunError(f"compiled kernels cannot be kept in {folder}: {why}")
    return folder


def specialise(kernel: Any, *arguments: object) -> Callable[..., Any]:
    """Compile a kernel, or load it from the cache, for arguments of just these types.

    What is given skips the look-up of the arguments' types that a call of `kernel` itself makes,
    which costs several times the tick's mathematics. Every later call must pass the same types.
    """
    type_of: Callable[[object], Any] = numba.typeof
    entry: Callable[..., Any] = kernel.compile(tuple(type_of(a) for a in arguments))
    return entry
