"""Numba's decorator with the type it has for a reader: a compiled function keeps its signature."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def njit(function: Function) -> Function:
    """Compile a function that other compiled functions call."""
    return cast(Function, numba.njit(function))
