"""Analysed kernels, kept on the disk as LLVM's unoptimised code.

What a model or a machine changes of a tick is little: the rest of its hundred kernels need not be
analysed again, nor twice by two processes that share the work of a first start.
"""

from __future__ import annotations

import hashlib
import inspect
import itertools
import os
import secrets
from contextlib import suppress
from copy import copy
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm  # type: ignore[import-untyped]
from numba.core import caching, compiler, serialize, sigutils, types
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import JITCodeLibrary
from numba.core.dispatcher import Dispatcher
from numba.core.typing import templates

from motorctl.kernels.cache import digest_of, kernels_cached, said_by

_Identity: Any = FunctionIdentity
_CompileResult: Any = compiler.CompileResult
_signature: Any = templates.signature
_normalized: Any = sigutils.normalize_signature
_dumps: Any = serialize.dumps
_NumbasImpl: Any = caching.CompileResultCacheImpl
_NumbasCache: Any = caching.Cache
_NumbasLibrary: Any = JITCodeLibrary

_COUNTED_BEFORE = next(_Identity._unique_ids) > 1
"""Whether numba has given numbers that another process gives, too."""


def _count_apart() -> None:
    """Let no two processes give a function the same number.

    Numba tells functions of one name and the same types apart by a count, and where names agree
    links whichever it finds. Code of several processes meets here.
    """
    _Identity._unique_ids = itertools.count(secrets.randbits(62))


_count_apart()
os.register_at_fork(after_in_child=_count_apart)


class InnerLibrary(_NumbasLibrary):  # type: ignore[misc]
    """Code that waits, as it was written, for the library that links it."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def linked_code(self) -> bytes:
        """Return what another library links, with all that it calls."""
        code: bytes = self._get_module_for_linking().as_bitcode()
        return code

    @classmethod
    def from_linked_code(cls, codegen: Any, name: str, code: bytes) -> InnerLibrary:
        """Return the library that had this to be linked."""
        library = cls(codegen, name)
        library._final_module = library._shared_module = llvm.parse_bitcode(code)
        library._finalize_final_module()
        return library


class Entry:
    """What numba knows a compiled function by; nobody can call it."""


class _Impl(_NumbasImpl):  # type: ignore[misc]
    def reduce(self, cres: Any) -> tuple[Any, ...]:
        described = copy(cres.fndesc)
        described.typemap = described.calltypes = described.argtypes = None
        return cres.library.name, cres.library.linked_code(), described, cres.signature.return_type

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> Any:
        name, code, described, returned = payload
        return _CompileResult(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=InnerLibrary.from_linked_code(target_context.codegen(), name, code),
            environment=None,
            entry_point=Entry(),
            fndesc=described,
            type_annotation="",
            signature=returned,
            objectmode=False,
            lifted=(),
            typing_error=None,
            call_helper=None,
            metadata=None,
            reload_init=(),
            referenced_envs=(),
        )

    def check_cachable(self, cres: Any) -> bool:
        return not (cres.lifted or cres.reload_init or cres.library.has_dynamic_globals)


class InnerFiles(_NumbasCache):  # type: ignore[misc]
    """What was analysed of one inner kernel, by what it is and the types of its arguments."""

    _impl_class = _Impl

    def __init__(self, kernel: Any) -> None:
        self._is = _identity(kernel)
        super().__init__(kernel.py_func)

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            found = super()._load_overload(sig, target_context)
        except Exception:  # what another numba has kept, or names that are gone
            return None
        if found is None:
            return None
        arguments, _ = _normalized(sig)
        found.fndesc.argtypes = tuple(arguments)
        return found._replace(signature=_signature(found.signature, *arguments))

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        arguments, returned = _normalized(sig)
        # Of a kernel that is handed over it counts what it is: its type is another in each process.
        told = tuple(
            _identity(argument.dispatcher) if isinstance(argument, types.Dispatcher) else argument
            for argument in arguments
        )
        return (told, returned, codegen.magic_tuple(), self._is)

    def _save_overload(self, sig: Any, data: Any) -> None:
        with suppress(Exception):  # keeping it is a convenience; it was compiled all the same
            super()._save_overload(sig, data)


class _NothingToTellItByError(Exception):
    """A kernel is from no file, or from one that was written after this process began."""


def _identity(kernel: Any) -> str:
    """Return a digest of all that decides what a kernel is compiled to, but for its arguments.

    Raises _NothingToTellItByError.
    """
    function = kernel.py_func
    try:
        file = Path(inspect.getfile(function))
        digest, sure = digest_of(function.__module__, file)
        closed_over = [cell.cell_contents for cell in function.__closure__ or ()]
    except (TypeError, OSError, SyntaxError, ValueError) as error:
        raise _NothingToTellItByError from error
    if not sure or any(value is kernel for value in closed_over):
        raise _NothingToTellItByError
    parts = (
        function.__module__,
        function.__qualname__,
        digest,
        said_by(function),
        sorted(kernel.targetoptions.items()),
        [_value(value) for value in function.__defaults__ or ()],
        [_value(value) for value in closed_over],
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _value(value: Any) -> str:
    if isinstance(value, Dispatcher):
        return _identity(value)
    try:
        return hashlib.sha256(_dumps(value)).hexdigest()
    except Exception as error:  # whatever cannot be pickled
        raise _NothingToTellItByError from error


def files_of(kernel: Any) -> Any:
    """Return the files of an inner kernel; none where it cannot be told from others, or kept."""
    if _COUNTED_BEFORE:
        return caching.NullCache()
    try:
        with kernels_cached():
            return InnerFiles(kernel)
    except Exception:  # keeping is a convenience; the kernel that is called from Python tells
        return caching.NullCache()
