"""Vectors in the groups of an HDF5 file, and where each stands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from motorctl.log.table import MOST_MATRIX_COLUMNS, Array

if TYPE_CHECKING:
    import h5py

DEEPEST = 32
"""Levels of groups within groups that are looked into. Larger follows links that lead back for
long, smaller misses signals. Chosen by hand: simulation tools nest buses some ten deep."""
_NUMBERS = "fiub"


@dataclass(frozen=True)
class Place:
    """Where one vector stands in a file."""

    dataset: str
    """Its path from the root."""
    index: tuple[int | slice, ...] | None = None
    """The row or column of a matrix; None: all of it."""
    field: str | None = None
    """The field of records."""

    def read(self, file: h5py.File) -> Array:
        """Return the vector, (N,)."""
        dataset = file[self.dataset]
        if self.field is not None:
            values = dataset[self.field]
            values = values if self.index is None else values[self.index]
        else:
            values = dataset[() if self.index is None else self.index]
        return np.asarray(values, dtype=np.float64).ravel()


def places_in_group(group: h5py.Group, depth: int = 0) -> Iterator[tuple[str, Place]]:
    """Return the vectors of numbers in a group and in those within it, each by its path."""
    if depth > DEEPEST:
        return
    for item in members(group).values():
        if hasattr(item, "keys"):
            yield from places_in_group(item, depth + 1)
        elif hasattr(item, "shape") and item.shape is not None:
            yield from _of_dataset(item)


def members(group: h5py.Group) -> dict[str, Any]:
    """Return what a group holds by name, but for links that lead nowhere."""
    found: dict[str, Any] = {}
    for name in group:
        try:
            found[name] = group[name]
        except (KeyError, OSError):
            continue
    return found


def _of_dataset(dataset: h5py.Dataset) -> Iterator[tuple[str, Place]]:
    path = str(dataset.name)
    name = path.lstrip("/")
    if dataset.dtype.names is None:
        for beside, index in _vectors(dataset.dtype, dataset.shape):
            yield f"{name}{beside}", Place(path, index)
        return
    for field in dataset.dtype.names:
        part = dataset.dtype[field]
        for beside, index in _vectors(part.base, (*dataset.shape, *part.shape)):
            yield f"{name}.{field}{beside}", Place(path, index, field)


def _vectors(
    dtype: np.dtype[Any], shape: tuple[int, ...]
) -> Iterator[tuple[str, tuple[int | slice, ...] | None]]:
    """Return for each vector in an array what its name ends with, and its index."""
    size = int(np.prod(shape))
    if dtype.kind not in _NUMBERS or size < 2:
        return
    if max(shape) == size:
        yield "", None
    elif len(shape) == 2 and shape[1] <= min(shape[0], MOST_MATRIX_COLUMNS):
        yield from ((f"[:,{k}]", (slice(None), k)) for k in range(shape[1]))
    elif len(shape) == 2 and shape[0] <= MOST_MATRIX_COLUMNS:
        yield from ((f"[{k},:]", (k, slice(None))) for k in range(shape[0]))
