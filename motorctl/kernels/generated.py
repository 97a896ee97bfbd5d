"""Generated modules of kernels, and kernels specialised for the arguments they will have."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from types import ModuleType
from typing import Any

import numba

from motorctl.kernels.cache import generated_folder, kernels_cached
from motorctl.kernels.digest import digest_of_source


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
    full_name = f"motorctl_generated_{name}"
    if full_name in sys.modules:
        return sys.modules[full_name]
    path = generated_folder() / f"{full_name}.py"
    if not path.exists():
        draft = path.with_suffix(f".{os.getpid()}.tmp")
        draft.write_text(source)
        draft.replace(path)
    with suppress(OSError):  # another user's folder may be read only
        os.utime(path)  # in use: not to be removed as old
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
