"""Columns of a MATLAB file."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatlabOpaque

from motorctl.errors import DataError
from motorctl.log.columns import AXIS_SIGNALS
from motorctl.log.mat_objects import WITHIN, held_by_objects
from motorctl.log.mat_structure import check_structure
from motorctl.log.table import MOST_MATRIX_COLUMNS, Array, Table

METADATA_VARIABLE = "motorctl"


class MatTable(Table):
    """A MAT file up to version 7: vectors, and vectors in structs as ``struct.field``.

    Columns of a matrix are ``name(:,k)``, and rows of one that has more columns than rows
    ``name(k,:)``, as Simulink's and QUARC's "To File" write a signal a row. What cells hold is
    ``name{k}``, and the structs of an array are ``name(k)``, k from 1, as the signals that dSPACE
    and Simulink write. What objects hold, as a timeseries or Simulink's output, is ``objects{k}``
    or ``objects{k}.field``.

    A name of MATLAB cannot contain a dot, so ``x_position_m`` also means ``x.position_m``.
    """

    kind = "MAT"

    def __init__(self, path: Path) -> None:
        try:
            content = path.read_bytes()
            check_structure(memoryview(content))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                variables = loadmat(BytesIO(content))  # type: ignore[arg-type]
        except Exception as error:  # a damaged file makes the reader fail in any way
            cause = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise DataError(f"{path}: not a MAT file, or a damaged one: {cause}") from error
        metadata = _metadata(variables.pop(METADATA_VARIABLE, None))
        within = variables.pop(WITHIN, None)
        held = () if within is None else held_by_objects(within)
        variables |= {f"objects{{{number}}}": value for number, value in held}
        self._columns = {
            dotted(name): values
            for name, value in variables.items()
            if not name.startswith("__")
            for name, values in _vectors(name, value)
        }
        super().__init__(path, tuple(self._columns), metadata)

    def _load(self, names: Sequence[str]) -> dict[str, Array]:
        return {name: self._columns[name].astype(np.float64) for name in names}


def _vectors(name: str, value: object) -> Iterator[tuple[str, NDArray[Any]]]:
    """Return the numeric vectors in a variable; a struct has some in its fields, a cell in it."""
    if not isinstance(value, np.ndarray) or isinstance(value, MatlabOpaque):
        return  # an object is only a reference; what it holds is listed beside it
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _vectors(f"{name}.{field}", value.ravel()[0][field])
    elif value.dtype.names and value.size <= MOST_MATRIX_COLUMNS:
        for k, struct in enumerate(value.ravel(order="F"), 1):
            for field in value.dtype.names:
                yield from _vectors(f"{name}({k}).{field}", struct[field])
    elif value.dtype == object and value.size <= MOST_MATRIX_COLUMNS:
        for k, cell in enumerate(value.ravel(order="F"), 1):
            yield from _vectors(f"{name}{{{k}}}", cell)
    elif value.dtype.kind in "fiu":
        for ending, index in vectors_of(value.shape):
            yield f"{name}{ending}", value[index].ravel()


def vectors_of(shape: tuple[int, ...]) -> Iterator[tuple[str, tuple[int | slice, ...]]]:
    """Return for each vector in an array what its name in MATLAB ends with, and its index."""
    size = int(np.prod(shape))
    if size < 2:
        return
    if max(shape) == size:
        yield "", (slice(None),) * len(shape)
    elif len(shape) == 2:
        rows, columns = shape
        if columns < rows and columns <= MOST_MATRIX_COLUMNS:
            yield from ((f"(:,{k + 1})", (slice(None), k)) for k in range(columns))
        elif rows < columns and rows <= MOST_MATRIX_COLUMNS:
            yield from ((f"({k + 1},:)", (k, slice(None))) for k in range(rows))


def dotted(name: str) -> str:
    """Return a name of MATLAB with the dot before a signal that it cannot contain."""
    if "." not in name:
        for signal in sorted(AXIS_SIGNALS, key=len, reverse=True):
            if name.endswith(f"_{signal}"):
                return f"{name[: -len(signal) - 1]}.{signal}"
    return name


def _metadata(variable: object) -> dict[str, Any]:
    try:
        document = json.loads(str(np.asarray(variable).ravel()[0]))
    except (ValueError, IndexError):
        return {}
    return document if isinstance(document, dict) else {}
