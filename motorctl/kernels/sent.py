"""Compiled kernels on their way from the process that compiled them into one that must not wait.

To load a kernel as numba does, a process has to have its module: sources are read, parsed, compiled
and looked up by a digest, and types put together again. That holds Python's lock for milliseconds
at a time, in which no tick comes. Here nothing but machine code is sent. What is left to do is a
few short steps, and the linking itself, which leaves the lock alone.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numba
import numpy as np
from numba.core import cpu, environment
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target

from motorctl.errors import RunError
from motorctl.kernels.generated import specialise

_numba_environment: Any = environment
_numbas_lock: Any = global_compiler_lock
_numbas_target: Any = cpu_target
_numbas_cpu: Any = cpu

Shape = tuple[str, str, int]
"""Of an argument: its type, and of an array a digest of its dtype and how many dimensions."""


@dataclass(frozen=True)
class SentKernel:
    """A kernel for arguments of certain types, compiled for this computer."""

    name: str
    entry: str
    """The machine code's symbol that Python calls."""
    environment: str
    """The symbol that points to what the code asks Python for."""
    environments: tuple[tuple[str, tuple[Any, ...]], ...]
    """All of them, with their constants."""
    code: bytes
    """An object file."""
    arguments: tuple[Shape, ...]


def packed(kernel: Any, *arguments: object) -> SentKernel:
    """Compile a kernel, or load it from the cache, and return what another process needs of it.

    Parameters
    ----------
    kernel
        A function that numba compiles and keeps.
    *arguments
        Of the types that every later call passes.

    Returns
    -------
    SentKernel
        To be pickled.

    Raises
    ------
    RunError
        Where a part of the kernel cannot be sent.
    """
    specialise(kernel, *arguments)
    type_of: Callable[[object], Any] = numba.typeof
    types = tuple(type_of(argument) for argument in arguments)
    parts = _parts(kernel, types)
    (name, _, (code, _)), described, own, *_, on_load, others = parts
    if on_load:
        raise RunError(f"{name}: a kernel that is prepared in each process cannot be sent")
    environments = {e.env_name: tuple(e.consts) for e in (own, *others)}
    return SentKernel(
        name,
        described.llvm_cpython_wrapper_name,
        described.env_name,
        tuple(environments.items()),
        bytes(code),
        know_arguments(*arguments),
    )


def _parts(kernel: Any, types: tuple[Any, ...]) -> Any:
    """Return what numba keeps of a kernel that is compiled."""
    files = kernel._cache
    # Code that was loaded has been handed to the linker, and stands on the disk alone.
    if kept := files._cache_file.load(files._index_key(types, kernel.targetctx.codegen())):
        return kept
    try:
        return kernel.overloads[types]._reduce()
    except RuntimeError:  # it was loaded, and another process has written the files anew since
        options = {name: of for name, of in kernel.targetoptions.items() if name != "nopython"}
        anew: Any = numba.njit(kernel.py_func, **options)
        anew.compile(types)
        return anew.overloads[types]._reduce()


_entries: dict[str, Callable[..., Any]] = {}
"""What was unpacked, by symbol: code is linked once, and for good, as another tick may run it."""


def unpacked(sent: SentKernel, *arguments: object) -> Callable[..., Any]:
    """Link a kernel into this process; as `specialise`.

    It takes some milliseconds, of which a thread beside another one keeps Python's lock for no
    longer than it is asked to. Its memory is never given back: as much as the object file has.

    Parameters
    ----------
    sent
        From `packed`.
    *arguments
        Of the types that every later call passes.

    Returns
    -------
    callable
        The compiled code.

    Raises
    ------
    RunError
        Where it was compiled for others.
    """
    if know_arguments(*arguments) != sent.arguments:
        raise RunError(
            f"{sent.name} was compiled for other records than these: what is installed has changed "
            "since this process began; restart it"
        )
    if sent.entry not in _entries:
        with _numbas_lock:
            _entries[sent.entry] = _linked(sent)
    return _entries[sent.entry]


def know_arguments(*arguments: object) -> tuple[Shape, ...]:
    """Return what kernels are sent for, and keep it: to look through a dtype holds Python's lock.

    Parameters
    ----------
    *arguments
        What kernels will be called with that are unpacked in this process.

    Returns
    -------
    tuple
        The shape of each.
    """
    return tuple(map(_shape, arguments))


def _linked(sent: SentKernel) -> Callable[..., Any]:
    context = _numbas_target.target_context
    context.refresh()  # what code may call has to be there, as where numba loads it
    codegen = context.codegen()
    engine, library = codegen._engine, None
    # The code that this process began with is in the engine already, and its symbols are.
    if not engine.is_symbol_defined(sent.entry):
        library = codegen.create_library(sent.name)
        library.enable_object_caching()
        library._set_compiled_object(sent.code)
        library._finalize_final_module()
    address = engine.get_function_address(sent.entry)
    found = {}
    for name, constants in sent.environments:
        found[name] = own = _numba_environment.lookup_environment(name)
        if own is None:
            found[name] = own = _numba_environment.Environment({"__name__": __name__})
            own.consts[:] = constants
            own.env_name = name
            _numba_environment.Environment._memo[name] = own
        codegen.set_env(name, own)
    kept = (library, *found.values())
    entry: Callable[..., Any] = _numbas_cpu._dynfunc.make_function(
        sys.modules[__name__],
        "sent_kernel",
        sent.name,
        address,
        found[sent.environment],
        kept,
    )
    return entry


def _shape(argument: object) -> Shape:
    kind = type(argument).__name__
    if isinstance(argument, np.ndarray):
        return kind, _digest(argument.dtype), argument.ndim
    return kind, "", 0


@cache
def _digest(dtype: Any) -> str:
    """Return what another process has for the same fields at the same places, too."""
    return hashlib.sha256(repr(dtype).encode()).hexdigest()
