"""Order between two processes: words that announce data, and the fences around them.

One process writes data and then a word that announces it; the other reads the word and then the
data. Neither the compiler nor the processor keeps that order by itself: a processor may let others
see its stores in another order than it made them (every ARM does). The functions here compile to
what makes both keep it: ``stlr``, ``ldar`` and ``dmb`` on AArch64; on x86-64, whose processors keep
this order anyway, to plain moves that the compiler must not shift.
"""

from __future__ import annotations

import platform
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic as _intrinsic

from motorctl.errors import UsageError

PROCESSORS = ("x86_64", "aarch64")
"""Where this order was checked in the code that the compiler makes."""

_WORD_BYTES = 8
intrinsic: Any = _intrinsic
"""Without numba's types, which know the generator of the code and not its caller."""


def require_known_processor(machine: str | None = None) -> None:
    """Refuse processors on which the order between two processes was never checked.

    Parameters
    ----------
    machine
        Name of the processor as `platform.machine` gives it; None: that of this computer.

    Raises
    ------
    UsageError
        Where it is neither x86_64 nor aarch64.
    """
    machine = machine or platform.machine()
    if machine not in PROCESSORS:
        raise UsageError(
            f"this computer's processor is {machine!r}; the loop process runs on "
            f"{' and '.join(PROCESSORS)} only, where the order of its shared memory is checked. "
            "`motorctl simulate` runs anywhere"
        )


def _word_at(context: Any, builder: Any, record: Any, field: str, pointer: Any) -> Any:
    """Return the address of an 8-byte integer in a record, as LLVM sees it."""
    return cgutils.get_record_member(  # type: ignore[no-untyped-call]
        builder, pointer, record.offset(field), context.get_data_type(record.typeof(field))
    )


def _check(record: Any, field: Any) -> str:
    """Return the field's name; raise TypingError where it is no aligned int64 of a record."""
    if not isinstance(record, types.Record) or not isinstance(field, types.StringLiteral):
        raise TypingError("expected a record and the name of one of its fields as a constant")
    name: str = field.literal_value
    if record.typeof(name) != types.int64 or record.offset(name) % _WORD_BYTES:
        raise TypingError(f"{name}: a word that announces data is an aligned int64")
    return name


@intrinsic(prefer_literal=True)
def load_acquire(typing: Any, record: Any, field: Any) -> Any:
    """Return a word of a record; no later read or write happens before it."""
    name = _check(record, field)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _word_at(context, builder, record, name, arguments[0])
        return builder.load_atomic(place, "acquire", _WORD_BYTES, typ=ir.IntType(64))

    return types.int64(record, field), code


@intrinsic(prefer_literal=True)
def store_release(typing: Any, record: Any, field: Any, value: Any) -> Any:
    """Write a word of a record; every earlier read and write happens before it."""
    name = _check(record, field)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _word_at(context, builder, record, name, arguments[0])
        builder.store_atomic(arguments[2], place, "release", _WORD_BYTES)
        return context.get_dummy_value()

    return types.void(record, field, types.int64), code


@intrinsic
def fence_acquire(typing: Any) -> Any:
    """Let no later read happen before an earlier one: between copying data and the second look."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.fence("acquire")
        return context.get_dummy_value()

    return types.void(), code


@intrinsic
def fence_release(typing: Any) -> Any:
    """Let no later write happen before an earlier one: between a word and overwriting old data."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.fence("release")
        return context.get_dummy_value()

    return types.void(), code
