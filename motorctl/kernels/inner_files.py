"""Analysed kernels, kept on the disk as LLVM's unoptimised code.

What a model or a machine changes of a tick is little: the rest of its hundred kernels need not be
analysed again, nor twice by two processes that share the work of a first start.
"""

from __future__ import annotations

import itertools
import os
import secrets
from collections.abc import Sequence
from copy import copy
from typing import Any

import llvmlite.binding as llvm  # type: ignore[import-untyped]
from numba.core import caching, compiler, types
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import JITCodeLibrary
from numba.core.typing import templates

from motorctl.kernels.cache import ByDigest, kernels_cached

_Identity: Any = FunctionIdentity
_CompileResult: Any = compiler.CompileResult
_signature: Any = templates.signature
_NumbasImpl: Any = caching.CompileResultCacheImpl
_NumbasCache: Any = caching.Cache
_NumbasLibrary: Any = JITCodeLibrary


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
    """What was analysed of one inner kernel, by the types of its arguments."""

    _impl_class = _Impl

    def _load_overload(self, sig: Sequence[types.Type], target_context: Any) -> Any:
        found = super()._load_overload(sig, target_context)
        if found is None:
            return None
        found.fndesc.argtypes = tuple(sig)
        return found._replace(signature=_signature(found.signature, *sig))

    def _index_key(self, sig: Sequence[types.Type], codegen: Any) -> tuple[Any, ...]:
        # Of a kernel that is handed over it counts what it is: its type is another in each process.
        told = tuple(_said_of(argument) for argument in sig)
        key: tuple[Any, ...] = super()._index_key(told, codegen)
        return key


def _said_of(argument: types.Type) -> Any:
    if not isinstance(argument, types.Dispatcher):
        return argument
    function = argument.dispatcher.py_func
    place = ByDigest(function, function.__code__.co_filename)
    closed_over = tuple(cell.cell_contents for cell in function.__closure__ or ())
    return (
        function.__module__,
        function.__qualname__,
        place.get_source_stamp(),
        place.get_disambiguator(),
        closed_over,
    )


def files_of(function: Any) -> InnerFiles:
    """Return the files of a function. Raises RunError where none can be kept."""
    with kernels_cached():
        return InnerFiles(function)
