"""What MATLAB's ``save -v7.3`` writes: its arrays, structs, cells and objects within HDF5.

Arrays are stored by columns, so their sizes stand the other way round. A struct is a group; of an
array of structs each field is a list of references, and so is a cell; what they refer to stands in
a group of its own. Attributes tell the class of each.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from motorctl.log.hdf5_place import DEEPEST, Place, members
from motorctl.log.mat_objects import OBJECT_REFERENCE
from motorctl.log.table import MOST_MATRIX_COLUMNS
from motorctl.log.table_mat import dotted, vectors_of

if TYPE_CHECKING:
    import h5py

_CLASS = "MATLAB_class"
_NO_NUMBERS = ("char", "cell", "function_handle")
_OBJECTS = "#subsystem#/MCOS"
"""What all objects of the file hold."""


def is_of_matlab(file: h5py.File) -> bool:
    """Return whether MATLAB, or something in its format, wrote a file."""
    return any(_CLASS in item.attrs for item in members(file).values())


def places_of_matlab(file: h5py.File) -> Iterator[tuple[str, Place]]:
    """Return the vectors of numbers, each by its name in MATLAB."""
    for name, item in members(file).items():
        if not name.startswith("#"):
            yield from ((dotted(found), place) for found, place in _within(file, name, item))
    if _OBJECTS in file:
        cells = file[_OBJECTS][()].ravel()
        for number, reference in enumerate(cells[1:], 1):  # the first tells what the others are
            yield from _within(file, f"objects{{{number}}}", file[reference])


def _within(file: h5py.File, name: str, item: Any, depth: int = 0) -> Iterator[tuple[str, Place]]:
    """Return the vectors in a variable, a field or what a cell refers to."""
    if depth > DEEPEST or "MATLAB_empty" in item.attrs or "MATLAB_sparse" in item.attrs:
        return
    if hasattr(item, "keys"):
        for field, value in members(item).items():
            if _CLASS in value.attrs or not _refers(value):
                yield from _within(file, f"{name}.{field}", value, depth + 1)
            elif value.size <= MOST_MATRIX_COLUMNS:  # a field of an array of structs
                for k, reference in enumerate(value[()].ravel(), 1):
                    inner = file[reference]
                    yield from _within(file, f"{name}({k}).{field}", inner, depth + 1)
    elif _refers(item):
        if item.size <= MOST_MATRIX_COLUMNS:
            for k, reference in enumerate(item[()].ravel(), 1):
                yield from _within(file, f"{name}{{{k}}}", file[reference], depth + 1)
    elif _is_numeric(item):
        for ending, index in vectors_of(item.shape[::-1]):
            yield f"{name}{ending}", Place(str(item.name), index[::-1])


def _refers(item: Any) -> bool:
    """Return whether something is a list of references."""
    return hasattr(item, "dtype") and bool((item.dtype.metadata or {}).get("ref"))


def _is_numeric(item: Any) -> bool:
    if getattr(item, "shape", None) is None or item.dtype.kind not in "fiu" or item.size < 2:
        return False
    told = item.attrs.get(_CLASS, b"")
    if "MATLAB_object_decode" in item.attrs or np.asarray(told, dtype="S").item().decode() in (
        _NO_NUMBERS
    ):
        return False
    return item.dtype != np.uint32 or int(item[(0,) * item.ndim]) != OBJECT_REFERENCE
