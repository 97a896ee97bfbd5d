"""Columns of an HDF5 file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motorctl.errors import DataError
from motorctl.log.hdf5_place import Place, places_in_group
from motorctl.log.mat_in_hdf5 import is_of_matlab, places_of_matlab
from motorctl.log.table import Array, Table

if TYPE_CHECKING:
    import h5py


class Hdf5Table(Table):
    """An HDF5 file: vectors by their path, such as ``run/Y``, and columns of matrices.

    Columns of a matrix are ``run/Y[:,k]``, rows of one that has more columns than rows
    ``run/Y[k,:]``, k from 0, and fields of records ``run/table.field``.

    In a file of MATLAB's ``save -v7.3`` all is named as in other MAT files: ``struct.field``,
    ``name(:,k)``, ``name{k}``, ``name(k)``, k from 1.
    """

    kind = "HDF5"

    def __init__(self, path: Path) -> None:
        with _opened(path) as file:
            found = places_of_matlab(file) if is_of_matlab(file) else places_in_group(file)
            self._places: dict[str, Place] = dict(found)
        super().__init__(path, tuple(self._places))

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        with _opened(self.path) as file:
            return {name: self._places[name].read(file) for name in names}


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """Open a file for as long as something is read from it. Raises DataError."""
    library = _library(path)
    try:
        with library.File(path, "r", locking="best-effort") as file:
            yield file
    except Exception as error:  # a damaged file makes the reader fail in any way
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DataError(f"{path}: not an HDF5 file, or a damaged one: {cause}") from error


def _library(path: Path) -> Any:
    try:
        import h5py
    except ImportError as error:
        raise DataError(
            f"{path}: is HDF5, such as MATLAB's save -v7.3 writes, and to read it h5py is missing: "
            "pip install 'motorctl[hdf5]', or in MATLAB save it with -v7"
        ) from error
    return h5py
