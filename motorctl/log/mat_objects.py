"""What MATLAB's objects in a MAT file hold: a MAT file within the file.

A timeseries, a table or what Simulink returns is an object. Its variable is only a reference; what
it holds stands without names, one property after the other, in cells behind all variables. Vectors
and structs among them can be read, counted from 1; which property each is, is in a part of the file
that has no published format.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from motorctl.log.mat_structure import HEADER_BYTES, check_structure

WITHIN = "__function_workspace__"
"""What scipy calls the variable without a name."""
OBJECT_REFERENCE = 0xDD000000
"""The first number of an array that only refers to an object."""
_HEAD_BYTES = 8
"""Of the file within: version and byte order, where a whole file has 128 bytes."""


def held_by_objects(within: NDArray[np.uint8]) -> Iterator[tuple[int, Any]]:
    """Return what the objects of a MAT file hold, each with its number from 1.

    Parameters
    ----------
    within
        The bytes of the variable `WITHIN`, in any shape.

    Returns
    -------
    held : iterator of tuple[int, object]
        Number and value; references to other objects are left out. Nothing where the bytes are not
        those of objects, as where a file keeps a function.
    """
    try:
        file = _whole_file(within.astype(np.uint8).tobytes())
        check_structure(memoryview(file))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            kept = loadmat(BytesIO(file))[WITHIN]  # type: ignore[arg-type]
        cells = kept["MCOS"].item()["arr"].item().ravel(order="F")
    except Exception:  # whatever stands there: the file's own variables can still be read
        return
    for number, value in enumerate(cells[1:], 1):  # the first tells what the others are
        if not _refers(value):
            yield number, value


def _whole_file(content: bytes) -> bytes:
    """Return a MAT file of the first variable within; those behind it have no name either."""
    order = {b"IM": "<", b"MI": ">"}[content[2:4]]
    (size,) = struct.unpack_from(f"{order}I", content, _HEAD_BYTES + 4)
    first = content[_HEAD_BYTES : _HEAD_BYTES + 8 + size]
    return b" " * (HEADER_BYTES - 4) + content[:4] + first


def _refers(value: object) -> bool:
    return (
        isinstance(value, np.ndarray)
        and value.dtype == np.uint32
        and value.size > 0
        and int(value.ravel()[0]) == OBJECT_REFERENCE
    )
