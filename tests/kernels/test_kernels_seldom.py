"""Compiling is not held up by Python's search for garbage, and leaves it as it was."""

from __future__ import annotations

import gc
from typing import Any

import numba
import pytest
from numba.core import event
from numba.core.errors import NumbaError

import motorctl.kernels  # noqa: F401  (whoever compiles kernels has imported it)
from motorctl.garbage import SELDOM


class Looks(event.Listener):
    """Notes the thresholds at each end of a compilation."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, int, int]] = []

    def on_start(self, event: Any) -> None:
        self.seen.append(gc.get_threshold())

    def on_end(self, event: Any) -> None:
        pass


def compiled(function: Any) -> list[tuple[int, int, int]]:
    looks = Looks()
    with event.install_listener("numba:compile", looks):
        numba.njit(function)(1.0)
    return looks.seen


def inner(x):
    return x + 1.0


def test_garbage_is_looked_for_seldom_while_kernels_compile_and_then_as_before():
    before = gc.get_threshold()
    called = numba.njit(inner)
    seen = compiled(lambda x: called(x) * 2.0)
    assert len(seen) >= 2  # one within the other
    assert set(seen) == {SELDOM} != {before}
    assert gc.get_threshold() == before


def test_a_kernel_that_cannot_be_compiled_leaves_the_search_as_it_was():
    before = gc.get_threshold()
    with pytest.raises(NumbaError):
        compiled(lambda x: x.nothing)
    assert gc.get_threshold() == before


def test_where_no_garbage_is_looked_for_none_is_after_compiling():
    gc.disable()
    try:
        compiled(lambda x: x - 1.0)
        assert not gc.isenabled()
    finally:
        gc.enable()
