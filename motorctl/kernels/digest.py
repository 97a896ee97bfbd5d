"""What compiled code depends on: a digest of a module's syntax and of all that it imports.

Numba freezes what a kernel uses of other modules: functions, and constants by their values. So
the digest goes over the syntax trees of the module and, through its imports, of every module that
may have given it one. Comments, docstrings, annotations of functions and line numbers do not
count. The libraries that this package requires count by their version; whatever else is imported,
an effect's own package above all, counts by its sources.

A constant that a module reads from elsewhere while it is imported, from a file or the
environment, is not seen: kernels must not use any.
"""

from __future__ import annotations

import hashlib
import importlib.util
import platform
import sys
import time
from pathlib import Path
from typing import Any

import llvmlite  # type: ignore[import-untyped]
import numba
import numpy as np

from motorctl.kernels.parsed_sources import Said, said_by_source

FORM = 4
"""To be raised when what is compiled depends on changes outside of the kernels' sources."""
_SWITCHES: Any = numba.config
COMPILER = (
    FORM,
    *(getattr(_SWITCHES, name) for name in ("BOUNDSCHECK", "DEBUGINFO_DEFAULT", "OPT")),
    numba.__version__,
    llvmlite.__version__,
    np.__version__,
    platform.python_implementation(),
    platform.python_version(),
)
_BEGAN_NS = time.time_ns() - 20_000_000
"""When this process began, less what the clock of files may be behind: two of its ticks."""
GENERATED = "motorctl_generated_"
"""What the names of generated modules begin with; they end with a digest of what they hold."""
LIBRARIES = frozenset(
    [
        "annotated_types",
        "can",
        "cantools",
        "hypothesis",
        "jinja2",
        "llvmlite",
        "matplotlib",
        "msgpack",
        "numba",
        "numpy",
        "pyarrow",
        "pydantic",
        "pydantic_core",
        "pymodbus",
        "pytest",
        "rich",
        "ruckig",
        "scipy",
        "serial",
        "typer",
        "typing_extensions",
        "yaml",
    ]
)
"""Packages that count by their version, wherever they are: they change with it alone, and their
sources take many seconds to read."""


def digest_of_source(source: str) -> str:
    """Return 16 hexadecimal digits for a source and all that it imports."""
    return _Followed().digest("", said_by_source(source.encode(), ""))


def digest_of_file(name: str, path: Path) -> tuple[str, bool]:
    """Return the digest of the module in this file, and whether it is what was imported.

    Parameters
    ----------
    name
        Of the module.
    path
        Where its source is.

    Returns
    -------
    str
        16 hexadecimal digits for the module and its imports.
    bool
        False where one of these files was written after this process began: it may have imported
        the one before. A generated module's name says what it holds.
    """
    followed = _Followed()
    digest = followed.digest(name, said_by_source(path.read_bytes(), _package(name, path)))
    own_ns = 0 if name.startswith(GENERATED) else path.stat().st_ctime_ns
    return digest, max(own_ns, followed.written_ns) <= _BEGAN_NS


class _Followed:
    """The modules that one module reaches through imports."""

    def __init__(self) -> None:
        self._found: dict[str, bytes] = {}
        self._asked: set[tuple[str, str]] = set()
        self.written_ns = 0
        """When the last of the imported files was written."""

    def digest(self, name: str, source: Said) -> str:
        """Return the digest of a module and of what it reaches."""
        self._take(name, source, "*")
        whole = hashlib.sha256(repr(COMPILER).encode())
        for found in sorted(self._found):
            whole.update(found.encode() + b"\0" + self._found[found])
        return whole.hexdigest()[:16]

    def _follow(self, module: str, name: str) -> None:
        """Take what gives a module's name, or with "*" all of the module."""
        if (module, name) in self._asked:
            return
        self._asked.add((module, name))
        path = self._source_of(module)
        if path is None:
            self._found[module.partition(".")[0]] = _version_of(module).encode()
            return
        source = said_by_source(path.read_bytes(), _package(module, path))
        if not module.startswith(GENERATED):
            self.written_ns = max(self.written_ns, path.stat().st_ctime_ns)
        if name == "*" or not source.hands_on:
            self._take(module, source, name)
            return
        for entry in source.imports:
            if entry.bound == name or entry.name == "*":
                self._follow(entry.module, entry.name or "*")
        if not any(entry.bound == name for entry in source.imports):
            part = f"{module}.{name}"
            if _file_of(part):
                self._follow(part, "*")

    def _take(self, module: str, source: Said, name: str) -> None:
        self._found[module] = source.digest
        for entry in source.imports:
            if name in ("*", entry.bound) or entry.name == "*" or entry.bound in source.used:
                self._follow(entry.module, entry.name or "*")
        if name != "*" and _file_of(f"{module}.{name}"):
            self._follow(f"{module}.{name}", "*")

    def _source_of(self, module: str) -> Path | None:
        """Return the file of a module that counts by its source."""
        root = module.partition(".")[0]
        if root in sys.stdlib_module_names:
            return None
        path = _file_of(module)
        if path is None or path.suffix != ".py":
            return None
        return None if root in LIBRARIES else path


def _version_of(module: str) -> str:
    """Return the version that a library states, "" where it has none."""
    root = module.partition(".")[0]
    if root in sys.stdlib_module_names:
        return platform.python_version()
    return str(getattr(sys.modules.get(root), "__version__", ""))


def _file_of(module: str) -> Path | None:
    """Return where a module's code is; None where there is no such module."""
    loaded = sys.modules.get(module)
    if loaded is not None:
        file = getattr(loaded, "__file__", None)
        return Path(file) if file else None
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec and spec.has_location and spec.origin else None


def _package(name: str, path: Path) -> str:
    return name if path.name == "__init__.py" else name.rpartition(".")[0]
