"""Check the structure of a MAT file before scipy reads it.

scipy looks data types and array classes up in tables without checking the codes: a damaged file
can end the process. scipy 1.17.1 still does so (SIGSEGV) on 12 of 400 files with one to three bytes
changed at random. Format: MathWorks, "MAT-File Format", chapter 1, "Level 5 MAT-File Format".
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator

from motorctl.log.mat_version_4 import check_version_4, is_version_4

HEADER_BYTES = 128

_ORDERS = {b"IM": "<", b"MI": ">"}
_VALUES = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
"""miINT8 … miUTF32."""
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_CELL, _STRUCT, _OBJECT, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 5, 16, 17
_CLASSES = frozenset(range(1, 18))
_COMPLEX = 0x0800
_DEEPEST = 32

_Parts = list[tuple[int, memoryview]]


def check_structure(data: memoryview) -> None:
    """Raise ValueError where the tree of data elements is damaged."""
    if is_version_4(data):
        check_version_4(data)
        return
    order = _ORDERS.get(bytes(data[HEADER_BYTES - 2 : HEADER_BYTES]))
    if order is None:
        raise ValueError("no MAT file of version 4 to 7")
    for kind, content in _elements(data[HEADER_BYTES:], order):
        inner = [(kind, content)]
        if kind == _COMPRESSED:
            try:
                inner = list(_elements(memoryview(zlib.decompress(content)), order))
            except zlib.error as error:
                raise ValueError(f"its compressed data is damaged: {error}") from error
        for kind_inside, content_inside in inner:
            if kind_inside != _MATRIX:
                raise ValueError(f"data type {kind_inside} where an array should be")
            _check_matrix(content_inside, order, 0)


def _check_matrix(data: memoryview, order: str, depth: int) -> None:
    if depth > _DEEPEST:
        raise ValueError("its arrays are nested too deeply")
    parts = list(_elements(data, order))
    if not parts:
        return  # an empty array may be written so
    for kind, content in parts:
        if kind == _MATRIX:
            _check_matrix(content, order, depth + 1)
        elif kind not in _VALUES:
            raise ValueError(f"unknown data type {kind}")
    flags_kind, flags = parts[0]
    if flags_kind != _UINT32 or len(flags) != 8:
        raise ValueError("the head of an array is damaged")
    word = struct.unpack_from(f"{order}I", flags)[0]
    array_class, is_complex = word & 0xFF, bool(word & _COMPLEX)
    if array_class not in _CLASSES or not _has_its_parts(parts, order, array_class, is_complex):
        raise ValueError(f"an array of class {array_class} has not the parts that it should have")


def _has_its_parts(parts: _Parts, order: str, array_class: int, is_complex: bool) -> bool:
    """Return whether the parts behind the flags are as many and of the kinds that scipy reads."""
    if array_class in (_FUNCTION, _OPAQUE):
        return len(parts) > 1 and parts[-1][0] == _MATRIX
    if len(parts) < 3 or parts[1][0] not in (_INT32, _UINT32) or parts[2][0] not in (_INT8, _UTF8):
        return False
    sizes = struct.unpack_from(f"{order}{len(parts[1][1]) // 4}i", parts[1][1])
    if len(sizes) < 2 or min(sizes) < 0:
        return False
    rest = parts[3:]
    if array_class in (_STRUCT, _OBJECT):
        names = rest[array_class == _OBJECT :]
        if len(names) < 2 or names[0][0] not in (_INT32, _UINT32) or len(names[0][1]) != 4:
            return False
        longest = struct.unpack_from(f"{order}i", names[0][1])[0]
        if names[1][0] != _INT8 or longest < 1 or len(names[1][1]) % longest:
            return False
        cells, count = names[2:], math.prod(sizes) * (len(names[1][1]) // longest)
    elif array_class == _CELL:
        cells, count = rest, math.prod(sizes)
    else:
        values = (3 if array_class == _SPARSE else 1) + is_complex
        return len(rest) == values and all(kind in _VALUES for kind, _ in rest)
    return len(cells) == count and all(kind == _MATRIX for kind, _ in cells)


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Return type and content of each data element in `data`."""
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            raise ValueError("it ends within a data element")
        kind, size = struct.unpack_from(f"{order}II", data, at)
        begin = at + 8
        if kind >> 16:  # the small format: up to four bytes stand in the tag itself
            kind, size, begin = kind & 0xFFFF, kind >> 16, at + 4
            at += 8
            if size > 4:
                raise ValueError("a small data element is too large")
        else:
            at = begin + size
            if kind != _COMPRESSED:
                at += -at % 8
        if begin + size > len(data):
            raise ValueError("it ends within a data element")
        yield kind, data[begin : begin + size]
