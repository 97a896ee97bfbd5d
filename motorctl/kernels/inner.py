"""Kernels that only other kernels call: analysed once, optimised and translated with the caller.

Numba optimises every function with all that it calls, and makes machine code and an entry for
Python of it. Of a tick's hundred functions only the outermost is ever called from Python, so the
rest of that work is thrown away: it is two thirds of what a first start takes. The functions here
stop at LLVM's unoptimised code; the kernel that is called from Python, an ordinary
``njit(cache=True)``, takes it in and is optimised as a whole.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar, overload

import numba
from numba.core import ir, types
from numba.core.caching import NullCache
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from motorctl.kernels.inner_files import Entry, InnerLibrary, files_of
from motorctl.kernels.seldom import collect_seldom_while_compiling

collect_seldom_while_compiling()

Function = TypeVar("Function", bound=Callable[..., Any])


class _Lower(Lower):
    def lower_assign(self, ty: Any, inst: Any) -> Any:
        if isinstance(ty, types.Dispatcher) and isinstance(inst.value, ir.Global | ir.FreeVar):
            # A kernel as a value: calls go by its type. Numba's own would be where the object is
            # in this process, which is nothing to keep on a disk.
            return self.context.get_constant_null(ty)
        return super().lower_assign(ty, inst)


@register_pass(mutates_CFG=True, analysis_only=False)
class _LowerInner(NativeLowering):
    _name = "inner_kernel_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        return _Lower

    def run_pass(self, state: Any) -> bool:
        state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_cpython_wrapper = True
        state.flags.no_cfunc_wrapper = True
        state.flags.no_compile = True
        super().run_pass(state)
        lowered, entry = state["cr"], Entry()
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


class _InnerCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes = PassManager("inner kernel")
        for step, title in usual.passes:
            passes.add_pass(_LowerInner if step is NativeLowering else step, title)
        passes.finalize()
        return [passes]


_UNASKED: Any = NullCache()
"""Files that nobody has asked for yet: most kernels that are imported are never compiled."""


class _InnerKernel(CPUDispatcher):
    _cache: Any

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._cache = _UNASKED

    def compile(self, sig: Any) -> Any:
        if self._cache is _UNASKED:
            self._cache = files_of(self)
        return super().compile(sig)

    def add_overload(self, cres: Any) -> None:
        self.overloads[tuple(cres.signature.args)] = cres

    def get_call_template(self, args: Any, kws: Any) -> Any:
        # One copy for all values of a constant: the optimiser knows them where it inlines.
        plain = tuple(types.unliteral(arg) for arg in args)
        return super().get_call_template(
            plain, {name: types.unliteral(arg) for name, arg in kws.items()}
        )

    @cached_property
    def _alone(self) -> Any:
        options = {name: value for name, value in self.targetoptions.items() if name != "nopython"}
        return numba.njit(self.py_func, **options)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._alone(*args, **kwargs)


@overload
def inner_kernel(function: Function, /) -> Function: ...
@overload
def inner_kernel(*, error_model: str) -> Callable[[Function], Function]: ...
def inner_kernel(function: Any = None, /, **options: Any) -> Any:
    """Compile a function that other kernels call.

    A call from Python, as tests make, compiles it once more, for itself. What was analysed is kept
    on the disk, so a kernel must not use what its sources do not say, such as a constant that is
    changed after the import. Division by zero gives inf or nan unless ``error_model`` says
    otherwise: no tick ends by an exception.

    Parameters
    ----------
    function
        What numba can compile; None: the decorator is returned, as for a decorator with options.
    **options
        Numba's, such as ``error_model="numpy"``.

    Returns
    -------
    callable
        The kernel, or the decorator that makes one.
    """
    if function is None:
        return lambda decorated: inner_kernel(decorated, **options)
    # Numba lets what is not said be inherited from whichever caller compiles a kernel first.
    usual = {"error_model": "numpy", "fastmath": False, "forceinline": False}
    options = {"nopython": True, "boundscheck": None, **usual, **options}
    return _InnerKernel(function, targetoptions=options, pipeline_class=_InnerCompiler)
