"""Check the structure of a MAT file of version 4, as Quanser's QUARC and old programs write it.

Format: MathWorks, "MAT-File Format", chapter 1, "Level 4 MAT-File Format". Each matrix has a head
of five 32-bit integers (type, rows, columns, whether it is complex, length of the name), its name
and its numbers. The type's decimal digits MOPT are the machine, a zero, the kind of number and the
kind of matrix.
"""

from __future__ import annotations

import struct

_HEAD_BYTES = 20
_NUMBER_BYTES = {0: 8, 1: 4, 2: 4, 3: 2, 4: 2, 5: 1}
"""By P, the kind of number: double, single, int32, int16, uint16, uint8."""
_MACHINES = {0: "<", 1: ">"}
"""By M: IEEE little and big endian; VAX and Cray are older than any recording."""
_FULL, _SPARSE = 0, 2


def is_version_4(data: memoryview) -> bool:
    """Return whether a file begins as one of version 4: version 5 begins with four characters."""
    return len(data) >= _HEAD_BYTES and 0 in data[:4]


def check_version_4(data: memoryview) -> None:
    """Raise ValueError where a head makes no sense, or the numbers that it promises are missing."""
    at = 0
    while at < len(data):
        if len(data) - at < _HEAD_BYTES:
            raise ValueError("it ends within the head of a matrix")
        at += _HEAD_BYTES + _bytes_behind(data[at : at + _HEAD_BYTES])
        if at > len(data):
            raise ValueError("it ends within a matrix")


def _bytes_behind(head: memoryview) -> int:
    """Return how long name and numbers behind a head are."""
    order = "<" if 0 <= struct.unpack_from("<i", head)[0] < 5000 else ">"
    kind, rows, columns, is_complex, name = struct.unpack(f"{order}5i", head)
    machine, rest = divmod(kind, 1000)
    number, matrix = divmod(rest, 10)
    if _MACHINES.get(machine) != order or number not in _NUMBER_BYTES:
        raise ValueError(f"no MAT file of version 4 to 7: a matrix of type {kind}")
    if not _FULL <= matrix <= _SPARSE or is_complex not in (0, 1):
        raise ValueError(f"no MAT file of version 4 to 7: a matrix of type {kind}")
    if rows < 0 or columns < 0 or name < 1:
        raise ValueError(f"a matrix of {rows} rows and {columns} columns")
    numbers = rows * columns * (1 + is_complex)
    return int(name + numbers * _NUMBER_BYTES[number])
